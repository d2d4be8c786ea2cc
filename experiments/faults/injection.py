"""Faults that an environment is made to have, between robot and agent or on the robot itself.

An agent cannot tell `FaultyEnv` from another robot. Motors obey their own encoders: where one
sticks or jumps, the wire is pulled by what it reads.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import gymnasium as gym
import numpy as np

from jmm_agent.guard import faults
from jmm_agent.guard.faults import MotorControl
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import Detections, MarkerDetector, MarkerPose
from kengoro_env.env import KengoroEnv
from kengoro_env.robot.motors import DEFAULT_GAINS

MOTORS = MotorControl(DEFAULT_GAINS.stiffness, DEFAULT_GAINS.bias, DEFAULT_GAINS.limit)
"""What the agent is told of the motors."""

CYCLE, HIDDEN_SHARE = 2.0, 0.3
"""How often the marker is hidden [s], and for which share of that time."""

JUMP = 0.020
"""By how much an encoder jumps [m]."""

LATE_STEPS = 5
"""By how many control periods of 20 ms commands are late."""

PUSH = 40.0
"""Force on the hand [N]."""

SNAPPED = 10.0
"""Length by which a wire is too long to pull ever again [m]."""

IN_FRAMES = (faults.MARKER_HIDDEN, faults.SECOND_MARKER, faults.MIRRORED_MARKER)
"""Faults of the hand's marker, which frames only show while it is in view."""


@dataclass(frozen=True)
class Injection:
    """What is wrong from now on.

    Attributes:
        kind: a key of `jmm_agent.guard.faults.KINDS`.
        muscle: of the wire, where the fault has one.
        direction: of a push in the world (3,), of length 1.
    """

    kind: str
    muscle: str = ""
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def where(self) -> str:
        """Where the agent should find it."""
        locations = {
            faults.COMMAND_LATE: "commands",
            faults.PUSHED: "hand",
            faults.CAMERA_FROZEN: "camera",
        }
        return self.muscle or locations.get(self.kind, "marker")


class MirroringDetector:
    """Eyes that take the wrong one of a marker's two poses while the environment wants them to.

    Args:
        detector: finds the markers.
    """

    def __init__(self, detector: MarkerDetector) -> None:
        self._detector = detector
        self.mirrored = False

    def detect(
        self, frame_rgb: np.ndarray, expected: Mapping[int, np.ndarray] | None = None
    ) -> Detections:
        """See `MarkerDetector.detect`."""
        found = self._detector.detect(frame_rgb, expected)
        if not self.mirrored:
            return found
        return replace(found, poses={i: _mirrored(pose) for i, pose in found.poses.items()})


def _mirrored(pose: MarkerPose) -> MarkerPose:
    return replace(
        pose,
        pose_marker_in_camera=pose.flipped_in_camera,
        reprojection_px=pose.flipped_reprojection_px,
        flipped_in_camera=pose.pose_marker_in_camera,
        flipped_reprojection_px=pose.reprojection_px,
    )


