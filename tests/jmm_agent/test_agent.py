"""The agent on simulated sensor readings: what it learns, what it refuses, and what it keeps.

The detector of most tests is a stand-in that returns the exact pose of the marker. The robot is the
nominal model, except that its lengths were zeroed at another posture.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np
import pytest

from jmm_agent.agent import Agent, AgentOptions
from jmm_agent.command_limits import CommandLimits
from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import TENSION_LIMIT, MotorControl
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Rule
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.observation import SensorReadings
from jmm_agent.posture_feedback import FeedbackOptions
from jmm_agent.updaters import VisionOptions
from jmm_agent.vision.balance import Loads
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import Detections, MarkerDetector, MarkerPose
from tests.jmm_agent.nominal_arm import ARM, JOINTS, posture_set

START, FIRST, SECOND, THIRD = posture_set()[:4]
MISTAKE = np.radians([1, -1, 1, 4, -4, 3, 4, -8, 7, 8, -7, 3, -3, 2])
FRAME = np.full((480, 640, 3), 90, dtype=np.uint8)
CAMERA = Camera.from_fovy(640, 480, radians(45.0))
CALM = np.full(36, 50.0)


class Detector:
    """Returns the exact pose of a site as that of marker 0."""

    def __init__(self, arm: ArmKinematics, site: str) -> None:
        self._arm, self._site, self.q = arm, site, START

    def detect(self, frame: np.ndarray, expected: object = None) -> Detections:
        pose = self._arm.pose(self._site, self.q, relative_to="eye")
        corners = np.zeros((4, 2))
        return Detections({0: MarkerPose(0, pose, corners, 0.0, pose, 9.0)}, {}, ())


class Trial:
    """An agent, and a robot at the posture that a test sets."""

    def __init__(
        self,
        nominal_map: JointMuscleMap,
        arm: ArmKinematics,
        detector: Any = "exact",
        rule: Rule | None = None,
        seed: int = 0,
        loads: Loads | None = None,
        **options: Any,
    ) -> None:
        choice = AgentOptions(**options)
        self.detector = Detector(arm, choice.marker_site)
        if detector == "exact":
            detector = self.detector
        rng = np.random.default_rng(seed)
        self.agent = Agent(
            nominal_map, arm, detector, posture_set(), START, rng, choice, rule, loads=loads
        )
        self._nominal_map, self.steps, self.q, self.frame = nominal_map, 0, START, FRAME
        self.agent.begin_episode()

    def readings(self, **more: Any) -> SensorReadings:
        time = 0.02 * self.steps
        lengths = self._nominal_map.lengths(self.q) - self._nominal_map.lengths(MISTAKE)
        frame_time = 0.2 * np.floor(time / 0.2 + 1e-9)
        return SensorReadings(time, lengths, CALM, self.frame, frame_time)._replace(**more)

    def step(self, **more: Any) -> np.ndarray:
        self.detector.q = self.q
        command = self.agent.step(self.readings(**more))
        self.steps += 1
        return command

    def rest(self, q: np.ndarray, steps: int = 60) -> np.ndarray:
        """Hold a posture for some steps; the last command."""
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


def missed_mm(trial: Trial, nominal_map: JointMuscleMap, q: np.ndarray) -> float:
    """RMS difference [mm] of the map from the robot's own lengths at q (n,) [rad]."""
    robot = nominal_map.lengths(q) - nominal_map.lengths(MISTAKE)
    return float(1e3 * np.sqrt(np.mean((trial.agent.map.lengths(q) - robot) ** 2)))


def test_it_learns_once_at_each_rest(nominal_map: JointMuscleMap, arm: ArmKinematics) -> None:
    trial = Trial(nominal_map, arm, vision=VisionOptions(lengths="l"))
    trial.visit(FIRST, SECOND)
    assert (trial.agent.vision.fired, trial.agent.antagonism.fired) == (2, 2)
    trial.rest(SECOND, 200)
    assert (trial.agent.vision.fired, trial.agent.antagonism.fired) == (2, 2)
    trial.visit(THIRD, posture_set()[4])
    before = 1e3 * np.sqrt(np.mean(nominal_map.lengths(MISTAKE) ** 2))
    assert missed_mm(trial, nominal_map, posture_set()[10]) < 0.75 * before


