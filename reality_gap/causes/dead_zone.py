"""Dead zone of a drive: small commands, or small errors of a servo, have no effect.

A motor with a dead zone of half-width ``d`` exerts the force of the command ``u`` less its nearest
value within ``[-d, d]``. In a position servo, this applies to its error, the difference between
command and reading, as with the "dead band" of hobby servos. Source: G. Tao and P. V. Kokotovic,
"Adaptive Control of Systems with Actuator and Sensor Nonlinearities", 1996.
"""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import drives, elements, typical_scales
from reality_gap.causes.support.actuators import Drive
from reality_gap.study.system import System, column
from reality_gap.types import Floats

OF_TRAVEL = (0.01, 0.05)
"""Half-widths of a servo's dead zone at which the cause is screened in addition to a small one,
over the travel of its joint or tendon."""
OF_FORCE = (0.1, 0.4)
"""The same of a motor, over its typical force."""
ODDS = -2.0
"""Log odds of a dead zone [nats]: it explains a little of anything that sticks or lags."""


def _locations(system: System) -> tuple[Location, ...]:
    servos = drives.each_and_all(system, drives.is_servo)
    motors = drives.each_and_all(system, _is_open)
    return servos + tuple(p for p in motors if _command_force(system, p))


def _is_open(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether a drive has no feedback of a position."""
    return drives.is_drive(model, actuator) and not drives.is_servo(model, actuator)


def _command_force(system: System, location: Location) -> bool:
    """Return whether commands of all motors exert a force."""
    return all(float(system.model.actuator(name).gainprm[0]) for name in location.elements)


def _is_of_servos(system: System, location: Location) -> bool:
    return drives.is_servo(system.model, system.model.actuator(location.elements[0]).id)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if _is_of_servos(system, location):
        unit, size = drives.typical_travel(system, location)
        shares, scale, tolerance, high = OF_TRAVEL, 0.003 * size, 1e-4 * size, 0.5 * size
    else:
        each = [Location("actuator", (name,)) for name in location.elements]
        size, unit = min(typical_scales.actuator_force(system, one)[::-1] for one in each)
        tolerance = typical_scales.OF_MOTOR * min(
            typical_scales.force_tolerance(system, one) for one in each
        )
        shares, scale, high = OF_FORCE, 0.02 * size, 2.0 * size
    values = elements.secants(system, location, tuple(share * size for share in shares))
    hints = SearchHints(secants=values)
    return (Parameter("half_width", unit, scale, tolerance, 0.0, high, hints=hints),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    half, names = values["half_width"], location.elements
    if not half:
        return
    if _is_of_servos(system, location):
        effects.add_hook(lambda model: _DeadBand(model, names, half))
    else:
        effects.commands.append(partial(_deadened, names, half))


def _deadened(
    names: tuple[str, ...], half: float, model: mujoco.MjModel, time: Floats, command: Floats
) -> Floats:
    found = command.copy()
    for name in names:
        at, width = column(model, name), half / abs(float(model.actuator(name).gainprm[0]))
        found[:, at] -= np.clip(command[:, at], -width, width)
    return found


class _DeadBand:
    """Hook that takes the nearest error within the dead zone off the errors of servos.

    It computes with floats, which is faster than with short arrays.
    """

    def __init__(self, model: mujoco.MjModel, names: tuple[str, ...], half: float) -> None:
        self._servos = [_Servo(model, name, half) for name in names]

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write the biases that make up for the errors within the dead zone."""
        bias = model.actuator_biasprm
        for servo in self._servos:
            error = servo.ratio * servo.drive(model, data) - servo.motion.position(model, data)
            added = -servo.stiffness * min(max(error, -servo.half), servo.half)
            bias[servo.index, 0] += added - servo.added
            servo.added = added


class _Servo:
    """Coefficients of a servo, and the amount that is added to its bias."""

    def __init__(self, model: mujoco.MjModel, name: str, half: float) -> None:
        self.index = i = int(model.actuator(name).id)
        self.motion = drives.Motion(model, name)
        self.drive = Drive(model, i)
        self.half = half * abs(float(model.actuator_gear[i, 0]))
        self.stiffness = -float(model.actuator_biasprm[i, 1])
        self.ratio = float(model.actuator_gainprm[i, 0]) / self.stiffness
        self.added = 0.0


def _prior(location: Location) -> float:
    return ODDS


CAUSE = Cause(
    id="dead_zone",
    title="dead zone of a drive",
    explanation="Commands to a motor, or errors of a servo, that are below a size have no effect.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
    prior=_prior,
    fine=True,
)
