"""Marker offset: a marker is displaced and rotated on its body, in its own axes.

A marker is a site, or the frame of a body, whose position or orientation is measured.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import frames, typical_scales
from reality_gap.causes.support.new_elements import add_site
from reality_gap.study.system import System

TURN = Parameter("turn", "rad", 0.03, 0.0005, -0.6, 0.6)

_OBJ = mujoco.mjtObj
_KINDS = {int(_OBJ.mjOBJ_SITE): "site", int(_OBJ.mjOBJ_XBODY): "body"}


def _locations(system: System) -> tuple[Location, ...]:
    sensors = frames.position_sensors(system) + frames.orientation_sensors(system)
    found = (_marker(system, sensor) for sensor in sensors)
    return tuple(dict.fromkeys(location for location in found if location is not None))


def _marker(system: System, sensor: str) -> Location | None:
    reads = system.model.sensor(sensor)
    kind = _KINDS.get(int(reads.objtype[0]))
    if kind is None:
        return None
    index = int(reads.objid[0])
    name = (system.model.site(index) if kind == "site" else system.model.body(index)).name
    return Location(kind, (name,)) if name else None


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    turned = any(_marker(system, s) == location for s in frames.orientation_sensors(system))
    size = typical_scales.link_size(system)
    shift = Parameter("shift", "m", 0.0085 * size, 0.0003 * size, -0.3 * size, 0.3 * size)
    return frames.pose_parameters(shift, TURN if turned else None)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    name = location.elements[0]
    if location.kind == "site":
        nominal = system.model.site(name)
        frames.set_pose(spec.site(name), *frames.moved_pose(nominal.pos, nominal.quat, values))
        return
    pos, quat = frames.moved_pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), values)
    marker = add_site(spec.body(name), name=f"marker_of_{name}", pos=pos, quat=quat)
    for sensor in spec.sensors:
        if sensor.objtype == _OBJ.mjOBJ_XBODY and sensor.objname == name:
            sensor.objtype, sensor.objname = _OBJ.mjOBJ_SITE, marker.name


CAUSE = Cause(
    id="marker_offset",
    title="displaced marker",
    explanation="A marker is displaced on its body, so that another point is measured.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
