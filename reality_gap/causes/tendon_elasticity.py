"""A wire that stretches under its tension.

A wire without mass and with a length servo on its motor side pulls with ``T = bias + K (path - c T
- target)``, cut at the force range; solved for T, everything shrinks by ``s = 1 / (1 + K c)``, and
the cut stays where it is. So elastic wires need no further bodies and no smaller time step, and the
replay of the extended model is exact in statics. A tendon's damping D and armature stand for its
motor, which turns by s of what the path moves, and so reach the joint shrunk by s squared. As the
motor also turns with its target, the target acts ``D c s`` late; and what the actuator gives is the
wire's tension without D times the motor's velocity. Against a simulated spool at 0.02 ms (K 20
N/mm, D 150 N s/m, wires of 20 to 200 N/mm) that leaves 0.01 mm and 0.1 N.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support import actuators, elements
from reality_gap.study.system import ActuatedTendon, System, column
from reality_gap.types import Floats


def _locations(system: System) -> tuple[Location, ...]:
    tendons = {w.name for w in system.tendons if w.servo or w.length_sensors}
    found = elements.each_tendon(system) + elements.all_tendons(system)
    return tuple(location for location in found if tendons.issuperset(location.elements))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return (Parameter("compliance", "m/N", 3e-6, 5e-8, 0.0, 2e-4),)


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


def _motor(model: mujoco.MjModel, tendon: ActuatedTendon, compliance: float) -> tuple[float, float]:
    """Damping of a wire's motor [N s/m], and what share of the path's motion it turns by."""
    damping = float(model.tendon_damping[model.tendon(tendon.name).id])
    if not tendon.servo:
        return 0.0, 1.0
    actuator = model.actuator(tendon.actuator)
    shrink = 1 + float(actuator.biasprm[1] * actuator.gear[0] ** 2) * compliance
    return damping / shrink**2, shrink


def _read(record: Record, tendon: ActuatedTendon, compliance: float) -> None:
    """Its encoder and its tension sensor sit on the motor."""
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
    title="elastic wire",
    explanation="A wire stretches with its tension, so that it pulls less than it should.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
