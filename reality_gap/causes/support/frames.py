"""Markers and cameras: which sensors of frames refer to them, and moving them on their bodies."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from reality_gap.causes.base import Location, Parameter, Values
from reality_gap.study.system import System
from reality_gap.types import Floats

SHIFT, TURN = ("x", "y", "z"), ("rx", "ry", "rz")

_SENSOR = mujoco.mjtSensor
_POSITION = (int(_SENSOR.mjSENS_FRAMEPOS),)
_ORIENTATION = tuple(
    int(kind)
    for kind in (
        _SENSOR.mjSENS_FRAMEQUAT,
        _SENSOR.mjSENS_FRAMEXAXIS,
        _SENSOR.mjSENS_FRAMEYAXIS,
        _SENSOR.mjSENS_FRAMEZAXIS,
    )
)


def position_sensors(system: System) -> tuple[str, ...]:
    """Measured sensors of the position of a frame."""
    return tuple(n for n in system.sensed if int(system.model.sensor(n).type[0]) in _POSITION)


def orientation_sensors(system: System) -> tuple[str, ...]:
    """Measured sensors of the orientation of a frame."""
    return tuple(n for n in system.sensed if int(system.model.sensor(n).type[0]) in _ORIENTATION)


def seen_from(system: System, sensor: str) -> str:
    """The camera in whose frame a sensor reads; empty if it is another frame."""
    reads = system.model.sensor(sensor)
    if int(reads.reftype[0]) != int(mujoco.mjtObj.mjOBJ_CAMERA):
        return ""
    return system.model.camera(int(reads.refid[0])).name


def cameras(system: System, sensors: tuple[str, ...]) -> tuple[Location, ...]:
    """Cameras in whose frames sensors read."""
    names = dict.fromkeys(seen_from(system, sensor) for sensor in sensors)
    return tuple(Location("camera", (name,)) for name in names if name)


def motion(shift: Parameter, turn: Parameter | None) -> tuple[Parameter, ...]:
    """Six parameters like these two, or three if there is nothing to turn."""
    alike = [(shift, name) for name in SHIFT]
    if turn is not None:
        alike += [(turn, name) for name in TURN]
    return tuple(Parameter(name, p.unit, p.scale, p.tolerance, p.low, p.high) for p, name in alike)


def moved(pos: Floats, quat: Floats, values: Values) -> tuple[Floats, Floats]:
    """A pose moved by x, y, z and turned by the vector rx, ry, rz, all in its own axes.

    Args:
        pos, quat: of the pose (3,) [m] and (4,), scalar first.
        values: [m] and [rad]; no turn where there are no rx, ry, rz.
    """
    pose = Rotation.from_quat(quat, scalar_first=True)
    shift = np.array([values[name] for name in SHIFT])
    turn = Rotation.from_rotvec([values.get(name, 0.0) for name in TURN])
    return pos + pose.apply(shift), (pose * turn).as_quat(scalar_first=True)


def put(element: mujoco.MjsSite | mujoco.MjsCamera, pos: Floats, quat: Floats) -> None:
    """Put a site or camera at a pose on its body."""
    if element.frame is not None:
        element.set_frame(element.parent.add_frame())
    element.pos, element.quat = pos, quat
    element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
