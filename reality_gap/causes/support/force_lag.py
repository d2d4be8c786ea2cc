"""First-order lag of actuators' forces.

MuJoCo filters commands only, so that a hook adds the difference between filtered and unfiltered
force to the actuator's bias at each step.
"""

from __future__ import annotations

import math

import mujoco

from reality_gap.causes.support.actuators import Drive


class ForceLag:
    """Hook that filters the forces of actuators, from the first step on.

    It computes with floats, which is faster than with short arrays. A motor that also has an
    elastic gear has no lag.
    """

    def __init__(self, model: mujoco.MjModel, names: tuple[str, ...], time_constant: float) -> None:
        self._share = 1.0 - math.exp(-model.opt.timestep / time_constant)
        self._motors = [_Motor(model, name) for name in names]

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write the biases with which the actuators exert the filtered forces."""
        bias, step = model.actuator_biasprm, model.opt.timestep
        lengths, velocities = data.actuator_length, data.actuator_velocity
        for motor in self._motors:
            i, velocity = motor.index, velocities[motor.index]
            if motor.gain and not model.actuator_gainprm[i, 0]:
                continue  # an elastic gear has taken the motor over
            plain = bias[i, 0] - motor.added
            wanted = motor.gain * motor.drive(model, data) + motor.feeds * (
                plain + bias[i, 1] * (lengths[i] + step * velocity) + bias[i, 2] * velocity
            )
            wanted = min(max(wanted, motor.low), motor.high)
            force = wanted if motor.force is None else motor.force
            motor.force = force + self._share * (wanted - force)
            motor.added = motor.force - wanted
            bias[i, 0] = plain + motor.added


class _Motor:
    """Coefficients of an actuator, its filtered force and the amount added to its bias."""

    def __init__(self, model: mujoco.MjModel, name: str) -> None:
        self.index = i = int(model.actuator(name).id)
        self.drive = Drive(model, i)
        self.gain = float(model.actuator_gainprm[i, 0])
        self.feeds = float(int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_AFFINE))
        limits = model.actuator_forcerange[i] if model.actuator_forcelimited[i] else None
        self.low, self.high = (-math.inf, math.inf) if limits is None else map(float, limits)
        self.force: float | None = None
        self.added = 0.0
