"""Payload: an additional mass at an end of the machine.

It is a ball at a site of the last link that is not part of a tendon's path, such as a grip, or at a
body without mass, such as a flange, or elsewhere: on the line from the centre of mass of the
heaviest body of the link to the far end of the link, if these are apart. There ``along`` is 0 at
the one and 1 at the other, and negative on the other side of the centre of mass. The far end of a
link without geoms is half the length of a long link beyond its centre of mass, seen from its joint.
Its own moment of inertia is that of a ball of steel, for hardly any load is smaller, plus its mass
times ``gyration``, a squared radius of gyration.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import links, machine_size, surfaces, typical_scales
from reality_gap.study.system import System
from reality_gap.types import Floats

DENSITY = 7800.0
"""Density of the smallest ball, that of steel [kg/m^3]."""
WIDE, WIDEST = 0.15, 0.5
"""Radius of gyration of a wide load, and the largest, over the length of the machine's links."""

BEFORE, BEYOND = 1.5, 3.0
"""Largest position of a payload on its line, to either side: tools are longer than links."""
APART = 0.2
"""Least distance of the far end from the centre of mass, over that from the begin of the link."""
NEAR = 0.05
"""Distance of a centre of mass from its joint that is no direction, over half the length of a long
link."""
ORIGIN = "at its origin"
"""Note of a location at a body without mass."""
_WRAP = mujoco.mjtWrap


def _locations(system: System) -> tuple[Location, ...]:
    found = []
    for root in links.end_links(system):
        site, heaviest = _free_site(system, root), links.link(system, root).heaviest
        flange = _flange(system, root)
        if site is not None:
            body = system.model.body(int(system.model.site_bodyid[site])).name
            found.append(Location("body", (body,), f"at {system.model.site(site).name}"))
        elif flange:
            found.append(Location("body", (flange,), ORIGIN))
        elsewhere = Location("body", (heaviest,))
        if heaviest and (not found or _far_end(system, elsewhere) is not None):
            found.append(elsewhere)
    return tuple(found)


def _flange(system: System, root: int) -> str:
    """Return the last body of a link without mass and geoms; empty if there is none."""
    model = system.model
    frames = [
        model.body(b).name
        for b in range(root + 1, model.nbody)
        if model.body_weldid[b] == root and not model.body_mass[b] and not model.body_geomnum[b]
    ]
    return next((name for name in reversed(frames) if name), "")


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


def _point(system: System, location: Location, values: Values) -> Floats:
    """Return the position of the payload in the frame of its body, shape (3,) [m]."""
    if location.note == ORIGIN:
        return np.zeros(3)
    if location.note:
        return system.model.site(location.note.removeprefix("at ")).pos
    centre, end = system.model.body(location.elements[0]).ipos, _far_end(system, location)
    return centre if end is None else centre + values["along"] * (end - centre)


def _far_end(system: System, location: Location) -> Floats | None:
    """Return the far end of the link of a body in the body's frame, shape (3,) [m].

    None if the centre of mass of the body is near it.
    """
    model, data = system.model, mujoco.MjData(system.model)
    mujoco.mj_kinematics(model, data)
    index = model.body(location.elements[0]).id
    begin, turned = data.xpos[model.body_weldid[index]], data.xmat[index].reshape(3, 3)
    end = surfaces.far_point(model, data, int(model.body_weldid[index]), begin)
    if end is None:
        centre = data.xipos[index] - begin
        far = float(np.linalg.norm(centre))
        beyond = 0.5 * machine_size.machine_size(system).link
        return (1.0 + beyond / far) * turned.T @ centre if far > NEAR * beyond else None
    local = turned.T @ (end - data.xpos[index])
    far = float(np.linalg.norm(local - model.body_ipos[index]))
    return local if far > APART * float(np.linalg.norm(end - begin)) else None


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    body = location.elements[0]
    if location.note == ORIGIN:
        body = links.link(system, int(system.model.body(body).weldid[0])).heaviest or body
    force = typical_scales.end_force(system, body)
    size = force / machine_size.weight(system.model, 1.0)
    own = links.link(system, system.model.body(body).id).mass
    scale, most = max(0.03 * size, 0.1 * own), max(6.0 * size, 3.0 * own)
    mass = Parameter("mass", "kg", scale, 0.0003 * size, 0.0, most)
    link = machine_size.machine_size(system).link
    sizes = ((WIDE * link) ** 2, 0.0, 0.0, (WIDEST * link) ** 2)
    gyration = Parameter("gyration", "m^2", *sizes, hints=SearchHints(shape=True, bounded=True))
    if location.note or _far_end(system, location) is None:
        return mass, gyration
    hints = SearchHints(shape=True, screened=(0.0,), bounded=True)
    along = Parameter("along", "1", 0.2, 0.0, -BEFORE, BEYOND, null=1.0, hints=hints)
    return mass, along, gyration


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if not values["mass"]:
        return
    holder = spec.body(location.elements[0])
    name = f"payload_{location.note.replace(' ', '_') or f'of_{holder.name}'}"
    while spec.body(name) is not None:  # the model may be one that was extended before
        name += "_more"
    ball = holder.add_body(name=name, pos=_point(system, location, values))
    ball.mass, ball.ipos = values["mass"], np.zeros(3)
    radius = (values["mass"] / (4.0 / 3.0 * np.pi * DENSITY)) ** (1.0 / 3.0)
    ball.inertia = np.full(3, values["mass"] * (0.4 * radius**2 + values["gyration"]))
    ball.explicitinertial = True


CAUSE = Cause(
    id="payload",
    title="payload",
    explanation="An additional mass is attached to an end of the machine.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
