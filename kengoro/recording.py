"""Recordings of a moving robot: commands, lengths, tensions and marker observations.

A recording holds nothing that the agent does not get: no true joint angles and no departures.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro.errors import UsageError
from kengoro.robots import CAMERA, HAND, NO_END, SIDES, make_env
from kengoro.study_model import MARKER
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures.camera import EYE
from kengoro_env.env import KengoroEnv
from kengoro_env.names import JOINTS
from kengoro_env.robot.control_period import CONTROL_PERIOD
from kengoro_env.robot.nominal_model import NominalArm

SETTLE = 2.0
"""How long the first command is held before the recording begins [s]."""


@dataclass(frozen=True)
class Arm:
    """What is recorded.

    Attributes:
        task: of the environment, as in `make_env`.
        scene: MJCF file of its nominal model.
    """

    task: str
    scene: Path


def whole_arm() -> Arm:
    """Head and arm with 36 muscles and the camera."""
    return Arm("Posture", asset_path("mjcf/kengoro_arm/posture.xml"))


def elbow() -> Arm:
    """The elbow with its three muscles, without a camera."""
    return Arm("Elbow", asset_path("mjcf/kengoro_arm/elbow.xml"))


@dataclass(frozen=True)
class Tour:
    """Postures to visit in order.

    Attributes:
        postures: shape (K, n) [rad]; the tour starts at the first.
        move: duration of each movement [s].
        hold: how long the arm stays at each posture [s].
    """

    postures: Floats
    move: float
    hold: float

    @property
    def duration(self) -> float:
        """Duration to the end of the stay at the last posture [s]."""
        return self.hold + (len(self.postures) - 1) * (self.move + self.hold)

    def at(self, time: float) -> Floats:
        """Commanded posture at a time [s], shape (n,) [rad]; movements start and end at rest."""
        leg, since = divmod(max(time, 0.0) - self.hold, self.move + self.hold)
        first = min(max(int(leg), -1), len(self.postures) - 1)
        if first < 0 or first == len(self.postures) - 1:
            return self.postures[max(first, 0)]
        share = min(1.0, since / self.move)
        share *= share * (3.0 - 2.0 * share)
        return self.postures[first] + share * (self.postures[first + 1] - self.postures[first])


@dataclass(frozen=True)
class Recording:
    """One recorded episode. Lengths are encoder readings: 0 where the encoders were zeroed.

    Attributes:
        time: shape (k,) [s] from the start, one control period apart.
        command: target lengths from each time on, shape (k, m) [m].
        lengths: measured at each time, shape (k, m) [m].
        tensions: measured at each time, shape (k, m) [N].
        start: joint angles at which the agent believes to start, shape (n,) [rad].
        observation_time: when the frames with the hand's marker were taken, shape (c,) [s].
        markers: pose of the marker in the camera in these frames, shape (c, 4, 4): x right, y down,
            z forward.
    """

    time: Floats
    command: Floats
    lengths: Floats
    tensions: Floats
    start: Floats
    observation_time: Floats = field(default_factory=lambda: np.zeros(0))
    markers: Floats = field(default_factory=lambda: np.zeros((0, 4, 4)))


def record_episode(
    arm: Arm,
    robot: int | None,
    tour: Tour,
    seed: int = 0,
    control_period: float = CONTROL_PERIOD,
) -> Recording:
    """Move a robot by commands from its nominal model, and record its sensor readings.

    Args:
        arm: what is recorded.
        robot: seed of an actual robot; None for the nominal model.
        tour: postures to visit.
        seed: of the sensor noise.
        control_period: time between two commands [s].

    Raises:
        UsageError: the environment ended the episode.
    """
    env = make_env(arm.task, robot, max_episode_steps=NO_END, control_period=control_period)
    world = env.unwrapped
    if not isinstance(world, KengoroEnv):
        raise UsageError(f"A recording needs a Kengoro environment, not {world}.")
    start = tour.at(0.0)
    nominal, markers = NominalArm(arm.scene), _MarkerLog(tour)
    observation, _ = env.reset(seed=seed, options={"posture": start, "target": start})
    settling = round(SETTLE / control_period)
    time: list[float] = []
    command: list[Floats] = []
    lengths: list[Floats] = []
    tensions: list[Floats] = []
    for step in range(-settling, round(tour.duration / control_period)):
        now = step * control_period
        action = world.lengths_to_action(nominal.lengths(tour.at(now))[0])
        if step >= 0:
            time.append(round(now, 6))
            command.append(world.action_to_lengths(action))
            lengths.append(observation["lengths"])
            tensions.append(observation["tensions"])
            if "frame" in observation:
                markers.observe(observation["frame"], float(observation["frame_time"][0]) - SETTLE)
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
        observation_time=np.array(markers.times),
        markers=np.array(markers.poses).reshape(-1, 4, 4),
    )


class _MarkerLog:
    """Poses of the hand's marker in the frames of a recording.

    The corners of a marker that is small or faces the camera fit two poses; the one nearer to the
    commanded posture is taken.
    """

    def __init__(self, tour: Tour) -> None:
        self._tour = tour
        self._kinematics = ArmKinematics(asset_path(ARM), JOINTS)
        self._detector = MarkerDetector(CAMERA, SIDES)
        self._newest = -np.inf
        self.times: list[float] = []
        self.poses: list[Floats] = []

    def observe(self, frame: np.ndarray, time: float) -> None:
        """Add the marker's pose in a frame, if the frame is new and the marker is found."""
        time = round(time, 6)
        if time < 0.0 or time == self._newest:
            return
        self._newest = time
        expected = self._kinematics.pose(MARKER, self._tour.at(time), relative_to=EYE)
        found = self._detector.detect(frame, {HAND: expected}).poses.get(HAND)
        if found is not None:
            self.times.append(time)
            self.poses.append(found.pose_marker_in_camera)