def test_it_remembers_how_long_ago_each_observation_was(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    for posture, steps in ((FIRST, 60), (SECOND, 200), (THIRD, 60)):
        trial.rest(posture, steps)
    ages = trial.agent.vision.memory.rests.drift.ages
    np.testing.assert_allclose(-np.diff(ages), [1.2, 4.0], atol=0.021)  # a control step
    assert ages[-1] == 0.0


def test_it_does_not_learn_while_it_moves(nominal_map: JointMuscleMap, arm: ArmKinematics) -> None:
    trial = Trial(nominal_map, arm)
    for share in np.linspace(0.0, 1.0, 100):
        trial.q = FIRST + share * (SECOND - FIRST)
        trial.step()
        assert not trial.agent.at_rest
    assert trial.same_map(nominal_map)


def test_a_frame_from_before_the_rest_is_not_evaluated(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    trial.q = FIRST
    for _ in range(100):
        trial.step(frame_time=-1.0)
    assert trial.agent.vision.fired == 0
    assert not trial.agent.at_rest
    trial.step(frame_time=1.0)
    assert trial.agent.vision.fired == 1
    assert trial.agent.at_rest


def test_the_command_is_the_maps_length_of_the_target(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm, detector=None, learn_antagonism=False)
    trial.step()
    trial.agent.go(SECOND, 0.5)
    command = trial.rest(START, 60)
    np.testing.assert_allclose(command, nominal_map.lengths(SECOND), atol=1e-12)
    np.testing.assert_array_equal(trial.agent.target, SECOND)
    command[:] = 0.0  # the caller may change it
    np.testing.assert_allclose(trial.step(), nominal_map.lengths(SECOND), atol=1e-12)
    longer = nominal_map.with_output_layers(
        {g.name: (g.W2, g.b2 + 1.0) for g in nominal_map.groups}
    )
    trial.agent.recall(longer, trial.agent.antagonism.memory, trial.agent.vision.memory)
    for moved in (0.0006, 0.001):  # at 30 mm/s
        np.testing.assert_allclose(trial.step(), nominal_map.lengths(SECOND) + moved, atol=1e-9)
    trial.agent.go(arm.limits[:, 1] + 0.05, 0.5)  # an estimate may be that far outside
    assert trial.agent.unreachable == ""
    beyond = np.full(14, 9.0)
    trial.agent.go(beyond, 0.5)
    np.testing.assert_array_equal(trial.agent.target, arm.limits[:, 1])
    assert "9 was asked for" in trial.agent.unreachable
    assert "postures are in rad or m" in trial.agent.unreachable
    trial.agent.go(SECOND, 0.5)
    assert trial.agent.unreachable == ""


def test_the_last_target_before_the_first_step_counts(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm, detector=None, learn_antagonism=False)
    trial.agent.go(FIRST, 0.5)
    trial.agent.go(SECOND, 0.5)
    command = trial.rest(START, 60)
    np.testing.assert_allclose(command, nominal_map.lengths(SECOND), atol=1e-12)


def test_a_trajectory_leads_through_its_points_without_a_jump(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm, detector=None, learn_antagonism=False)
    trial.rest(START, 5)
    trial.agent.go(np.array([FIRST, SECOND]), 2.0)
    commands = np.array([trial.step() for _ in range(102)])
    between = np.abs(commands - nominal_map.lengths(FIRST)).max(axis=1)
    assert between.min() < 1e-3
    np.testing.assert_allclose(commands[-1], nominal_map.lengths(SECOND), atol=1e-12)
    steps = np.abs(np.diff(commands, axis=0)).max(axis=1)
    assert steps.max() < 6.0 * steps.mean()
    assert steps[0] < 0.2 * steps.max()


def test_a_trajectory_set_before_the_first_step_is_followed(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm, detector=None, learn_antagonism=False)
    trial.agent.go(SECOND, 0.5)
    first = trial.step()
    np.testing.assert_array_equal(trial.agent.target, SECOND)
    np.testing.assert_allclose(first, nominal_map.lengths(trial.agent.joint_angles), atol=1e-3)
    np.testing.assert_allclose(trial.rest(START, 60), nominal_map.lengths(SECOND), atol=1e-12)


def test_feedback_is_switched_while_no_command_jumps(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm, detector=None, learn_antagonism=False)
    trial.rest(START, 5)
    trial.agent.go(START + 0.05, 0.5)
    without = trial.rest(START, 60)
    changes = []
    for options in (FeedbackOptions(), FeedbackOptions(gain=0.5), None):
        trial.agent.feedback = options
        commands = np.array([without, *(trial.step() for _ in range(200))])
        changes.append(np.abs(commands[-1] - without).max())
        assert np.abs(np.diff(commands, axis=0)).max() < 0.25 * max(changes)
        assert trial.agent.feedback == options
        without = commands[-1]
    assert changes[0] > 0.001


def test_without_a_trajectory_it_stays_where_it_starts(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm, detector=None, learn_antagonism=False)
    trial.rest(FIRST, 3)
    trial.agent.begin_episode()
    trial.steps = 0
    command = trial.rest(SECOND, 3)
    np.testing.assert_array_equal(command, nominal_map.lengths(trial.agent.target))
    np.testing.assert_allclose(command, trial.readings().lengths, atol=0.02)


BAD = {
    "lengths": [np.zeros(35), np.zeros((36, 1)), np.full(36, np.nan), np.full(36, np.inf)],
    "tensions": [np.zeros(1), np.array(50.0), np.full(36, np.nan)],
    "time": [np.nan, np.inf, -np.inf],
}


@pytest.fixture(scope="module")
def clean(nominal_map: JointMuscleMap, arm: ArmKinematics) -> tuple[Trial, Trial]:
    """A trial after its first visit, and its copy after the second one."""
    trial = Trial(nominal_map, arm)
    trial.visit(FIRST)
    later = deepcopy(trial)
    later.visit(SECOND)
    return trial, later


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in BAD.items() for value in values]
)
def test_bad_readings_are_refused_and_change_nothing(
    name: str, value: Any, clean: tuple[Trial, Trial]
) -> None:
    before, after = clean
    spoilt = deepcopy(before)
    learned = spoilt.agent.map
    with pytest.raises(AgentError, match=f"Agent: {name} must be"):
        spoilt.agent.step(spoilt.readings(**{name: value}))
    assert spoilt.agent.map is learned
    spoilt.visit(SECOND)
    assert spoilt.agent.vision.fired == 2
    assert spoilt.same_map(after.agent.map)
    assert not spoilt.same_map(before.agent.map)
    np.testing.assert_array_equal(spoilt.agent.joint_angles, after.agent.joint_angles)


