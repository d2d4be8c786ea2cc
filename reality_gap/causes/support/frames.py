"""Frames: sensors of markers and cameras, and small changes of the poses of these elements."""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from reality_gap.causes.base import Location, Parameter, Values
from reality_gap.study.system import System
from reality_gap.types import Floats

SHIFT, TURN = ("x", "y", "z"), ("rx", "ry", "rz")
"""Names of the parameters of a translation and of a rotation vector."""

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
    """Return the measured sensors of the position of a frame."""
    return tuple(n for n in system.sensed if int(system.model.sensor(n).type[0]) in _POSITION)


def orientation_sensors(system: System) -> tuple[str, ...]:
    """Return the measured sensors of the orientation of a frame."""
    return tuple(n for n in system.sensed if int(system.model.sensor(n).type[0]) in _ORIENTATION)


def camera_of(system: System, sensor: str) -> str:
    """Return the camera in whose frame a sensor measures; empty if it is another frame."""
    measures = system.model.sensor(sensor)
    if int(measures.reftype[0]) != int(mujoco.mjtObj.mjOBJ_CAMERA):
        return ""
    return system.model.camera(int(measures.refid[0])).name


def camera_locations(system: System, sensors: tuple[str, ...]) -> tuple[Location, ...]:
    """Return a location for each camera in whose frame one of the sensors measures."""
    names = dict.fromkeys(camera_of(system, sensor) for sensor in sensors)
    return tuple(Location("camera", (name,)) for name in names if name)


def distance(system: System, camera: str) -> float:
    """Return the mean distance of the frames that a camera measures, at ``qpos0`` [m]."""
    model = system.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    eye, far = data.cam_xpos[model.camera(camera).id], list[float]()
    origins = {
        int(mujoco.mjtObj.mjOBJ_SITE): data.site_xpos,
        int(mujoco.mjtObj.mjOBJ_XBODY): data.xpos,
        int(mujoco.mjtObj.mjOBJ_BODY): data.xipos,
        int(mujoco.mjtObj.mjOBJ_GEOM): data.geom_xpos,
    }
    for name in position_sensors(system) + orientation_sensors(system):
        measures = model.sensor(name)
        if camera_of(system, name) == camera and int(measures.objtype[0]) in origins:
            at = origins[int(measures.objtype[0])][int(measures.objid[0])]
            far.append(float(np.linalg.norm(at - eye)))
    return float(np.mean(far)) if far else 1.0


def pose_parameters(shift: Parameter, turn: Parameter | None) -> tuple[Parameter, ...]:
    """Return the parameters x, y, z like ``shift``, and rx, ry, rz like ``turn`` if it is given."""
    alike = [(shift, name) for name in SHIFT]
    if turn is not None:
        alike += [(turn, name) for name in TURN]
    return tuple(Parameter(name, p.unit, p.scale, p.tolerance, p.low, p.high) for p, name in alike)


def moved_pose(pos: Floats, quat: Floats, values: Values) -> tuple[Floats, Floats]:
    """Move a pose by x, y, z and turn it by the rotation vector rx, ry, rz, in its own axes.

    Args:
        pos: position, shape (3,) [m].
        quat: orientation, shape (4,), scalar first.
        values: x, y, z [m] and rx, ry, rz [rad]; without rx, ry, rz there is no rotation.

    Returns:
        Position and orientation of the moved pose.
    """
    pose = Rotation.from_quat(quat, scalar_first=True)
    shift = np.array([values[name] for name in SHIFT])
    turn = Rotation.from_rotvec([values.get(name, 0.0) for name in TURN])
    return pos + pose.apply(shift), (pose * turn).as_quat(scalar_first=True)


def set_pose(element: mujoco.MjsSite | mujoco.MjsCamera, pos: Floats, quat: Floats) -> None:
    """Set the pose of a site or camera in the frame of its body."""
    if element.frame is not None:
        element.set_frame(element.parent.add_frame())
    element.pos, element.quat = pos, quat
    element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