class FaultyEnv(gym.Wrapper[dict[str, Any], Any, dict[str, Any], Any]):
    """An environment in which faults come and go.

    Args:
        env: a Kengoro environment with a camera.
        detector: finds the marker that is to be hidden or doubled.

    Attributes:
        world: the environment without wrappers.
        eyes: to be given to the agent.
    """

    def __init__(self, env: gym.Env[Any, Any], detector: MarkerDetector) -> None:
        super().__init__(env)
        assert isinstance(env.unwrapped, KengoroEnv)
        self.world = env.unwrapped
        self._detector = detector
        self.detector = MirroringDetector(detector)
        self._injection: Injection | None = None
        self._begin = 0.0
        self.shown: float | None = None
        """When what was injected last first touched anything [s]; None: it has not yet. In a frame
        without a marker there is nothing to hide, to double or to mirror."""
        self.largest_demand = 0.0
        """Largest tension that a command has demanded [N], by the lengths that the agent felt."""
        self._frozen: np.ndarray | None = None
        self._true = self._read = np.zeros(0)
        self._commands: deque[Floats] = deque()

    def inject(self, injection: Injection | None) -> None:
        """Let something be wrong from now on; None: no longer, but a snapped wire stays."""
        self._injection, self._begin = injection, self.world.robot.time
        later = injection is None or injection.kind in IN_FRAMES
        self.shown = None if later else self._begin
        self._frozen = None
        self._commands.clear()
        self.detector.mirrored = False
        force = np.zeros(3)
        if injection is not None and injection.kind == faults.PUSHED:
            force = PUSH * np.array(injection.direction)
        hand = self.world.robot.model.site("grip").bodyid[0]
        self.world.robot.data.xfrc_applied[hand, :3] = force
        if injection is not None and injection.kind == faults.MUSCLE_SNAPPED:
            self.world.robot.elongate(injection.muscle, SNAPPED)

    def reset(self, **more: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """An episode without faults."""
        observation, info = self.env.reset(**more)
        self.inject(None)
        self._true = self._read = observation["lengths"]
        return observation, info

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """One step, with what is wrong."""
        demand = MOTORS.demanded(self._read, self.world.action_to_lengths(action))
        self.largest_demand = max(self.largest_demand, float(np.nanmax(demand)))
        observation, reward, ended, cut, info = self.env.step(self._obeyed(action))
        return self._felt(observation), float(reward), ended, cut, info

    def _obeyed(self, action: Any) -> Any:
        """The action that the robot obeys."""
        injection = self._injection
        if injection is None:
            return action
        if injection.kind == faults.COMMAND_LATE:
            self._commands.append(action)
            return (
                self._commands.popleft() if len(self._commands) > LATE_STEPS else self._commands[0]
            )
        if injection.kind in (faults.ENCODER_STUCK, faults.ENCODER_JUMP):
            lengths = self.world.action_to_lengths(action) + self._true - self._read
            return self.world.lengths_to_action(lengths)
        return action

    def _felt(self, observation: dict[str, Any]) -> dict[str, Any]:
        """The observation that the agent gets."""
        injection, last = self._injection, self._read
        self._true = self._read = observation["lengths"]
        if injection is None:
            return observation
        shows = injection.kind not in IN_FRAMES
        if injection.muscle:
            self._spoil_muscle(observation, injection, last)
        elif "frame" in observation:
            shows = self._spoil_frame(observation, injection)
        if shows and self.shown is None:
            self.shown = self.world.robot.time
        return observation

    def _spoil_muscle(
        self, observation: dict[str, Any], injection: Injection, last: Floats
    ) -> None:
        muscle = self.world.muscles.index(injection.muscle)
        self._read = self._true.copy()
        if injection.kind == faults.ENCODER_STUCK:
            self._read[muscle] = last[muscle]
        elif injection.kind == faults.ENCODER_JUMP:
            self._read[muscle] += JUMP
        elif injection.kind == faults.ENCODER_DEAD:
            self._read[muscle] = np.nan
        elif injection.kind == faults.TENSION_SENSOR_DEAD:
            observation["tensions"][muscle] = 0.0
        observation["lengths"] = self._read

    def _spoil_frame(self, observation: dict[str, Any], injection: Injection) -> bool:
        """Change the frame, in place; whether what is wrong shows in it."""
        frame = observation["frame"]
        if injection.kind == faults.CAMERA_FROZEN:
            self._frozen = frame if self._frozen is None else self._frozen
            observation["frame"] = self._frozen.copy()
        if injection.kind not in IN_FRAMES:
            return True
        marker = self._detector.detect(frame).poses.get(0)
        if marker is None:
            return False
        if injection.kind == faults.MARKER_HIDDEN:
            since = float(observation["frame_time"][0]) - self._begin
            hidden = since % CYCLE < HIDDEN_SHARE * CYCLE
            if hidden:
                _paint_over(frame, marker)
            return hidden
        if injection.kind == faults.SECOND_MARKER:
            _paint_copy(frame, marker)
        else:
            self.detector.mirrored = True
        return True


def _paint_over(frame: np.ndarray, marker: MarkerPose) -> None:
    """Paint over a marker, in place."""
    low, high = _box(marker)
    cv2.rectangle(frame, low.tolist(), high.tolist(), (90, 80, 70), -1)


def _paint_copy(frame: np.ndarray, marker: MarkerPose) -> None:
    """Paint a copy of a marker into a corner of its frame, in place."""
    low, high = _box(marker)
    patch = frame[low[1] : high[1], low[0] : high[0]]
    height, width = patch.shape[:2]
    corner = 20 if low[0] > frame.shape[1] // 2 else frame.shape[1] - width - 20
    frame[20 : 20 + height, corner : corner + width] = patch.copy()


def _box(marker: MarkerPose) -> tuple[np.ndarray, np.ndarray]:
    """Upper left and lower right (x, y) of a marker with its white margin [px]."""
    margin = 0.25 * float(np.ptp(marker.corners_px, axis=0).max())
    low = np.maximum(np.floor(marker.corners_px.min(axis=0) - margin).astype(int), 0)
    return low, np.ceil(marker.corners_px.max(axis=0) + margin).astype(int)
