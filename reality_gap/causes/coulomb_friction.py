"""Coulomb friction of a tendon in its guides, or of a joint."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import elements, lugre, typical_scales
from reality_gap.study.system import System

USUAL, SPREAD = 1.5e-3, 1e-3
"""Friction of a tendon whose nominal model has none, and its standard deviation, both as a share of
the tendon's typical force."""


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_tendon(system) + elements.all_tendons(system) + elements.each_joint(system)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.kind == "tendon":
        size = typical_scales.tendon_force(system, location)
        usual = 0.0 if lugre.has_nominal_friction(system, location) else USUAL * size
        friction = Parameter("friction", "N", 3.0, SPREAD * size, 0.0, 200.0, usual=usual)
    else:
        unit, size = typical_scales.joint_force(system, location)
        friction = Parameter("friction", unit, 0.02 * size, 0.0005 * size, 0.0, 2.0 * size)
    if not lugre.is_available(system):
        return (friction,)
    return (friction, lugre.presliding_parameter(system, location))


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if values["friction"]:
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
