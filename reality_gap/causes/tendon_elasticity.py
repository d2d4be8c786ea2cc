"""Tendon elasticity: a tendon stretches in proportion to its tension.

A massless tendon of compliance ``c`` [m/N] with a length servo on its motor side has the tension

    T = bias + K (path - c T - target)

limited to the force range, with the stiffness ``K`` of the servo. Solved for ``T``, bias and
stiffness are multiplied by ``s = 1 / (1 + K c)``, and the limits are unchanged. An elastic tendon
therefore needs neither additional bodies nor a smaller time step, and the extended model is exact
in statics.

The damping ``D`` and the armature of the tendon are those of its motor, which turns by the share
``s`` of the motion of the path; both are multiplied by ``s^2``. As the motor also turns with its
target, the target acts with a delay of ``D c s``. The force of the actuator is the tension without
the damping force of the motor. Compared with a simulation of the spool at time steps of 0.02 ms (K
= 20 N/mm, D = 150 N s/m, tendons of 20 to 200 N/mm), the errors are 0.01 mm and 0.1 N.
"""

from __future__ import annotations

import mujoco
import numpy as np

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

    def lag(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        command = command.copy()
        for tendon in tendons:
            i = column(model, tendon.actuator)
            damping, shrink = _motor(model, tendon, compliance)
            late = damping * compliance * shrink
            command[:, i] = np.interp(time - late, time, command[:, i])
        return command

    def stretch(record: Record) -> None:
        for tendon in tendons:
            _read(record, tendon, compliance)

    if any(tendon.servo for tendon in tendons):
        effects.commands.append(lag)
    effects.readings.append(stretch)
    effects.of_forces.append(stretch)


def _motor(model: mujoco.MjModel, tendon: ActuatedTendon, compliance: float) -> tuple[float, float]:
    """Return the damping of a motor [N s/m] and its share ``s`` of the path's motion."""
    damping = float(model.tendon_damping[model.tendon(tendon.name).id])
    if not tendon.servo:
        return 0.0, 1.0
    actuator = model.actuator(tendon.actuator)
    shrink = 1 + float(actuator.biasprm[1] * actuator.gear[0] ** 2) * compliance
    return damping / shrink**2, shrink


def _read(record: Record, tendon: ActuatedTendon, compliance: float) -> None:
    """Correct the readings of encoder and tension sensor, which are on the motor side."""
    model = record.model
    damping, shrink = _motor(model, tendon, compliance)
    velocity = record.velocity[:, model.tendon(tendon.name).id]
    pull = actuators.pull(record, tendon)
    free = ~actuators.at_limit(record, tendon) if tendon.servo else np.zeros(len(pull), dtype=bool)
    tension = pull + damping * np.where(free, shrink**2, 1.0) * velocity
    turning = velocity - compliance * np.gradient(tension, record.time)
    change = np.where(free, tension - damping * turning - pull, 0.0)
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
