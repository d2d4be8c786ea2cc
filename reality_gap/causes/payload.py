"""Payload: an additional mass at an end of the machine.

It is a small ball at a site of the last link that is not part of a tendon's path, such as a grip,
or else at the centre of mass of the heaviest body of the link.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import links, machine_size, typical_scales
from reality_gap.study.system import System
from reality_gap.types import Floats

RADIUS = 0.03
"""Radius of the ball over the size of the largest link; it determines the ball's inertia only."""

_WRAP = mujoco.mjtWrap


def _locations(system: System) -> tuple[Location, ...]:
    found = []
    for root in links.end_links(system):
        site = _free_site(system, root)
        if site is not None:
            body = system.model.body(int(system.model.site_bodyid[site])).name
            found.append(Location("body", (body,), f"at {system.model.site(site).name}"))
        else:
            found.append(Location("body", (links.link(system, root).heaviest,)))
    return tuple(location for location in found if location.elements[0])


def _free_site(system: System, root: int) -> int | None:
    """Return the first site of a link that is in no tendon's path, preferably not a marker."""
    model = system.model
    on_tendons = _sites_of_tendons(model)
    markers = {
        int(model.sensor(name).objid[0]) for name in system.sensed if _reads_site(model, name)
    }
    free = [
        s
        for s in range(model.nsite)
        if model.body_weldid[model.site_bodyid[s]] == root
        and s not in on_tendons
        and model.site(s).name
        and model.body(int(model.site_bodyid[s])).name
    ]
    return min(free, key=lambda s: (s in markers, s), default=None)


def _sites_of_tendons(model: mujoco.MjModel) -> set[int]:
    on = {int(i) for i in model.wrap_objid[model.wrap_type == int(_WRAP.mjWRAP_SITE)]}
    around = np.isin(model.wrap_type, [int(_WRAP.mjWRAP_SPHERE), int(_WRAP.mjWRAP_CYLINDER)])
    return on | {int(i) for i in model.wrap_prm[around]}


def _reads_site(model: mujoco.MjModel, sensor: str) -> bool:
    return int(model.sensor(sensor).objtype[0]) == int(mujoco.mjtObj.mjOBJ_SITE)


def _point(system: System, location: Location) -> Floats:
    """Return the position of the payload in the frame of its body, shape (3,) [m]."""
    if location.note:
        return system.model.site(location.note.removeprefix("at ")).pos
    return system.model.body(location.elements[0]).ipos


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    force = typical_scales.end_force(system, location.elements[0])
    size = force / machine_size.weight(system.model, 1.0)
    return (Parameter("mass", "kg", 0.03 * size, 0.0003 * size, 0.0, 6 * size),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if not values["mass"]:
        return
    holder = spec.body(location.elements[0])
    ball = holder.add_body(name=f"payload_of_{holder.name}", pos=_point(system, location))
    ball.mass, ball.ipos = values["mass"], np.zeros(3)
    radius = RADIUS * typical_scales.link_size(system)
    ball.inertia = np.full(3, 0.4 * values["mass"] * radius**2)
    ball.explicitinertial = True


CAUSE = Cause(
    id="payload",
    title="payload",
    explanation="An additional mass is attached to an end of the machine.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
