"""Coulomb friction of a tendon in its guides, or of a joint.

Friction of a joint that the nominal model has (``frictionloss``) may also be too large: a negative
value takes it away.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import elements, lugre, shared_amounts, typical_scales
from reality_gap.causes.support.shared_amounts import BEYOND, EXCESS, FACTOR
from reality_gap.study.system import System

USUAL, SPREAD = 1.5e-3, 1e-3
"""Friction of a tendon whose nominal model has none, and its standard deviation, both as a share of
the tendon's typical force."""
NOMINAL_ERROR = 0.04
"""Relative standard deviation of a friction in the nominal model."""


def _locations(system: System) -> tuple[Location, ...]:
    of_tendons = elements.each_tendon(system) + elements.all_tendons(system)
    every = shared_amounts.all_joints(system, system.model.dof_frictionloss)
    return of_tendons + elements.each_joint(system) + every


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.note == FACTOR:
        return (Parameter(EXCESS, "1", 0.2, NOMINAL_ERROR, -BEYOND, 20.0),)
    if location.kind == "tendon":
        size = typical_scales.tendon_force(system, location)
        hints = SearchHints(secants=elements.secants(system, location, (0.2 * size,)))
        usual = 0.0 if lugre.has_nominal_friction(system, location) else USUAL * size
        friction = Parameter(
            "friction", "N", 0.03 * size, SPREAD * size, 0.0, 2.0 * size, hints=hints, usual=usual
        )
    else:
        unit, size = typical_scales.weakest_force(system, location)
        nominal = shared_amounts.least(system, location, system.model.dof_frictionloss)
        tolerance = max(0.0015 * size, NOMINAL_ERROR * nominal)
        low = -BEYOND * nominal
        hints = SearchHints(secants=elements.secants(system, location, (0.1 * size, 0.4 * size)))
        friction = Parameter("friction", unit, 0.02 * size, tolerance, low, 2.0 * size, hints=hints)
    if not lugre.is_available(system):
        return (friction,)
    return (friction, lugre.presliding_parameter(system, location))


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if location.kind == "joint" and (location.note == FACTOR or values["friction"] < 0.0):
        nominal = system.model.dof_frictionloss
        added = shared_amounts.amounts(system, location, nominal, "friction", values)
        for name, amount in added.items():
            joint = spec.joint(name)
            joint.frictionloss = max(0.0, joint.frictionloss + amount)
    elif values["friction"]:
        distance = lugre.presliding(values, system, location)
        lugre.add_friction(spec, system, CAUSE.id, location, values["friction"], distance)


CAUSE = Cause(
    id="coulomb_friction",
    title="Coulomb friction",
    explanation="A force of constant size opposes the motion, so that an element sticks and lags.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    sticky=True,
)
