"""Joint stiffness: a spring in a joint, such as that of a cover, a cable loom or a seal."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import elements, typical_scales
from reality_gap.study.system import System


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_joint(system)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    model, joint = system.model, system.model.joint(location.elements[0])
    force, size = typical_scales.joint_force(system, location)
    unit, travel = typical_scales.joint_travel(system, location)
    low, high = (float(end) for end in joint.range) if joint.limited[0] else (-travel, travel)
    zero = float(model.qpos0[joint.qposadr[0]])
    starts = tuple(dict.fromkeys((0.5 * (low + high), zero)))
    stiff = size / travel
    return (
        Parameter("stiffness", f"{force}/{unit}", 0.05 * stiff, 0.0005 * stiff, 0.0, 5.0 * stiff),
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


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    """Combine the new spring and that of the model into one."""
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
)
