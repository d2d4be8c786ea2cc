"""Tendon elasticity: a tendon stretches in proportion to its tension.

A massless tendon of compliance ``c`` [m/N] with a length servo on its motor side has the tension

    T = bias + K (path - c T - target)

limited to the force range, with the stiffness ``K`` of the servo. Solved for ``T``, bias and
stiffness are multiplied by ``s = 1 / (1 + K c)``, and the limits are unchanged. An elastic tendon
therefore needs neither additional bodies nor a smaller time step, and the extended model is exact
in statics.

The damping ``D`` and the armature of the tendon and the velocity gain ``kv`` of the servo are those
of its motor, which turns by the share ``s`` of the motion of the path; all are multiplied by
``s^2``. As the motor also turns with its target, the tension follows the target with a first-order
lag of ``(D + kv) c s``. The force of the actuator is the tension without the damping force of the
motor. In simulations of the spool at time steps of 0.1 ms, with ``D`` or ``kv`` of 9 ms of ``K``,
tendons of 0.4 ``K``, and stairs of commands, the errors are below the noise: 0.1 % of the travel,
0.5 % of the pull. The motion of the load, unlike the target, acts without the lag: on a load with
damping and hardly any inertia, pulled by a tendon of 3 ``K``, the force was off by 1.6 %.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.signal import lfilter

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, SearchHints, Values
from reality_gap.causes.support import actuators, elements, typical_scales
from reality_gap.study.system import ActuatedTendon, System, column
from reality_gap.types import Floats

LARGE = 0.1
"""Compliance at which the cause is screened in addition, over travel by force of the tendons."""


def _locations(system: System) -> tuple[Location, ...]:
    tendons = {w.name for w in system.tendons if w.servo or w.length_sensors}
    found = elements.each_tendon(system) + elements.all_tendons(system)
    return tuple(location for location in found if tendons.issuperset(location.elements))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    soft = typical_scales.tendon_travel(system) / typical_scales.tendon_force(system, location)
    # Beside dry friction, small values change when it turns, and tell little of large ones.
    hints = SearchHints(secants=elements.secants(system, location, (LARGE * soft,)))
    sizes = (0.004 * soft, 7e-5 * soft, 0.0, 0.27 * soft)
    return (Parameter("compliance", "m/N", *sizes, hints=hints),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        if not system.tendon(name).servo:
            continue
        actuator, tendon = spec.actuator(system.tendon(name).actuator), spec.tendon(name)
        shrink = 1 - actuator.biasprm[1] * actuator.gear[0] ** 2 * values["compliance"]
        actuator.gainprm[0] /= shrink
        actuator.biasprm[:2] /= shrink
        actuator.biasprm[2] /= shrink**2
        tendon.damping[0] /= shrink**2
        tendon.armature /= shrink**2


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    tendons, compliance = [system.tendon(name) for name in location.elements], values["compliance"]

    def follow(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        command = command.copy()
        for tendon in tendons:
            i = column(model, tendon.actuator)
            lag = _motor(model, tendon, compliance).lag
            command[:, i] = _lagged(command[:, i], lag, model.opt.timestep)
        return command

    def stretch(record: Record) -> None:
        for tendon in tendons:
            _read(record, tendon, compliance)

    if any(tendon.servo for tendon in tendons):
        effects.commands.append(follow)
    effects.readings.append(stretch)
    effects.of_forces.append(stretch)


class _Motor(NamedTuple):
    """Numbers of the motor of an elastic tendon.

    Attributes:
        damping: of the tendon [N s/m].
        gain: of the velocity, of its servo [N s/m].
        share: of the motion of the path by which it turns [1].
        lag: time constant with which the tension follows the target and the path [s].
    """

    damping: float
    gain: float
    share: float
    lag: float


def _motor(model: mujoco.MjModel, tendon: ActuatedTendon, compliance: float) -> _Motor:
    """Return the numbers of a motor from the model with the elastic tendon."""
    if not tendon.servo:
        return _Motor(0.0, 0.0, 1.0, 0.0)
    actuator, gear = model.actuator(tendon.actuator), float(model.actuator(tendon.actuator).gear[0])
    share = 1 + float(actuator.biasprm[1]) * gear**2 * compliance
    damping = float(model.tendon_damping[model.tendon(tendon.name).id]) / share**2
    gain = -float(actuator.biasprm[2]) * gear**2 / share**2
    return _Motor(damping, gain, share, (damping + gain) * compliance * share)


def _lagged(values: Floats, lag: float, step: float) -> Floats:
    """Return values that are constant in each step, behind a first-order lag: their means in it."""
    if lag <= 0.0:
        return values
    steps = step / lag
    kept = float(np.exp(-steps))
    at_end = lfilter([1.0 - kept], [1.0, -kept], values, zi=[kept * values[0]])[0]
    before = np.concatenate([values[:1], at_end[:-1]])
    return np.asarray(values + (before - values) * (1.0 - kept) / steps)


def _read(record: Record, tendon: ActuatedTendon, compliance: float) -> None:
    """Correct the readings of encoder and tension sensor, which are on the motor side."""
    model = record.model
    motor = _motor(model, tendon, compliance)
    velocity = record.velocity[:, model.tendon(tendon.name).id]
    pull = actuators.pull(record, tendon)
    free = ~actuators.at_limit(record, tendon) if tendon.servo else np.zeros(len(pull), dtype=bool)
    late = _lagged(velocity, motor.lag, float(model.opt.timestep))
    held = motor.share**2 * ((motor.damping + motor.gain) * late - motor.gain * velocity)
    tension = pull + np.where(free, held, motor.damping * velocity)
    # Backwards, so that the last step under a command does not show the next one.
    turning = velocity - compliance * np.diff(tension, prepend=tension[0]) / model.opt.timestep
    change = np.where(free, tension - motor.damping * turning - pull, 0.0)
    for sensor in tendon.length_sensors:
        record.sensors[:, record.column(sensor)] -= compliance * tension
    for sensor in tendon.tension_sensors:
        record.sensors[:, record.column(sensor)] -= change


CAUSE = Cause(
    id="tendon_elasticity",
    title="elastic tendon",
    explanation="A tendon stretches under its tension, so that its servo is softer.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
