"""Joint stiffness: a spring in a joint, such as that of a cover, a cable loom or a seal.

A spring that the nominal model has may also be too stiff or too soft by a factor, with its own rest
position.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import elements, encoders, typical_scales
from reality_gap.causes.support.shared_amounts import REDUCIBLE
from reality_gap.study.system import System

FAR = (0.3, 1.0)
"""Stiffnesses from which fits start where slopes at the null do not hold, over the typical force
over the range of the joint."""
MOST = 5.0
"""Largest stiffness over the typical force over the range; a servo may be stiffer."""
NOMINAL = "spring of the model"
"""Note of a location where the stiffness of the nominal spring is wrong."""


def _locations(system: System) -> tuple[Location, ...]:
    each, stiffness = elements.each_joint(system), system.model.jnt_stiffness
    sprung = tuple(name for name in system.joints if stiffness[system.model.joint(name).id].any())
    groups = [(name,) for name in sprung] + ([sprung] if len(sprung) > 1 else [])
    return each + tuple(Location("joint", names, NOMINAL) for names in groups)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.note == NOMINAL:
        return (Parameter("excess", "1", 0.2, 0.02, -1.0, 20.0, hints=REDUCIBLE),)
    model, joint = system.model, system.model.joint(location.elements[0])
    force, size = typical_scales.joint_force(system, location)
    unit, travel = typical_scales.joint_travel(system, location)
    low, high = (float(end) for end in joint.range) if joint.limited[0] else (-travel, travel)
    zero = float(model.qpos0[joint.qposadr[0]])
    starts = tuple(dict.fromkeys((0.5 * (low + high), zero)))
    stiff = size / travel
    far = SearchHints(far_starts=tuple(share * stiff for share in FAR))
    most = max(MOST * stiff, _servo_stiffness(system, location))
    sizes = 0.05 * stiff, 0.0005 * stiff, 0.0, most
    return (
        Parameter("stiffness", f"{force}/{unit}", *sizes, hints=far),
        Parameter(
            "rest",
            unit,
            0.1 * travel,
            0.0,
            low - travel,
            high + travel,
            starts[0],
            SearchHints(starts),
        ),
    )


def _servo_stiffness(system: System, location: Location) -> float:
    """Return the stiffness with which a servo holds a joint [N m/rad or N/m]; 0 without one."""
    [encoder] = encoders.encoders(system, location)
    if not encoder.actuator:
        return 0.0
    i = system.model.actuator(encoder.actuator).id
    gain, gear = system.model.actuator_biasprm[i, 1], system.model.actuator_gear[i, 0]
    return float(abs(gain) * gear**2)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    """Combine the new spring and that of the model into one."""
    if location.note == NOMINAL:
        for name in location.elements:
            joint = spec.joint(name)
            joint.stiffness = joint.stiffness * (1 + values["excess"])
        return
    added = values["stiffness"]
    if not added:
        return
    joint = spec.joint(location.elements[0])
    hinge = joint.type == mujoco.mjtJoint.mjJNT_HINGE
    rest = np.rad2deg(values["rest"]) if hinge and spec.compiler.degree else values["rest"]
    old = float(joint.stiffness[0])
    joint.springref = (old * joint.springref + added * rest) / (old + added)
    joint.stiffness[0] = old + added


CAUSE = Cause(
    id="joint_stiffness",
    title="spring in a joint",
    explanation="A spring pulls a joint towards a rest position.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    includes=("force_offset",),
)
