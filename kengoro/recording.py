"""What an agent writes down while it moves a robot: commands, lengths, tensions, looks at its hand.

Nothing else is known to it: no true joint angles, and nothing of how the robot was made.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro.arm import CAMERA, HAND, NO_END, SIDES, make_env
from kengoro.errors import UsageError
from kengoro.nominal_model import MARKER
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures.sensors import EYE
from kengoro_env.env import CONTROL_PERIOD, KengoroEnv
from kengoro_env.names import JOINTS
from kengoro_env.robot.nominal_model import NominalArm

SETTLE = 2.0
"""The first command is held so long before the log begins [s]."""


@dataclass(frozen=True)
class Arm:
    """A part of the robot that is recorded: its task in `kengoro_env`, and the scene of it."""

    task: str
    scene: Path


def whole_arm() -> Arm:
    """Head and arm, 36 wires, with a camera."""
    return Arm("Posture", asset_path("mjcf/kengoro_arm/posture.xml"))


def elbow() -> Arm:
    """The elbow with its three wires, without a camera."""
    return Arm("Elbow", asset_path("mjcf/kengoro_arm/elbow.xml"))


@dataclass(frozen=True)
class Tour:
    """Postures that are visited one after the other.

    Attributes:
        postures: (K, n) [rad]; the tour begins at the first.
        move: duration of each movement [s].
        hold: how long the arm stays at each [s].
    """

    postures: Floats
    move: float
    hold: float

    @property
    def duration(self) -> float:
        """Until the stay at the last posture is over [s]."""
        return self.hold + (len(self.postures) - 1) * (self.move + self.hold)

    def at(self, time: float) -> Floats:
        """Posture (n,) [rad] to be at: at rest at both ends of each movement."""
        leg, since = divmod(max(time, 0.0) - self.hold, self.move + self.hold)
        first = min(max(int(leg), -1), len(self.postures) - 1)
        if first < 0 or first == len(self.postures) - 1:
            return self.postures[max(first, 0)]
        share = min(1.0, since / self.move)
        share *= share * (3.0 - 2.0 * share)
        return self.postures[first] + share * (self.postures[first + 1] - self.postures[first])


@dataclass(frozen=True)
class Recording:
    """One episode; all lengths are as the robot's encoders call them, 0 where they were zeroed.

    Attributes:
        time: (k,) [s] from the begin of the log, one control period apart.
        command: (k, m) target lengths [m] from each time on.
        lengths: (k, m) [m] measured at each time.
        tensions: (k, m) [N] measured at each time.
        start: joint angles (n,) [rad] at which the agent believes to begin.
        look_time: (c,) [s] when each frame was taken in which the hand's marker was found.
        markers: (c, 4, 4) pose of the marker in the camera: x right, y down, z forward.
    """

    time: Floats
    command: Floats
    lengths: Floats
    tensions: Floats
    start: Floats
    observation_time: Floats = field(default_factory=lambda: np.zeros(0))
    markers: Floats = field(default_factory=lambda: np.zeros((0, 4, 4)))


def record(arm: Arm, robot: int | None, tour: Tour, seed: int = 0) -> Recording:
    """Move a robot by commands from the drawing, and note what it feels and sees.

    Args:
        arm: what is moved.
        robot: seed of an actual robot; None for the drawing.
        tour: where it is sent.
        seed: of its sensors' noise.
    """
    env = make_env(arm.task, robot, max_episode_steps=NO_END)
    world = env.unwrapped
    if not isinstance(world, KengoroEnv):
        raise UsageError(f"A recording needs a Kengoro environment, not {world}.")
    start = tour.at(0.0)
    drawing, eye = NominalArm(arm.scene), _Eye(tour)
    observation, _ = env.reset(seed=seed, options={"posture": start, "target": start})
    settling = round(SETTLE / CONTROL_PERIOD)
    time: list[float] = []
    command: list[Floats] = []
    lengths: list[Floats] = []
    tensions: list[Floats] = []
    for step in range(-settling, round(tour.duration / CONTROL_PERIOD)):
        now = step * CONTROL_PERIOD
        action = world.lengths_to_action(drawing.lengths(tour.at(now))[0])
        if step >= 0:
            time.append(round(now, 6))
            command.append(world.action_to_lengths(action))
            lengths.append(observation["lengths"])
            tensions.append(observation["tensions"])
            if "frame" in observation:
                eye.look(observation["frame"], float(observation["frame_time"][0]) - SETTLE)
        observation, _, ended, _, info = env.step(action)
        if ended:
            raise UsageError(f"The recording ended at {now:.2f} s: {info.get('reason')}.")
    env.close()
    return Recording(
        time=np.array(time),
        command=np.array(command),
        lengths=np.array(lengths),
        tensions=np.array(tensions),
        start=start,
        observation_time=np.array(eye.times),
        markers=np.array(eye.markers).reshape(-1, 4, 4),
    )


class _Eye:
    """Finds the hand's marker in frames.

    The corners of a marker that is small or faces the camera fit two poses; the one nearer to
    that of the commanded posture is taken.
    """

    def __init__(self, tour: Tour) -> None:
        self._tour = tour
        self._kinematics = ArmKinematics(asset_path(ARM), JOINTS)
        self._detector = MarkerDetector(CAMERA, SIDES)
        self._newest = -np.inf
        self.times: list[float] = []
        self.markers: list[Floats] = []

    def look(self, frame: np.ndarray, time: float) -> None:
        """Note the marker's pose in a frame, unless it is not there or the frame is not new."""
        time = round(time, 6)
        if time < 0.0 or time == self._newest:
            return
        self._newest = time
        expected = self._kinematics.pose(MARKER, self._tour.at(time), relative_to=EYE)
        found = self._detector.detect(frame, {HAND: expected}).poses.get(HAND)
        if found is not None:
            self.times.append(time)
            self.markers.append(found.pose_marker_in_camera)
