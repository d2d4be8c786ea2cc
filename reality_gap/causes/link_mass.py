"""A link, or one of the bodies that it is welded of, that is heavier or lighter than drawn.

Heavier everywhere by the same share: a link's bodies all together, or one of them alone.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Parameter, Place, Values
from reality_gap.causes.support import links
from reality_gap.study.system import System

ALONE = "alone"
"""Note of the place of one body of a link; without it a body stands for its whole link."""
PART = 0.1
"""Share of a link's mass that a body of it has at least, to be looked at alone."""


def _places(system: System) -> tuple[Place, ...]:
    found = list[Place]()
    for link in links.links(system):
        found.append(Place("body", (link.name,)))
        parts = [name for name in link.bodies if _mass(system, (name,)) > PART * link.mass]
        found += [Place("body", (name,), ALONE) for name in parts if len(parts) > 1]
    return tuple(found)


def _bodies(system: System, place: Place) -> tuple[str, ...]:
    if place.note == ALONE:
        return place.elements
    return links.link(system, system.model.body(place.elements[0]).id).bodies


def _mass(system: System, bodies: tuple[str, ...]) -> float:
    return sum(float(system.model.body(name).mass[0]) for name in bodies)


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    mass = _mass(system, _bodies(system, place))
    tolerance = 0.0 if place.note == ALONE else 0.003 * mass
    return (Parameter("mass", "kg", 0.1 * mass, tolerance, -0.9 * mass, 3.0 * mass),)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    bodies = _bodies(system, place)
    share = values["mass"] / _mass(system, bodies)
    for name in bodies:
        body = links.inertial(spec, system, name)
        drawn = system.model.body(name)
        body.mass += share * float(drawn.mass[0])
        body.inertia = body.inertia + share * drawn.inertia


CAUSE = Cause(
    id="link_mass",
    title="wrong mass of a link",
    explanation="A link, or a part of it, is heavier or lighter than drawn, its inertia as well.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
)
