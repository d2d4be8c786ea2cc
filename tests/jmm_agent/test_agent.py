"""The agent on made-up senses: what it learns, what it refuses, and what it keeps.

The eyes of most tests are a stand-in that gives the exact pose of the marker; the robot is the
drawing but for lengths that were zeroed at another posture.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np
import pytest

from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Rule
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.observation import SensorReadings
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import Detections, MarkerDetector, MarkerPose
from kengoro.trained_maps import trained_map
from kengoro_env.assets import asset_path
from kengoro_env.names import JOINTS
from kengoro_env.postures import posture_set

START, FIRST, SECOND, THIRD = posture_set()[:4]
MISTAKE = np.radians([1, -1, 1, 4, -4, 3, 4, -8, 7, 8, -7, 3, -3, 2])
FRAME = np.full((480, 640, 3), 90, dtype=np.uint8)
CAMERA = Camera.from_fovy(640, 480, radians(45.0))
CALM = np.full(36, 50.0)


@pytest.fixture(scope="module")
def drawn(request: pytest.FixtureRequest) -> JointMuscleMap:
    return trained_map(request.config.cache.mkdir("maps"))


@pytest.fixture(scope="module")
def arm() -> ArmKinematics:
    return ArmKinematics(asset_path("mjcf/kengoro_arm/arm.xml"), JOINTS)


class Detector:
    """Sees the site as marker 0, exactly."""

    def __init__(self, arm: ArmKinematics, site: str) -> None:
        self._arm, self._site, self.q = arm, site, START

    def detect(self, frame: np.ndarray, expected: object = None) -> Detections:
        pose = self._arm.pose(self._site, self.q, relative_to="eye")
        corners = np.zeros((4, 2))
        return Detections({0: MarkerPose(0, pose, corners, 0.0, pose, 9.0)}, {}, ())


class Life:
    """An agent and a robot that is wherever a test puts it."""

    def __init__(
        self,
        drawn: JointMuscleMap,
        arm: ArmKinematics,
        detector: Any = "eyes",
        rule: Rule | None = None,
        seed: int = 0,
        **options: Any,
    ) -> None:
        choice = AgentOptions(**options)
        self.detector = Detector(arm, choice.marker_site)
        if detector == "eyes":
            detector = self.detector
        rng = np.random.default_rng(seed)
        self.agent = Agent(drawn, arm, detector, posture_set(), START, rng, choice, rule)
        self._drawn, self.steps, self.q, self.frame = drawn, 0, START, FRAME
        self.agent.begin_episode()

    def readings(self, **more: Any) -> SensorReadings:
        time = 0.02 * self.steps
        lengths = self._drawn.lengths(self.q) - self._drawn.lengths(MISTAKE)
        frame_time = 0.2 * np.floor(time / 0.2 + 1e-9)
        return SensorReadings(time, lengths, CALM, self.frame, frame_time)._replace(**more)

    def step(self, **more: Any) -> np.ndarray:
        self.detector.q = self.q
        command = self.agent.step(self.readings(**more))
        self.steps += 1
        return command

    def rest(self, q: np.ndarray, steps: int = 60) -> np.ndarray:
        """Be at a posture for a while; the last command."""
        self.q = q
        return [self.step() for _ in range(steps)][-1]

    def visit(self, *postures: np.ndarray) -> None:
        for posture in postures:
            self.rest(posture)

    def same_map(self, other: JointMuscleMap) -> bool:
        pairs = zip(self.agent.map.groups, other.groups, strict=True)
        return all(
            np.array_equal(getattr(one, layer), getattr(two, layer))
            for one, two in pairs
            for layer in ("W1", "b1", "W2", "b2")
        )


def missed_mm(life: Life, drawn: JointMuscleMap, q: np.ndarray) -> float:
    """How far the map is from the robot's own lengths."""
    robot = drawn.lengths(q) - drawn.lengths(MISTAKE)
    return float(1e3 * np.sqrt(np.mean((life.agent.map.lengths(q) - robot) ** 2)))


