"""A hand that is seen without a marker, as a detector would see it, without a picture.

Frames hold only their number. The detector, which is given nothing else, returns the true pose of
the hand at that number with errors of a given size; some are far off, and some frames are missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import radians, tan
from typing import Any

import gymnasium as gym
import numpy as np
from scipy.spatial.transform import Rotation

from jmm_agent.types import Floats
from jmm_agent.vision.hand_detection import HandDetection, HandSkip
from kengoro.robots import CAMERA, make_env
from kengoro_env.vision.head_camera import PERIOD

NOMINAL_FOCAL = 1.0 / tan(radians(22.5))


def frame_of(number: int) -> np.ndarray:
    """A frame (1, 4, 3) that holds a number."""
    frame = np.zeros((1, 4, 3), dtype=np.uint8)
    frame[0, :, 0] = [(number + 1) >> shift & 255 for shift in (0, 8, 16, 24)]
    return frame


def number_of(frame: np.ndarray) -> int:
    """The number in a frame."""
    return int.from_bytes(frame[0, :, 0].tobytes(), "little") - 1


class NumberedFrames(gym.Wrapper[dict[str, Any], Any, dict[str, Any], Any]):
    """An environment whose frames hold their number, as often and as late as the robot's camera.

    Args:
        task: of `make_env`.
        seed: of the actual robot.
        delay: age of a frame when it arrives [s].

    Attributes:
        poses: of the hand in the camera at each number (4, 4), as the camera shows it to one who
            has the nominal focal length.
    """

    def __init__(self, task: str, seed: int, delay: float = 0.1) -> None:
        super().__init__(
            make_env(task, seed, hand="seen", camera=False, max_episode_steps=10_000_000)
        )
        self.poses: list[Floats] = []
        self._delay = delay
        self._times: list[float] = []

    def reset(self, **options: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        observation, truth = super().reset(**options)
        self._first, self._begin = len(self.poses), float(self._robot.data.time)
        self._times = [0.0]
        self.poses.append(self._pose())
        return self._with_frame(observation), truth

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        observation, *rest = super().step(action)
        if self._now + 1e-9 >= len(self._times) * PERIOD:
            self._times.append(self._now)
            self.poses.append(self._pose())
        return self._with_frame(observation), *rest  # type: ignore[return-value]

    @property
    def _robot(self) -> Any:
        return self.unwrapped.robot  # type: ignore[attr-defined]

    @property
    def _now(self) -> float:
        return float(self._robot.data.time) - self._begin

    def _with_frame(self, observation: dict[str, Any]) -> dict[str, Any]:
        arrived = sum(time + self._delay <= self._now + 1e-9 for time in self._times) - 1
        newest = max(arrived, 0)
        observation["frame"] = frame_of(self._first + newest)
        observation["frame_time"] = np.array([self._times[newest]])
        return observation

    def _pose(self) -> Floats:
        data, model = self._robot.data, self._robot.model
        eye, hand = data.camera("eye"), data.body("hand")
        turn = eye.xmat.reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])  # from MuJoCo's to OpenCV's
        pose = np.eye(4)
        pose[:3, :3] = turn.T @ hand.xmat.reshape(3, 3)
        pose[:3, 3] = turn.T @ (hand.xpos - eye.xpos)
        longer = 1.0 / tan(radians(float(model.camera("eye").fovy[0]) / 2.0)) / NOMINAL_FOCAL
        pose[2, 3] /= longer
        return pose


@dataclass
class NoisyHand:
    """Detector with errors, see `HandDetector`.

    Attributes:
        poses: true pose of the hand in the camera at each number (4, 4).
        position: standard deviation across the line of sight [m].
        rotation: standard deviation about each axis [rad].
        depth: how much larger the error along the line of sight is [1].
        claimed: standard deviations that it claims over its true ones [1].
        outliers: share of poses that are `OUTLIER` off [1].
        missed: share of frames without a pose [1].
        seed: of the errors.
        fixed: pose that it returns in place of the true one, as a picture of a hand has; None.
    """

    poses: Sequence[Floats]
    position: float = 0.002
    rotation: float = radians(1.0)
    depth: float = 3.0
    claimed: float = 1.0
    outliers: float = 0.0
    missed: float = 0.0
    seed: int = 0
    frame: str = "hand"
    fixed: Floats | None = None
    off: set[int] = field(default_factory=set)

    OUTLIER = 0.1

    def __deepcopy__(self, memo: dict[int, object]) -> NoisyHand:
        return self

    def detect(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> HandDetection | HandSkip:
        number = number_of(frame_rgb)
        rng = np.random.default_rng([self.seed, number])
        pose = np.array(self.poses[number] if self.fixed is None else self.fixed)
        if not self.shows(pose):
            return HandSkip.NOT_SEEN
        if rng.random() < self.missed:
            return HandSkip.UNCLEAR
        across = pose[:3, 3] / np.linalg.norm(pose[:3, 3])
        along = np.outer(across, across)
        root = np.zeros((6, 6))
        root[:3, :3] = self.position * (np.eye(3) + (self.depth - 1.0) * along)
        root[3:, 3:] = self.rotation * np.eye(3)
        error = root @ rng.standard_normal(6)
        if rng.random() < self.outliers:
            away = rng.standard_normal(3)
            error[:3] += self.OUTLIER * away / np.linalg.norm(away)
            self.off.add(number)
        pose[:3, 3] += error[:3]
        pose[:3, :3] = Rotation.from_rotvec(error[3:]).as_matrix() @ pose[:3, :3]
        return HandDetection(pose, self.claimed**2 * root @ root)

    def shows(self, pose: np.ndarray) -> bool:
        pixel = CAMERA.project(pose[:3, 3])
        return bool(np.all((pixel > 40.0) & (pixel < [CAMERA.width - 40, CAMERA.height - 40])))
