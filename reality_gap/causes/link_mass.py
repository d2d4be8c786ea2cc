"""Link mass: a link, or one of its bodies alone, is heavier or lighter than in the nominal model.

Mass and inertia change by the same factor. A link consists of the bodies that are welded together.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import links
from reality_gap.causes.support.own_amounts import with_own_amounts
from reality_gap.study.system import System

ALONE = "alone"
"""Note of a location of one body of a link; without it, the body stands for its whole link."""
TOLERANCE = 0.008
"""Standard deviation of the mass of a link or of its part, over that of the link."""
PART = 0.1
"""Smallest share of a link's mass with which one of its bodies is a location of its own."""


def _locations(system: System) -> tuple[Location, ...]:
    found = list[Location]()
    for link in links.links(system):
        found.append(Location("body", (link.name,)))
        parts = [name for name in link.bodies if _mass(system, (name,)) > PART * link.mass]
        found += [Location("body", (name,), ALONE) for name in parts if len(parts) > 1]
    return tuple(found)


def _bodies(system: System, location: Location) -> tuple[str, ...]:
    if location.note == ALONE:
        return location.elements
    return links.link(system, system.model.body(location.elements[0]).id).bodies


def _mass(system: System, bodies: tuple[str, ...]) -> float:
    return sum(float(system.model.body(name).mass[0]) for name in bodies)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    mass = _mass(system, _bodies(system, location))
    link = links.link(system, system.model.body(location.elements[0]).id)
    tolerance = TOLERANCE * _mass(system, link.bodies)
    return (Parameter("mass", "kg", 0.1 * mass, tolerance, -0.9 * mass, 3.0 * mass),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    bodies = _bodies(system, location)
    share = values["mass"] / _mass(system, bodies)
    for name in bodies:
        body = links.editable_body(spec, system, name)
        nominal = system.model.body(name)
        body.mass += share * float(nominal.mass[0])
        body.inertia = body.inertia + share * nominal.inertia


CAUSE = with_own_amounts(
    Cause(
        id="link_mass",
        title="wrong mass of a link",
        explanation="Mass and inertia of a link, or of a part of it, are wrong by a factor.",
        locations=_locations,
        parameters=_parameters,
        edit=_edit,
    )
)
