"""Departures of the camera: mounting, focal length, lens, and times of its frames."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import mujoco
import numpy as np

from kengoro_env.departures.rotations import turn
from kengoro_env.errors import ArgumentError
from kengoro_env.robot.draft import Draft, FrameTimes

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
        turn(camera, orientation_of(camera), self.rotation * rng.standard_normal(3))


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
class LensDistortion:
    """The lens distorts the frames, as `cv2.projectPoints` defines it (ROS: plumb_bob).

    Attributes:
        k1: radial coefficient of the second power [1]; negative for a barrel.
        k2: radial coefficient of the fourth power [1].
        p1: tangential coefficient [1].
        p2: tangential coefficient [1].
        k3: radial coefficient of the sixth power [1].

    Raises:
        ArgumentError: a coefficient is not finite.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    def __post_init__(self) -> None:
        if not np.isfinite(astuple(self)).all():
            raise ArgumentError(f"{self}: coefficients must be finite")

    def edit(self, draft: Draft) -> None:
        """Write the coefficients into the sensor errors."""
        if any(astuple(self)):
            draft.sensor_errors.lens = astuple(self)


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


@dataclass(frozen=True)
class FrameTimeError:
    """The frames' time stamps are not the times of their exposure.

    Attributes:
        offset: constant error of the stamps [s]; positive: they are late.
        jitter: standard deviation of each stamp's error [s], clipped at two sigma.
        drift: how much faster than the robot's the camera's clock runs [1].
        seed: seed of the jitter.

    Raises:
        ArgumentError: the jitter is negative, the drift not above -1, or one not finite.
    """

    offset: float = 0.0
    jitter: float = 0.0
    drift: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 <= self.jitter < np.inf:
            raise ArgumentError(f"FrameTimeError: jitter is {self.jitter} s, valid is 0 or more")
        if not (np.isfinite(self.offset) and -1.0 < self.drift < np.inf):
            raise ArgumentError(
                f"FrameTimeError: offset is {self.offset} s and drift {self.drift}; valid are a "
                "finite offset and a drift above -1"
            )

    def edit(self, draft: Draft) -> None:
        """Write the errors of the stamps into the sensor errors."""
        if any((self.offset, self.jitter, self.drift)):
            draft.sensor_errors.frame_times = FrameTimes(
                self.offset, self.jitter, self.drift, (self.seed, 109)
            )
