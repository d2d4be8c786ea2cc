"""Joint coupling: a joint that nothing drives in the model moves with the joint before it.

In fingers and legs a tendon or a linkage lets such a joint follow another one by a ratio. The
coupling is a spring between the position of the joint and ``ratio`` times that of the joint before,
damped at half of the critical damping, and relaxed at the model's ``qpos0``. From no coupling to a
rigid one its stiffness spans decades, so that its logarithm is a parameter:

    stiffness = (exp(rigidity) - 1) force / travel

with the typical force and travel of the joint, up to what the time step of the model allows.
"""

from __future__ import annotations

import math

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import joint_tree, typical_scales
from reality_gap.study.system import System

WITH, AGAINST = "with ", "against "
"""First word of the note of a location with a positive ratio, or a negative one; the name of the
joint before follows."""
SECANTS = (1.0, 3.0, 6.0)
"""Rigidities at which the cause is screened in addition to a small one."""
RATIO = (0.05, 5.0)
"""Bounds of the size of the ratio."""
STABLE = 0.05
"""Largest stiffness over moving inertia and squared time step."""
DAMPED = 0.5
"""Damping of the coupling over its critical damping."""
ODDS = -1.0
"""Log odds of a coupling [nats], which also does what a spring of the joint does."""


def _locations(system: System) -> tuple[Location, ...]:
    if system.study.inverse:
        return ()
    return tuple(
        Location("joint", (name,), word + before)
        for name in joint_tree.passive_joints(system)
        if (before := joint_tree.joint_before(system, name))
        for word in (WITH, AGAINST)
    )


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    sign = 1.0 if location.note.startswith(WITH) else -1.0
    low, high = sorted(sign * size for size in RATIO)
    return (
        Parameter("rigidity", "1", 0.5, 0.005, 0.0, 20.0, hints=SearchHints(secants=SECANTS)),
        Parameter("ratio", "1", 0.1, 0.0, low, high, sign, SearchHints(shape=True)),
    )


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if not values["rigidity"]:
        return
    [joint], before = location.elements, location.note.split(" ", 1)[1]
    inertia = typical_scales.joint_inertia(system, joint)
    _, force = typical_scales.joint_force(system, location)
    _, travel = typical_scales.joint_travel(system, location)
    stiffest = STABLE * inertia / float(system.model.opt.timestep) ** 2
    stiffness = min(math.expm1(values["rigidity"]) * force / travel, stiffest)
    tendon = joint_tree.add_fixed_tendon(spec, CAUSE.id, joint, before, -values["ratio"])
    tendon.stiffness[0] = stiffness
    tendon.damping[0] = 2.0 * DAMPED * math.sqrt(stiffness * inertia)


def _prior(location: Location) -> float:
    return ODDS


CAUSE = Cause(
    id="joint_coupling",
    title="joint that moves with another one",
    explanation="A joint that nothing drives in the model moves with the joint before it.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    prior=_prior,
)
