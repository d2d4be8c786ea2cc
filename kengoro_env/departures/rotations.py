"""Rotations by which departures turn axes, and elements of a model."""

from __future__ import annotations

import mujoco
import numpy as np

from kengoro_env.types import Floats


def quaternion_of(vector: Floats) -> Floats:
    """Unit quaternion (4,) of a rotation vector (3,) [rad]."""
    angle, quaternion = float(np.linalg.norm(vector)), np.zeros(4)
    mujoco.mju_axisAngle2Quat(quaternion, vector / max(angle, 1e-12), angle)
    return quaternion


def turned(axis: Floats, vector: Floats) -> Floats:
    """An axis (3,), turned by a rotation vector (3,) [rad]."""
    result = np.zeros(3)
    mujoco.mju_rotVecQuat(result, axis, quaternion_of(vector))
    return result


def turn(element: mujoco.MjsBody | mujoco.MjsCamera, orientation: Floats, vector: Floats) -> None:
    """Turn a body or camera about its own axes.

    Args:
        element: is changed.
        orientation: unit quaternion (4,) that it has before.
        vector: rotation vector (3,) [rad].
    """
    quaternion = np.zeros(4)
    mujoco.mju_mulQuat(quaternion, orientation, quaternion_of(vector))
    element.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    element.quat = quaternion