def test_bad_first_readings_do_not_start_it(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    for name, values in BAD.items():
        for value in values[:3]:
            with pytest.raises(AgentError):
                trial.agent.step(trial.readings(**{name: value}))
    trial.visit(FIRST)
    assert trial.agent.vision.fired == 1


def frames() -> Iterator[tuple[np.ndarray, bool]]:
    """Frames without a usable marker, and whether they have the right shape and type."""
    yield np.zeros((480, 640, 3), dtype=np.uint8), True
    yield FRAME, True
    yield np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8), True
    yield FRAME[:100], False
    yield FRAME.astype(float), False
    yield FRAME[..., 0], False


@pytest.mark.parametrize(("frame", "whole"), list(frames()))
def test_frames_without_a_marker_leave_the_map(
    frame: np.ndarray, whole: bool, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    detector = MarkerDetector(CAMERA, {0: 0.05, 1: 0.036})
    trial = Trial(nominal_map, arm, detector=detector, learn_antagonism=False)
    trial.frame = frame
    if whole:
        trial.visit(FIRST, SECOND)
        assert trial.agent.vision.dropped == {"the hand's marker was not seen": 2}
    else:
        with pytest.raises(AgentError, match="camera frame"):
            trial.visit(FIRST)
        trial.frame = FRAME
        trial.steps += 1
        trial.visit(SECOND)
    assert trial.agent.vision.fired == 0
    assert trial.same_map(nominal_map)


def test_no_frame_is_a_skip_too(nominal_map: JointMuscleMap, arm: ArmKinematics) -> None:
    trial = Trial(nominal_map, arm, learn_antagonism=False)
    trial.frame = None
    trial.visit(FIRST)
    assert trial.agent.vision.dropped == {"the hand's marker was not seen": 1}
    assert trial.same_map(nominal_map)


def test_a_hand_that_is_not_free_leaves_the_map(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    trial.agent.hand_is_free = False
    trial.visit(FIRST, SECOND)
    assert trial.same_map(nominal_map)
    assert not trial.agent.at_rest
    trial.agent.hand_is_free = True
    trial.visit(SECOND)
    assert (trial.agent.vision.fired, trial.agent.antagonism.fired) == (1, 1)


def test_without_learning_it_evaluates_and_leaves_the_map(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    trial.agent.learning = False
    trial.visit(FIRST, SECOND)
    assert trial.same_map(nominal_map)
    assert (trial.agent.vision.fired, trial.agent.antagonism.fired) == (0, 0)
    assert len(trial.agent.vision.pairs.postures) == len(trial.agent.antagonism.pairs.postures) == 0
    seen = trial.agent.seen
    assert seen is not None
    error = np.degrees(np.sqrt(np.mean((trial.agent.joint_angles - SECOND) ** 2)))
    assert error > 2.0
    assert np.degrees(np.sqrt(np.mean((seen.angles - SECOND) ** 2))) < error


@pytest.mark.parametrize(
    ("options", "fired"),
    [({"learn_vision": False}, (0, 2)), ({"learn_antagonism": False}, (2, 0))],
)
def test_each_updater_may_run_alone(
    options: dict[str, bool],
    fired: tuple[int, int],
    nominal_map: JointMuscleMap,
    arm: ArmKinematics,
) -> None:
    trial = Trial(nominal_map, arm, **options)
    trial.visit(FIRST, SECOND)
    assert (trial.agent.vision.fired, trial.agent.antagonism.fired) == fired
    assert not trial.same_map(nominal_map)


def test_a_new_episode_keeps_what_was_learned(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    trial.visit(FIRST, SECOND)
    learned, pairs = trial.agent.map, trial.agent.vision.pairs
    trial.agent.begin_episode()
    assert trial.agent.map is learned
    assert trial.agent.vision.pairs is pairs
    assert trial.agent.seen is None
    assert trial.agent.markers == {}
    assert not trial.agent.at_rest
    trial.steps = 0  # the clock of a new episode
    trial.rest(THIRD, 3)
    assert trial.agent.map is learned
    trial.visit(THIRD)
    assert trial.agent.vision.fired == 3


def test_any_site_can_carry_the_marker(nominal_map: JointMuscleMap, arm: ArmKinematics) -> None:
    trial = Trial(nominal_map, arm, marker_site="grip")
    trial.visit(FIRST, SECOND)
    assert trial.agent.vision.fired == 2
    wrong = Trial(nominal_map, arm, marker_site="marker_hand")
    wrong.detector._site = "grip"
    wrong.visit(FIRST, SECOND)
    assert trial.agent.seen is not None
    assert wrong.agent.seen is not None
    right_error = np.linalg.norm(trial.agent.seen.angles - SECOND)
    assert right_error < 0.7 * np.linalg.norm(wrong.agent.seen.angles - SECOND)


def test_an_unknown_site_is_named(nominal_map: JointMuscleMap, arm: ArmKinematics) -> None:
    with pytest.raises(AgentError, match="marker_foot"):
        Agent(
            nominal_map, arm, None, posture_set(), START, np.random.default_rng(0),
            AgentOptions(marker_site="marker_foot"),
        )  # fmt: skip


def test_kinematics_of_other_joints_are_refused(nominal_map: JointMuscleMap) -> None:
    fewer = ArmKinematics(ARM, JOINTS[:-1])
    with pytest.raises(AgentError, match="joints"):
        Agent(nominal_map, fewer, None, posture_set(), START, np.random.default_rng(0))


@pytest.mark.parametrize(
    "posture", [np.zeros(13), np.full(14, np.nan), np.zeros((2, 15)), np.empty((0, 14))]
)
def test_bad_targets_are_refused(
    posture: np.ndarray, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    before = trial.agent.target
    with pytest.raises(AgentError, match="14 joints"):
        trial.agent.go(posture, 1.0)
    np.testing.assert_array_equal(trial.agent.target, before)


@pytest.mark.parametrize("duration", [-1.0, np.nan, np.inf])
def test_bad_durations_are_refused(
    duration: float, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    with pytest.raises(AgentError, match="duration"):
        Trial(nominal_map, arm).agent.go(FIRST, duration)


def test_the_papers_options_work(nominal_map: JointMuscleMap, arm: ArmKinematics) -> None:
    rule = MinibatchRule(steps=10, rate=1e-3)
    trial = Trial(
        nominal_map, arm, rule=rule, vision=VisionOptions(lengths="l_target", fit="alone")
    )
    commands = [trial.rest(FIRST), trial.rest(SECOND)]
    assert trial.agent.vision.fired == 2
    np.testing.assert_allclose(trial.agent.vision.pairs.lengths, commands, atol=0.005)
    assert np.abs(trial.agent.vision.pairs.lengths[1] - trial.readings().lengths).max() > 0.02
    assert not trial.same_map(nominal_map)
    moved = trial.agent.map
    for before, after in zip(nominal_map.groups, moved.groups, strict=True):
        assert np.abs(before.W1 - after.W1).max() > 0


def test_same_seed_same_bits_other_seed_others(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trials = [Trial(nominal_map, arm, seed=seed) for seed in (3, 3, 4)]
    for trial in trials:
        trial.visit(FIRST, SECOND)
    assert trials[0].same_map(trials[1].agent.map)
    assert not trials[0].same_map(trials[2].agent.map)


def test_readings_that_change_afterwards_do_not_change_what_was_learned(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    trial.q = FIRST
    trial.detector.q = FIRST
    buffer = np.empty(36)
    for _ in range(60):
        readings = trial.readings()
        buffer[:] = readings.lengths
        trial.agent.step(readings._replace(lengths=buffer))
        trial.steps += 1
    kept = trial.agent.vision.pairs.lengths.copy()
    buffer[:] = 9.0
    np.testing.assert_array_equal(trial.agent.vision.pairs.lengths, kept)
    trial.visit(SECOND)
    assert np.abs(trial.agent.vision.pairs.lengths).max() < 1.0


def test_options_can_be_replaced_one_by_one() -> None:
    assert replace(AgentOptions(), hand_marker=7).can_marker == AgentOptions().can_marker


@pytest.mark.parametrize("gap", [20, 500])
def test_the_trajectory_pauses_in_a_gap(
    nominal_map: JointMuscleMap, arm: ArmKinematics, gap: int
) -> None:
    """After 0.4 s and 10 s without readings it goes on from where it was."""
    trials = [Trial(nominal_map, arm, detector=None) for _ in range(2)]
    for trial, missing in zip(trials, (0, gap), strict=True):
        trial.rest(START, 5)
        trial.agent.go(FIRST, 2.0)
        trial.rest(START, 30)
        trial.steps += missing
    after = [trial.step() for trial in trials]
    np.testing.assert_allclose(after[1], after[0], atol=1e-9)


def test_the_rate_of_commands_is_limited_and_the_trajectory_pauses_in_a_gap(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    """A gap of 10 s is not followed by the end of the trajectory in one step."""
    trial = Trial(nominal_map, arm)
    trial.agent.limits = CommandLimits(0.2)
    before = trial.rest(START, 5)
    trial.agent.go(FIRST, 2.0)
    for number in range(60):
        trial.steps += 500 if number == 30 else 0
        command = trial.step()
        assert np.abs(command - before).max() <= 0.2 * 0.02 + 1e-12
        before = command
    share = np.abs(command - nominal_map.lengths(FIRST)).max()
    assert share > 0.2 * np.abs(nominal_map.lengths(START) - nominal_map.lengths(FIRST)).max()
    end = trial.rest(START, 60)
    np.testing.assert_allclose(end, trial.agent.map.lengths(FIRST), atol=1e-9)


def test_a_tension_that_stays_at_its_limit_stops_the_motion(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    agent = trial.agent
    agent.motors = MotorControl()
    trial.rest(START)
    agent.go(FIRST, 30.0)
    strained = CALM.copy()
    strained[7] = 0.99 * agent.motors.limit
    for _ in range(200):
        trial.step(tensions=strained)
    assert agent.unreachable == ""
    for _ in range(100):
        trial.step(tensions=strained)
    assert [(one.kind, one.where) for one in agent.faults if one.kind == TENSION_LIMIT] == [
        (TENSION_LIMIT, nominal_map.muscles[7])
    ]
    assert agent.unreachable.startswith(f"The motion was stopped: {nominal_map.muscles[7]} has")
    assert np.abs(agent.target - agent.joint_angles).max() < np.radians(1.0)


def test_markers_are_where_a_camera_with_the_errors_that_were_found_sees_them(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    trial.step()
    [before] = trial.agent.detect_markers(trial.readings()).values()
    memory, errors = trial.agent.vision.memory, np.zeros(8)
    errors[:3] = 0.01, -0.02, 0.03
    trial.agent.vision.memory = memory._replace(rests=memory.rests._replace(camera=errors))
    [after] = trial.agent.detect_markers(trial.readings()).values()
    moved = after.pose_marker_in_camera - before.pose_marker_in_camera
    np.testing.assert_allclose(moved[:3, 3], errors[:3], atol=1e-12)
