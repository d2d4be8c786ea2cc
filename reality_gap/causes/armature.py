"""Armature: the inertia of a motor's rotor, seen through its gear, at a joint.

A rotor of inertia ``J`` behind a gear of ratio ``n`` adds ``n^2 J``, which is often more than the
inertia of the link.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import elements, shared_amounts, typical_scales
from reality_gap.causes.support.own_amounts import with_own_amounts
from reality_gap.causes.support.shared_amounts import EXCESS, FACTOR, REDUCIBLE
from reality_gap.study.system import System

NOMINAL_ERROR = 0.03
"""Relative standard deviation of an armature in the nominal model."""

ODDS = -1.0
"""Log odds of an armature [nats]: without gravity, the mass of a slide's link does the same, and is
named first."""


def _locations(system: System) -> tuple[Location, ...]:
    every = shared_amounts.all_joints(system, system.model.dof_armature)
    return elements.each_joint(system) + every


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.note == FACTOR:
        return (Parameter(EXCESS, "1", 0.2, NOMINAL_ERROR, -1.0, 20.0, hints=REDUCIBLE),)
    nominal = shared_amounts.least(system, location, system.model.dof_armature)
    size = min(typical_scales.joint_inertia(system, name) for name in location.elements)
    unit = "kg" if typical_scales.slides(system, location.elements[0]) else "kg m^2"
    tolerance = max(0.001 * size, NOMINAL_ERROR * nominal)
    sizes = (0.1 * size, tolerance, -nominal, 20.0 * size)
    hints = SearchHints(secants=(size,), absence=True)
    return (Parameter("inertia", unit, *sizes, hints=hints),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    nominal = system.model.dof_armature
    added = shared_amounts.amounts(system, location, nominal, "inertia", values)
    for name, amount in added.items():
        spec.joint(name).armature = max(0.0, spec.joint(name).armature + amount)


def _prior(location: Location) -> float:
    return ODDS


CAUSE = with_own_amounts(
    Cause(
        id="armature",
        title="wrong inertia of a rotor",
        explanation="The rotor of a motor adds another inertia to its joint than the model says.",
        locations=_locations,
        parameters=_parameters,
        edit=_edit,
        prior=_prior,
    )
)
