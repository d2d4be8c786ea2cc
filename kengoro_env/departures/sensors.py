"""Departures of the sensors: encoders, tension sensors, camera and zero posture."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from kengoro_env.names import GROUP_JOINTS
from kengoro_env.robot.draft import Draft

EYE = "eye"
"""Name of the camera in the head."""


@dataclass(frozen=True)
class EncoderError:
    """Errors of the motors' encoders.

    Attributes:
        offset: standard deviation of each muscle's constant offset [m].
        noise: standard deviation of each reading [m].
        quantum: smallest step of a reading [m].
        seed: seed of the offsets.
    """

    offset: float = 0.0
    noise: float = 0.0
    quantum: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Write offsets, noise and quantum into the sensor errors."""
        if self.offset > 0.0:
            rng = np.random.default_rng([self.seed, 102])
            draft.sensor_errors.length_offset = {
                muscle: self.offset * float(rng.standard_normal()) for muscle in draft.tendons
            }
        if self.noise > 0.0:
            draft.sensor_errors.length_noise = self.noise
        if self.quantum > 0.0:
            draft.sensor_errors.length_quantum = self.quantum


@dataclass(frozen=True)
class TensionSensorError:
    """Errors of the tension sensors.

    Attributes:
        noise: standard deviation of each reading [N].
        offset: standard deviation of each muscle's constant offset [N].
        seed: seed of the offsets.
    """

    noise: float = 0.0
    offset: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Write noise and offsets into the sensor errors."""
        if self.noise > 0.0:
            draft.sensor_errors.tension_noise = self.noise
        if self.offset > 0.0:
            rng = np.random.default_rng([self.seed, 103])
            draft.sensor_errors.tension_offset = {
                muscle: self.offset * float(rng.standard_normal()) for muscle in draft.tendons
            }


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


@dataclass(frozen=True)
class ZeroPosture:
    """Error of the posture in which the lengths were zeroed.

    A person zeroes the lengths of a hanging arm, whose elbow is then slightly bent and whose upper
    arm is slightly off the body: the errors of elbow and shoulder roll have that sign, those of
    other joints either sign. Each angle lies between 0.5 and 1.5 times the value given.

    Attributes:
        shoulder: angle of the shoulder and elbow joints [rad].
        scapula: angle of the joints of the scapula [rad].
        forearm: angle of the radioulnar joint and the wrist [rad].
        neck: angle of the joints of the neck, which is easier to set [rad].
        seed: seed of the posture.
    """

    shoulder: float = 0.0
    scapula: float = 0.0
    forearm: float = 0.0
    neck: float = 0.0
    seed: int = 0

    def edit(self, draft: Draft) -> None:
        """Sample the posture and write it into the sensor errors."""
        angle = {group: float(getattr(self, group)) for group in GROUP_JOINTS}
        if not any(angle.values()):
            return
        rng = np.random.default_rng([self.seed, 105])
        known = {joint.name for joint in draft.spec.joints}
        for group, joints in GROUP_JOINTS.items():
            for joint in joints:
                side = {"elbow": 1, "sh_roll": -1}.get(joint, int(rng.choice([-1, 1])))
                share = side * float(rng.uniform(0.5, 1.5))
                if joint in known:
                    draft.sensor_errors.zero_posture[joint] = share * angle[group]