def test_it_learns_once_at_each_rest(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    life = Life(drawn, arm, vision=VisionOptions(lengths="l"))
    life.visit(FIRST, SECOND)
    assert (life.agent.vision.fired, life.agent.antagonism.fired) == (2, 2)
    life.rest(SECOND, 200)
    assert (life.agent.vision.fired, life.agent.antagonism.fired) == (2, 2)
    life.visit(THIRD, posture_set()[4])
    before = 1e3 * np.sqrt(np.mean(drawn.lengths(MISTAKE) ** 2))
    assert missed_mm(life, drawn, posture_set()[10]) < 0.75 * before


def test_it_does_not_learn_while_it_moves(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    life = Life(drawn, arm)
    for share in np.linspace(0.0, 1.0, 100):
        life.q = FIRST + share * (SECOND - FIRST)
        life.step()
        assert not life.agent.at_rest
    assert life.same_map(drawn)


def test_a_frame_from_before_the_rest_is_not_looked_at(
    drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm)
    life.q = FIRST
    for _ in range(100):
        life.step(frame_time=-1.0)
    assert life.agent.vision.fired == 0
    assert not life.agent.at_rest
    life.step(frame_time=1.0)
    assert life.agent.vision.fired == 1
    assert life.agent.at_rest


def test_the_command_is_the_maps_length_of_the_target(
    drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm, detector=None, learn_antagonism=False)
    life.step()
    life.agent.go(SECOND, 0.5)
    command = life.rest(START, 60)
    np.testing.assert_allclose(command, drawn.lengths(SECOND), atol=1e-12)
    np.testing.assert_array_equal(life.agent.target, SECOND)
    command[:] = 0.0  # whose array it is now
    np.testing.assert_allclose(life.step(), drawn.lengths(SECOND), atol=1e-12)
    longer = drawn.with_output_layers({g.name: (g.W2, g.b2 + 1.0) for g in drawn.groups})
    life.agent.recall(longer, life.agent.antagonism.memory, life.agent.vision.memory)
    np.testing.assert_allclose(life.step(), drawn.lengths(SECOND) + 0.001, atol=1e-12)
    beyond = np.full(14, 9.0)
    life.agent.go(beyond, 0.5)
    np.testing.assert_array_equal(life.agent.target, arm.limits[:, 1])


def test_a_way_leads_through_its_points_without_a_jump(
    drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm, detector=None, learn_antagonism=False)
    life.rest(START, 5)
    life.agent.go(np.array([FIRST, SECOND]), 2.0)
    commands = np.array([life.step() for _ in range(102)])
    between = np.abs(commands - drawn.lengths(FIRST)).max(axis=1)
    assert between.min() < 1e-3
    np.testing.assert_allclose(commands[-1], drawn.lengths(SECOND), atol=1e-12)
    steps = np.abs(np.diff(commands, axis=0)).max(axis=1)
    assert steps.max() < 6.0 * steps.mean()
    assert steps[0] < 0.2 * steps.max()


def test_a_way_that_is_asked_for_before_the_first_step_is_gone(
    drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm, detector=None, learn_antagonism=False)
    life.agent.go(SECOND, 0.5)
    first = life.step()
    np.testing.assert_array_equal(life.agent.target, SECOND)
    np.testing.assert_allclose(first, drawn.lengths(life.agent.joint_angles), atol=1e-3)
    np.testing.assert_allclose(life.rest(START, 60), drawn.lengths(SECOND), atol=1e-12)


def test_without_a_way_it_stays_where_it_wakes(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    life = Life(drawn, arm, detector=None, learn_antagonism=False)
    life.rest(FIRST, 3)
    life.agent.begin_episode()
    life.steps = 0
    command = life.rest(SECOND, 3)
    np.testing.assert_array_equal(command, drawn.lengths(life.agent.target))
    np.testing.assert_allclose(command, life.readings().lengths, atol=0.02)


BAD = {
    "lengths": [np.zeros(35), np.zeros((36, 1)), np.full(36, np.nan), np.full(36, np.inf)],
    "tensions": [np.zeros(1), np.array(50.0), np.full(36, np.nan)],
    "time": [np.nan, np.inf, -1.0],
}


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in BAD.items() for value in values]
)
def test_bad_senses_are_refused_and_change_nothing(
    name: str, value: Any, drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    clean, spoilt = Life(drawn, arm), Life(drawn, arm)
    for life in (clean, spoilt):
        life.visit(FIRST)
    learned = spoilt.agent.map
    with pytest.raises(AgentError, match=f"Agent: {name} must be"):
        spoilt.agent.step(spoilt.readings(**{name: value}))
    assert spoilt.agent.map is learned
    for life in (clean, spoilt):
        life.visit(SECOND)
    assert spoilt.agent.vision.fired == 2
    assert spoilt.same_map(clean.agent.map)
    np.testing.assert_array_equal(spoilt.agent.joint_angles, clean.agent.joint_angles)


def test_bad_first_senses_do_not_wake_it(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    life = Life(drawn, arm)
    for name, values in BAD.items():
        for value in values[:3]:
            if (name, np.ndim(value)) == ("time", 0) and value == -1.0:
                continue  # a first time may be any
            with pytest.raises(AgentError):
                life.agent.step(life.readings(**{name: value}))
    life.visit(FIRST)
    assert life.agent.vision.fired == 1


def frames() -> Iterator[tuple[np.ndarray, bool]]:
    """Frames without a usable marker, and whether they are frames at all."""
    yield np.zeros((480, 640, 3), dtype=np.uint8), True
    yield FRAME, True
    yield np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8), True
    yield FRAME[:100], False
    yield FRAME.astype(float), False
    yield FRAME[..., 0], False


@pytest.mark.parametrize(("frame", "whole"), list(frames()))
def test_frames_without_a_marker_leave_the_map(
    frame: np.ndarray, whole: bool, drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    detector = MarkerDetector(CAMERA, {0: 0.05, 1: 0.036})
    life = Life(drawn, arm, detector=detector, learn_antagonism=False)
    life.frame = frame
    if whole:
        life.visit(FIRST, SECOND)
        assert life.agent.vision.dropped == {"the hand's marker was not seen": 2}
    else:
        with pytest.raises(AgentError, match="camera frame"):
            life.visit(FIRST)
        life.frame = FRAME
        life.steps += 1
        life.visit(SECOND)
    assert life.agent.vision.fired == 0
    assert life.same_map(drawn)


def test_no_frame_is_a_skip_too(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    life = Life(drawn, arm, learn_antagonism=False)
    life.frame = None
    life.visit(FIRST)
    assert life.agent.vision.dropped == {"the hand's marker was not seen": 1}
    assert life.same_map(drawn)


def test_a_hand_that_is_not_free_leaves_the_map(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    life = Life(drawn, arm)
    life.agent.hand_is_free = False
    life.visit(FIRST, SECOND)
    assert life.same_map(drawn)
    assert not life.agent.at_rest
    life.agent.hand_is_free = True
    life.visit(SECOND)
    assert (life.agent.vision.fired, life.agent.antagonism.fired) == (1, 1)


def test_without_learning_it_looks_and_leaves_the_map(
    drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm)
    life.agent.learning = False
    life.visit(FIRST, SECOND)
    assert life.same_map(drawn)
    assert (life.agent.vision.fired, life.agent.antagonism.fired) == (0, 0)
    assert len(life.agent.vision.pairs.postures) == len(life.agent.antagonism.pairs.postures) == 0
    seen = life.agent.seen
    assert seen is not None
    error = np.degrees(np.sqrt(np.mean((life.agent.joint_angles - SECOND) ** 2)))
    assert error > 2.0
    assert np.degrees(np.sqrt(np.mean((seen.angles - SECOND) ** 2))) < error


@pytest.mark.parametrize(
    ("options", "fired"),
    [({"learn_vision": False}, (0, 2)), ({"learn_antagonism": False}, (2, 0))],
)
def test_each_updater_may_run_alone(
    options: dict[str, bool], fired: tuple[int, int], drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm, **options)
    life.visit(FIRST, SECOND)
    assert (life.agent.vision.fired, life.agent.antagonism.fired) == fired
    assert not life.same_map(drawn)


def test_an_episode_begins_anew_and_keeps_what_was_learned(
    drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm)
    life.visit(FIRST, SECOND)
    learned, pairs = life.agent.map, life.agent.vision.pairs
    life.agent.begin_episode()
    assert life.agent.map is learned
    assert life.agent.vision.pairs is pairs
    assert life.agent.seen is None
    assert life.agent.markers == {}
    assert not life.agent.at_rest
    life.steps = 0  # the clock of a new episode
    life.rest(THIRD, 3)
    assert life.agent.map is learned
    life.visit(THIRD)
    assert life.agent.vision.fired == 3


def test_any_site_can_carry_the_marker(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    life = Life(drawn, arm, marker_site="grip")
    life.visit(FIRST, SECOND, THIRD)
    assert life.agent.vision.fired == 3
    wrong = Life(drawn, arm, marker_site="marker_hand")
    wrong.detector._site = "grip"
    wrong.visit(FIRST, SECOND, THIRD)
    assert life.agent.seen is not None
    assert wrong.agent.seen is not None
    right_error = np.linalg.norm(life.agent.seen.angles - THIRD)
    assert right_error < 0.7 * np.linalg.norm(wrong.agent.seen.angles - THIRD)


def test_an_unknown_site_is_named(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    with pytest.raises(AgentError, match="marker_foot"):
        Agent(
            drawn, arm, None, posture_set(), START, np.random.default_rng(0),
            AgentOptions(marker_site="marker_foot"),
        )  # fmt: skip


def test_kinematics_of_other_joints_are_refused(drawn: JointMuscleMap) -> None:
    fewer = ArmKinematics(asset_path("mjcf/kengoro_arm/arm.xml"), JOINTS[:-1])
    with pytest.raises(AgentError, match="joints"):
        Agent(drawn, fewer, None, posture_set(), START, np.random.default_rng(0))


@pytest.mark.parametrize(
    "posture", [np.zeros(13), np.full(14, np.nan), np.zeros((2, 15)), np.empty((0, 14))]
)
def test_bad_targets_are_refused(
    posture: np.ndarray, drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm)
    before = life.agent.target
    with pytest.raises(AgentError, match="14 joints"):
        life.agent.go(posture, 1.0)
    np.testing.assert_array_equal(life.agent.target, before)


@pytest.mark.parametrize("duration", [-1.0, np.nan, np.inf])
def test_bad_durations_are_refused(
    duration: float, drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    with pytest.raises(AgentError, match="duration"):
        Life(drawn, arm).agent.go(FIRST, duration)


def test_the_papers_options_work(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    rule = MinibatchRule(steps=10, rate=1e-3)
    life = Life(drawn, arm, rule=rule, vision=VisionOptions(lengths="l_target"))
    commands = [life.rest(FIRST), life.rest(SECOND)]
    assert life.agent.vision.fired == 2
    np.testing.assert_allclose(life.agent.vision.pairs.lengths, commands, atol=0.005)
    assert np.abs(life.agent.vision.pairs.lengths[1] - life.readings().lengths).max() > 0.02
    assert not life.same_map(drawn)
    moved = life.agent.map
    for before, after in zip(drawn.groups, moved.groups, strict=True):
        assert np.abs(before.W1 - after.W1).max() > 0


def test_same_seed_same_bits_other_seed_others(drawn: JointMuscleMap, arm: ArmKinematics) -> None:
    lives = [Life(drawn, arm, seed=seed) for seed in (3, 3, 4)]
    for life in lives:
        life.visit(FIRST, SECOND)
    assert lives[0].same_map(lives[1].agent.map)
    assert not lives[0].same_map(lives[2].agent.map)


def test_senses_that_change_afterwards_do_not_change_what_was_learned(
    drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm)
    life.q = FIRST
    life.detector.q = FIRST
    buffer = np.empty(36)
    for _ in range(60):
        readings = life.readings()
        buffer[:] = readings.lengths
        life.agent.step(readings._replace(lengths=buffer))
        life.steps += 1
    kept = life.agent.vision.pairs.lengths.copy()
    buffer[:] = 9.0
    np.testing.assert_array_equal(life.agent.vision.pairs.lengths, kept)
    life.visit(SECOND)
    assert np.abs(life.agent.vision.pairs.lengths).max() < 1.0


def test_options_can_be_replaced_one_by_one() -> None:
    assert replace(AgentOptions(), hand_marker=7).can_marker == AgentOptions().can_marker
