"""Skeleton of a machine: its links and joints with masses and ranges, without drives."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hidden_plants.strangers.traits import Traits
from hidden_plants.types import Floats

MASS = 11.0
"""Mass of a whole machine of 1 m reach [kg]."""
MASS_POWER = 2.9
"""Exponent of the reach in the mass, which gives about 3 g at 60 mm and 80 kg at 2 m."""


@dataclass(frozen=True)
class Link:
    """One link and the joint that carries it.

    Attributes:
        index: of the link, and of its joint.
        parent: index of the parent link; -1 for the base.
        pos: position of the joint in the parent's frame [m] (3,).
        axis: of the joint, in the frame of the link (3,).
        slides: whether the joint slides.
        length: along the x axis of the link [m].
        radius: of the link [m].
        mass: [kg].
        range: of the joint [rad or m].
        plain: whether the inertia is given by numbers, not by a geom.
    """

    index: int
    parent: int
    pos: Floats
    axis: Floats
    slides: bool
    length: float
    radius: float
    mass: float
    range: tuple[float, float]
    plain: bool

    @property
    def joint(self) -> str:
        """Name of the joint."""
        return f"j{self.index + 1}"

    @property
    def body(self) -> str:
        """Name of the body."""
        return f"link{self.index + 1}"


@dataclass(frozen=True)
class Skeleton:
    """Links of a machine, parents first, and the mass of a fixed tool [kg], 0 without one."""

    links: tuple[Link, ...]
    tool: float

    def path(self, index: int) -> tuple[int, ...]:
        """Indices of the links from the base to ``index``, which is included."""
        found = [index]
        while self.links[found[0]].parent >= 0:
            found.insert(0, self.links[found[0]].parent)
        return tuple(found)

    @property
    def ends(self) -> tuple[int, ...]:
        """Indices of the links that carry no other link."""
        parents = {link.parent for link in self.links}
        return tuple(link.index for link in self.links if link.index not in parents)


def sample_skeleton(rng: np.random.Generator, traits: Traits) -> Skeleton:
    """Sample links; their lengths and masses fall from the base to the ends."""
    count = traits.joints
    lengths = rng.uniform(0.5, 1.0, count) * 0.9 ** np.arange(count)
    lengths *= traits.reach / lengths.sum()
    masses = rng.uniform(0.6, 1.0, count) * 0.75 ** np.arange(count)
    masses *= MASS * traits.reach**MASS_POWER / masses.sum()
    fork = count // 2 + 1
    links: list[Link] = []
    for i in range(count):
        parent = 0 if traits.branches and i == fork else i - 1
        before = links[parent] if parent >= 0 else None
        aside = 0.3 * traits.reach / count if traits.branches and i == fork else 0.0
        slides = i in traits.slides
        links.append(
            Link(
                index=i,
                parent=parent,
                pos=np.array([before.length if before else 0.0, aside, 0.0]),
                axis=_axis(rng, traits, slides),
                slides=slides,
                length=float(lengths[i]),
                radius=float(lengths[i] * rng.uniform(0.08, 0.2)),
                mass=float(masses[i]),
                range=_range(rng, traits, slides),
                plain=bool(rng.random() < 0.3),
            )
        )
    return Skeleton(tuple(links), float(0.3 * masses[-1]) if traits.tool else 0.0)


def _axis(rng: np.random.Generator, traits: Traits, slides: bool) -> Floats:
    """Axis of a joint: mostly across the link; twists only without tendons."""
    if slides or (traits.kind != "tendons" and rng.random() < 0.2):
        return np.array([1.0, 0.0, 0.0])
    return np.array([0.0, 1.0, 0.0] if rng.random() < 0.7 else [0.0, 0.0, 1.0])


def _range(rng: np.random.Generator, traits: Traits, slides: bool) -> tuple[float, float]:
    if slides:
        half = float(rng.uniform(0.1, 0.25)) * traits.reach / max(traits.joints, 2)
    else:
        half = float(rng.uniform(0.5, 0.9 if traits.kind == "tendons" else 1.6))
    return (-round(half, 4), round(half, 4))


def add_links(world: Element, skeleton: Skeleton) -> dict[int, Element]:
    """Add the bodies of a skeleton to the world; returns the elements of base (-1) and links.

    Joints have names, types and axes; drives and friction are set later. A site marks the end of
    each last link.
    """
    found = {-1: world}
    for link in skeleton.links:
        body = SubElement(found[link.parent], "body", name=link.body, pos=text(link.pos))
        kind = "slide" if link.slides else "hinge"
        SubElement(body, "joint", name=link.joint, type=kind, axis=text(link.axis))
        _add_shape(body, link)
        found[link.index] = body
    for i in skeleton.ends:
        tip = text([skeleton.links[i].length, 0.0, 0.0])
        SubElement(found[i], "site", name=f"tip{i + 1}", pos=tip)
    if skeleton.tool:
        last = skeleton.links[-1]
        position = text([last.length, 0.0, 0.1 * last.length])
        tool = SubElement(found[last.index], "body", name="tool", pos=position)
        size = text([last.radius])
        SubElement(tool, "geom", name="tool", type="sphere", size=size, mass=f"{skeleton.tool:.6g}")
    return found


def _add_shape(body: Element, link: Link) -> None:
    ends = text([0.0, 0.0, 0.0, link.length, 0.0, 0.0])
    shape = {"name": f"shape{link.index + 1}", "type": "capsule", "fromto": ends}
    shape |= {"size": text([link.radius])}
    if link.plain:
        across = link.mass * link.length**2 / 10.0
        inertia = text([link.mass * link.radius**2, across, across])
        position = text([0.45 * link.length, 0.0, 0.05 * link.length])
        mass = f"{link.mass:.6g}"
        inertial = {"pos": position, "mass": mass, "diaginertia": inertia}
        SubElement(body, "inertial", inertial)
        SubElement(body, "geom", {**shape, "mass": "0"})
    else:
        SubElement(body, "geom", {**shape, "mass": f"{link.mass:.6g}"})


def text(values: Floats | list[float] | tuple[float, ...]) -> str:
    """Numbers as text of an attribute."""
    return " ".join(f"{float(value):.8g}" for value in values)
