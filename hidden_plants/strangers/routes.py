"""Tendons of a machine: a pair of antagonists for each joint, straight or around a pulley."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hidden_plants.strangers.skeleton import Link, Skeleton, text
from hidden_plants.strangers.traits import Traits
from hidden_plants.types import Floats

PULLEY = 0.7
"""Radius of a pulley over the distance of the tendon's sites from the joint."""


@dataclass(frozen=True)
class Route:
    """Path of one tendon.

    Attributes:
        name: of the tendon.
        joint: index of the joint that it drives.
        path: names of its sites in order; a pulley is preceded by "pulley/" and the name of its
            geom, and followed by the name of its side site.
    """

    name: str
    joint: int
    path: tuple[str, ...]


def add_routes(
    rng: np.random.Generator, traits: Traits, skeleton: Skeleton, bodies: dict[int, Element]
) -> tuple[Route, ...]:
    """Add the sites and pulleys of all tendons to the bodies; returns the tendons."""
    routes: list[Route] = []
    for link in skeleton.links:
        for side, name in ((1.0, "a"), (-1.0, "b")):
            routes.append(_route(rng, traits, skeleton, bodies, link, side, name))
    return tuple(routes)


def _route(
    rng: np.random.Generator,
    traits: Traits,
    skeleton: Skeleton,
    bodies: dict[int, Element],
    link: Link,
    side: float,
    suffix: str,
) -> Route:
    name = f"t{link.index + 1}{suffix}"
    crossed = skeleton.path(link.index) if traits.remote else (link.index,)
    path: list[str] = []
    for index in crossed:
        here = skeleton.links[index]
        own = index == link.index
        arm = (1.0 if own else 0.5) * rng.uniform(0.8, 1.2) * 0.2 * here.length
        across = side * arm * np.cross(here.axis, [1.0, 0.0, 0.0])
        along = np.array([1.5 * arm, 0.0, 0.0])
        jitter = 0.05 * arm * rng.uniform(-1.0, 1.0, (2, 3))
        if not path or own:
            path.append(
                _site(
                    bodies,
                    skeleton,
                    here.parent,
                    f"{name}_{index + 1}in",
                    here.pos - along + across + jitter[0],
                )
            )
        if own and traits.wrapping:
            path += _pulley(bodies, here, name, across, arm)
        path.append(
            _site(bodies, skeleton, index, f"{name}_{index + 1}out", along + across + jitter[1])
        )
    return Route(name, link.index, tuple(path))


def _site(
    bodies: dict[int, Element], skeleton: Skeleton, link: int, name: str, position: Floats
) -> str:
    size = text([0.02 * skeleton.links[0].length])
    SubElement(bodies[link], "site", name=name, pos=text(position), size=size)
    return name


def _pulley(
    bodies: dict[int, Element], link: Link, route: str, across: Floats, arm: float
) -> list[str]:
    """Add a pulley at a link's joint, on the side of the tendon; returns its part of the path."""
    radius = PULLEY * arm
    ends = text(np.concatenate([-0.5 * arm * link.axis, 0.5 * arm * link.axis]))
    shape = {"name": f"pulley_{route}", "type": "cylinder", "fromto": ends, "mass": "0"}
    SubElement(bodies[link.index], "geom", {**shape, "size": text([radius])})
    side = f"{route}_side"
    SubElement(bodies[link.index], "site", name=side, pos=text(1.2 * across), size="0.001")
    return [f"pulley/pulley_{route}", side]


def write_routes(root: Element, routes: tuple[Route, ...]) -> None:
    """Add the tendons to the model's root."""
    if not routes:
        return
    section = SubElement(root, "tendon")
    for route in routes:
        tendon = SubElement(section, "spatial", name=route.name)
        steps = iter(route.path)
        for step in steps:
            if step.startswith("pulley/"):
                geom = step.removeprefix("pulley/")
                SubElement(tendon, "geom", geom=geom, sidesite=next(steps))
            else:
                SubElement(tendon, "site", site=step)
