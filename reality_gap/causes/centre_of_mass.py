"""Centre of mass: the centre of mass of a link is displaced.

The parameters are the shift of the whole link's centre of mass, in the frame of its heaviest body.
Only the mass of that body is moved.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import links, typical_scales
from reality_gap.study.system import System

AXES = ("x", "y", "z")


def _locations(system: System) -> tuple[Location, ...]:
    return tuple(Location("body", (link.name,)) for link in links.links(system))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    size = typical_scales.link_size(system)
    sizes = (0.03 * size, 0.002 * size, -0.3 * size, 0.3 * size)
    return tuple(Parameter(axis, "m", *sizes) for axis in AXES)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    link = links.link(system, system.model.body(location.elements[0]).id)
    body = links.editable_body(spec, system, link.heaviest)
    part = float(system.model.body(link.heaviest).mass[0])
    shift = np.array([values[axis] for axis in AXES])
    body.ipos = body.ipos + shift * (link.mass / part)


CAUSE = Cause(
    id="centre_of_mass",
    title="wrong centre of mass",
    explanation="The centre of mass of a link is displaced.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
