"""Departures of the camera: mounting, focal length, and the delay of its frames."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from kengoro_env.robot.draft import Draft

EYE = "eye"
"""Name of the camera in the head."""


@dataclass(frozen=True)
class CameraError:
    """Errors of the camera's focal length and mounting.

    Attributes:
        focal: standard deviation of the focal length's relative error [1].
        position: standard deviation of the mounting along each axis [m].
        rotation: standard deviation of the mounting about each axis [rad].
        seed: seed of the errors.
    """

    focal: float = 0.0
    position: float = 0.0
    rotation: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Move the camera and change its focal length, if the scene has a camera."""
        if self.focal == 0.0 and self.position == 0.0 and self.rotation == 0.0:
            return
        if EYE not in [camera.name for camera in draft.spec.cameras]:
            return
        rng = np.random.default_rng([self.seed, 104])
        camera = draft.spec.camera(EYE)
        focal = 1.0 / np.tan(np.radians(camera.fovy) / 2)
        focal *= 1.0 + self.focal * rng.standard_normal()
        camera.fovy = float(np.degrees(2 * np.arctan(1.0 / focal)))
        camera.pos = camera.pos + self.position * rng.standard_normal(3)
        turn, turned = np.zeros(4), np.zeros(4)
        vector = self.rotation * rng.standard_normal(3)
        angle = float(np.linalg.norm(vector))
        mujoco.mju_axisAngle2Quat(turn, vector / max(angle, 1e-12), angle)
        mujoco.mju_mulQuat(turned, orientation_of(camera), turn)
        camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        camera.quat = turned


def orientation_of(camera: mujoco.MjsCamera) -> np.ndarray:
    """Quaternion of a camera in its body's frame, from either notation of the model file."""
    if camera.alt.type != mujoco.mjtOrientation.mjORIENTATION_XYAXES:
        return np.array(camera.quat)
    x, y = camera.alt.xyaxes[:3], camera.alt.xyaxes[3:]
    x = x / np.linalg.norm(x)
    y = y - x * (x @ y)
    y = y / np.linalg.norm(y)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.column_stack([x, y, np.cross(x, y)]).ravel())
    return quaternion


@dataclass(frozen=True)
class FrameDelay:
    """Delay of the camera's frames.

    Attributes:
        delay: age of a frame when the agent gets it [s].
    """

    delay: float = 0.0

    def edit(self, draft: Draft) -> None:
        """Write the delay into the sensor errors."""
        if self.delay > 0.0:
            draft.sensor_errors.frame_delay = self.delay
