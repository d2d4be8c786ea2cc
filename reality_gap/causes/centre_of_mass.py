"""A link whose centre of mass is not where the drawing has it.

The shift is of the whole link's centre, in the frame of its heaviest body, whose mass is moved.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Parameter, Place, Values
from reality_gap.causes.support import links
from reality_gap.study.system import System

AXES = ("x", "y", "z")


def _places(system: System) -> tuple[Place, ...]:
    return tuple(Place("body", (link.name,)) for link in links.links(system))


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    return tuple(Parameter(axis, "m", 0.01, 0.0001, -0.1, 0.1) for axis in AXES)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    link = links.link(system, system.model.body(place.elements[0]).id)
    body = links.inertial(spec, system, link.heaviest)
    part = float(system.model.body(link.heaviest).mass[0])
    shift = np.array([values[axis] for axis in AXES])
    body.ipos = body.ipos + shift * (link.mass / part)


CAUSE = Cause(
    id="centre_of_mass",
    title="wrong centre of mass",
    explanation="A link's weight acts elsewhere on it than drawn.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
)
