"""Injection of faults into an environment, between robot and agent or on the robot itself.

`FaultyEnv` has the interface of any other robot. Motors are controlled with their own encoders: if
an encoder sticks or jumps, the muscle is pulled according to its reading.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np

from experiments.faults.frames import IN_FRAMES, OF_HAND, FrameFault
from jmm_agent.guard import faults
from jmm_agent.guard.faults import MotorControl
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import Detections, MarkerDetector, MarkerPose
from kengoro_env.env import KengoroEnv
from kengoro_env.robot.muscle_law import DEFAULT_GAINS

MOTORS = MotorControl(DEFAULT_GAINS.stiffness, DEFAULT_GAINS.bias, DEFAULT_GAINS.limit)
"""Properties of the motors that the agent knows."""

JUMP = 0.020
"""Jump of an encoder [m]."""

LATE_STEPS = 5
"""Delay of late commands, in control periods of 20 ms."""

PUSH = 40.0
"""Force on the hand [N]."""

SNAPPED = 10.0
"""Elongation of a snapped muscle, which cannot pull again [m]."""


@dataclass(frozen=True)
class Injection:
    """A fault to inject.

    Attributes:
        kind: a key of `jmm_agent.guard.faults.KINDS`.
        muscle: name of the muscle; empty for other faults.
        direction: of an external force in the world, unit vector of shape (3,).
    """

    kind: str
    muscle: str = ""
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def where(self) -> str:
        """Location that the agent should name."""
        locations = {
            faults.COMMAND_LATE: "commands",
            faults.PUSHED: "hand",
            faults.CAMERA_FROZEN: "camera",
            **dict.fromkeys(OF_HAND, "hand"),
        }
        return self.muscle or locations.get(self.kind, "marker")


class MirroringDetector:
    """Detector that can return the wrong one of the two poses of a marker.

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
    """An environment with faults that can be injected and removed.

    Args:
        env: a Kengoro environment with a camera.
        detector: finds the marker that is hidden or doubled; None: the hand carries none.

    Attributes:
        world: the environment without wrappers.
        detector: marker detector for the agent; None: the hand carries none.
    """

    def __init__(self, env: gym.Env[Any, Any], detector: MarkerDetector | None) -> None:
        super().__init__(env)
        assert isinstance(env.unwrapped, KengoroEnv)
        self.world = env.unwrapped
        self._detector = detector
        self.detector = None if detector is None else MirroringDetector(detector)
        self._injection: Injection | None = None
        self._begin = 0.0
        self.shown: float | None = None
        """Time at which the latest fault had its first effect [s]; None before it. Faults of a
        marker or a hand have no effect on a frame without it."""
        self.largest_demand = 0.0
        """Largest tension demanded by a command at the lengths that the agent measured [N]."""
        self._frame_fault: FrameFault | None = None
        self._true = self._read = np.zeros(0)
        self._commands: deque[Floats] = deque()

    def inject(self, injection: Injection | None) -> None:
        """Inject a fault, or remove it with None; a snapped muscle remains."""
        self._injection, self._begin = injection, self.world.robot.time
        later = injection is None or injection.kind in IN_FRAMES
        self.shown = None if later else self._begin
        self._frame_fault = None
        if injection is not None and injection.kind in (*IN_FRAMES, faults.CAMERA_FROZEN):
            self._frame_fault = FrameFault(injection.kind, self._begin, self._detector)
        self._commands.clear()
        if self.detector is not None:
            self.detector.mirrored = False
        force = np.zeros(3)
        if injection is not None and injection.kind == faults.PUSHED:
            force = PUSH * np.array(injection.direction)
        hand = self.world.robot.model.site("grip").bodyid[0]
        self.world.robot.data.xfrc_applied[hand, :3] = force
        if injection is not None and injection.kind == faults.MUSCLE_SNAPPED:
            self.world.robot.elongate(injection.muscle, SNAPPED)

    def reset(self, **more: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        """Start an episode without faults."""
        observation, info = self.env.reset(**more)
        self.inject(None)
        self._true = self._read = observation["lengths"]
        return observation, info

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Step the environment with the fault."""
        demand = MOTORS.demanded(self._read, self.world.action_to_lengths(action))
        self.largest_demand = max(self.largest_demand, float(np.nanmax(demand)))
        observation, reward, ended, cut, info = self.env.step(self._executed(action))
        return self._disturbed(observation), float(reward), ended, cut, info

    def _executed(self, action: Any) -> Any:
        """Action that the robot executes."""
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

    def _disturbed(self, observation: dict[str, Any]) -> dict[str, Any]:
        """Observation that the agent receives."""
        injection, last = self._injection, self._read
        self._true = self._read = observation["lengths"]
        if injection is None:
            return observation
        shows = injection.kind not in IN_FRAMES
        if injection.muscle:
            self._disturb_muscle(observation, injection, last)
        elif "frame" in observation and self._frame_fault is not None:
            time = float(observation["frame_time"][0])
            shows = self._frame_fault.disturb(observation["frame"], time, self.world.robot)
            if self.detector is not None:
                self.detector.mirrored = shows and injection.kind == faults.MIRRORED_MARKER
        if shows and self.shown is None:
            self.shown = self.world.robot.time
        return observation

    def _disturb_muscle(
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
