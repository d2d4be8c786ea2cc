"""A link that is heavier or lighter than drawn, everywhere by the same share."""

from __future__ import annotations

import mujoco

from reality_gap.cause import Cause, Parameter, Place, Values
from reality_gap.causes import links
from reality_gap.system import System


def _places(system: System) -> tuple[Place, ...]:
    return tuple(Place("body", (link.name,)) for link in links.links(system))


def _link(system: System, place: Place) -> links.Link:
    return links.link(system, system.model.body(place.elements[0]).id)


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    mass = _link(system, place).mass
    return (Parameter("mass", "kg", 0.1 * mass, 0.003 * mass, -0.9 * mass, 3.0 * mass),)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    link = _link(system, place)
    share = values["mass"] / link.mass
    for name in link.bodies:
        body = links.inertial(spec, system, name)
        drawn = system.model.body(name)
        body.mass += share * float(drawn.mass[0])
        body.inertia = body.inertia + share * drawn.inertia


CAUSE = Cause(
    id="link_mass",
    title="wrong mass of a link",
    explanation="A link is heavier or lighter than drawn, and its inertia in proportion.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
)
