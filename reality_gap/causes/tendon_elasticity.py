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
from numpy.typing import NDArray

from reality_gap.causes.base import Cause, Effects, Parameter, Place, Record, Values
from reality_gap.causes.support import actuators, elements
from reality_gap.study.system import System, Wire, column

Array = NDArray[np.float64]


def _places(system: System) -> tuple[Place, ...]:
    wires = {w.tendon for w in system.wires if w.servo or w.length_sensors}
    found = elements.each_wire(system) + elements.all_wires(system)
    return tuple(place for place in found if wires.issuperset(place.elements))


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    return (Parameter("compliance", "m/N", 3e-6, 5e-8, 0.0, 2e-4),)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    for name in place.elements:
        if not system.wire(name).servo:
            continue
        actuator, tendon = spec.actuator(system.wire(name).actuator), spec.tendon(name)
        shrink = 1 - actuator.biasprm[1] * actuator.gear[0] ** 2 * values["compliance"]
        actuator.gainprm[0] /= shrink
        actuator.biasprm[:2] /= shrink
        actuator.biasprm[2] /= shrink**2
        tendon.damping[0] /= shrink**2
        tendon.armature /= shrink**2


def _attach(effects: Effects, system: System, place: Place, values: Values) -> None:
    wires, compliance = [system.wire(name) for name in place.elements], values["compliance"]

    def lag(model: mujoco.MjModel, time: Array, command: Array) -> Array:
        command = command.copy()
        for wire in wires:
            i = column(model, wire.actuator)
            damping, shrink = _motor(model, wire, compliance)
            late = damping * compliance * shrink
            command[:, i] = np.interp(time - late, time, command[:, i])
        return command

    def stretch(record: Record) -> None:
        for wire in wires:
            _read(record, wire, compliance)

    if any(wire.servo for wire in wires):
        effects.commands.append(lag)
    effects.senses.append(stretch)


def _motor(model: mujoco.MjModel, wire: Wire, compliance: float) -> tuple[float, float]:
    """Damping of a wire's motor [N s/m], and what share of the path's motion it turns by."""
    damping = float(model.tendon_damping[model.tendon(wire.tendon).id])
    if not wire.servo:
        return 0.0, 1.0
    actuator = model.actuator(wire.actuator)
    shrink = 1 + float(actuator.biasprm[1] * actuator.gear[0] ** 2) * compliance
    return damping / shrink**2, shrink


def _read(record: Record, wire: Wire, compliance: float) -> None:
    """Its encoder and its tension sensor sit on the motor."""
    model, tendon = record.model, record.model.tendon(wire.tendon).id
    damping, shrink = _motor(model, wire, compliance)
    velocity, pull = record.velocity[:, tendon], actuators.pull(record, wire)
    free = ~actuators.at_limit(record, wire) if wire.servo else np.zeros(len(pull), dtype=bool)
    tension = pull + damping * np.where(free, shrink**2, 1.0) * velocity
    turning = velocity - compliance * np.gradient(tension, record.time)
    change = np.where(free, tension - damping * turning - pull, 0.0)
    for sensor in wire.length_sensors:
        record.sensors[:, record.column(sensor)] -= compliance * tension
    for sensor in wire.tension_sensors:
        record.sensors[:, record.column(sensor)] -= change


CAUSE = Cause(
    id="tendon_elasticity",
    title="elastic wire",
    explanation="A wire stretches with its tension, so that it pulls less than it should.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
