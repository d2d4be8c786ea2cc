"""A guarded agent on simulated sensor readings: faults are named, and nothing is learned from them.

The robot is the nominal model, except that its lengths were zeroed at another posture. Its encoders
are noisy, its tensions follow from the last command, and its marker detector is exact.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.errors import AgentError
from jmm_agent.guard import faults
from jmm_agent.guard.faults import Fault, MotorControl, faults_for_info
from jmm_agent.guard.guard import Guard, GuardOptions
from jmm_agent.guard.motion_monitor import DisturbanceMonitorOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_detector import Detections, MarkerPose, Skip
from tests.jmm_agent.nominal_arm import posture_set

START, FIRST, SECOND, THIRD = posture_set()[:4]
MISTAKE = np.radians([1, -1, 1, 4, -4, 3, 4, -8, 7, 8, -7, 3, -3, 2])
MOTORS = MotorControl()
MUSCLE = 14


class Trial:
    """An agent, and a robot at the posture that a test sets; also the agent's marker detector."""

    def __init__(
        self,
        nominal_map: JointMuscleMap,
        arm: ArmKinematics,
        guarded: bool = True,
        options: GuardOptions | None = None,
    ) -> None:
        self._nominal_map, self._arm, self.hidden, self.frozen = nominal_map, arm, False, False
        camera = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)
        guard = Guard(nominal_map.muscles, arm, camera, None, MOTORS, options)
        self.agent = Agent(
            nominal_map, arm, self, posture_set(), START, np.random.default_rng(0),
            guard=guard if guarded else None,
        )  # fmt: skip
        self.rng, self.steps, self.q, self.twice = np.random.default_rng(1), 0, START, False
        self.command = nominal_map.lengths(START)
        self.agent.begin_episode()

    def detect(self, frame_rgb: np.ndarray, expected: object = None) -> Detections:
        if self.twice or self.hidden:
            return Detections({}, {0: Skip.TWICE if self.twice else Skip.NOT_SEEN}, ())
        pose = self._arm.pose("marker_hand", self.q, relative_to="eye")
        marker = MarkerPose(0, pose, np.zeros((4, 2)), 0.0, pose, 9.0)
        return Detections({0: marker}, {}, ())

    def step(self, lengths_off: Any = 0.0, tensions: Any = None) -> np.ndarray:
        time = 0.02 * self.steps
        true = self._nominal_map.lengths(self.q) - self._nominal_map.lengths(MISTAKE)
        lengths = true + 5e-5 * self.rng.standard_normal(36)
        pull = np.minimum(MOTORS.demanded(lengths, self.command), MOTORS.limit)
        frame = self.rng.integers(0, 255, (4, 4, 3)).astype(np.uint8)
        if self.frozen:
            frame[:] = 0
        readings = SensorReadings(
            time,
            lengths + lengths_off,
            pull if tensions is None else tensions,
            frame,
            0.2 * np.floor(time / 0.2 + 1e-9),
        )
        self.steps += 1
        self.measured = readings.lengths
        self.command = self.agent.step(readings)
        return self.command

    def rest(self, q: np.ndarray, steps: int = 60, **more: Any) -> None:
        """Move to a posture, and hold it for some steps."""
        for share in np.linspace(0.0, 1.0, 25)[1:] if np.any(q != self.q) else ():
            self.q = self.q + share * (q - self.q)
            self.step(**more)
        for _ in range(steps):
            self.step(**more)

    @property
    def kinds(self) -> list[str]:
        return [fault.kind for fault in self.agent.faults]


def one_muscle(value: float) -> np.ndarray:
    off = np.zeros(36)
    off[MUSCLE] = value
    return off


@pytest.fixture
def trial(nominal_map: JointMuscleMap, arm: ArmKinematics) -> Trial:
    trial = Trial(nominal_map, arm)
    trial.rest(START)
    trial.rest(FIRST)
    assert trial.agent.faults == []
    assert trial.agent.vision.fired == 2
    return trial


def test_a_guard_that_finds_nothing_changes_no_bit(
    trial: Trial, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    alone = Trial(nominal_map, arm, guarded=False)
    alone.rest(START)
    alone.rest(FIRST)
    assert alone.agent.faults == []
    assert trial.agent.vision.fired == alone.agent.vision.fired == 2
    np.testing.assert_array_equal(trial.agent.joint_angles, alone.agent.joint_angles)
    for one, other in zip(trial.agent.map.groups, alone.agent.map.groups, strict=True):
        np.testing.assert_array_equal(one.W2, other.W2)


@pytest.mark.parametrize(
    ("spoilt", "kind"),
    [
        ({"lengths_off": one_muscle(np.nan)}, faults.ENCODER_DEAD),
        ({"lengths_off": one_muscle(0.03)}, faults.ENCODER_JUMP),
        ({"tensions": np.full(36, np.nan)}, faults.TENSION_SENSOR_DEAD),
    ],
)
def test_nothing_is_learned_while_a_fault_is_seen(
    spoilt: dict[str, Any], kind: str, trial: Trial
) -> None:
    learned = trial.agent.map
    trial.rest(SECOND, **spoilt)
    assert set(trial.kinds) == {kind}
    assert trial.agent.map is learned
    assert not trial.agent.at_rest
    trial.rest(SECOND, 80)
    assert trial.agent.faults == []
    assert trial.agent.vision.fired == 3
    assert trial.agent.map is not learned


@pytest.mark.parametrize(("learned", "named"), [(2, [faults.MARKER_HIDDEN]), (3, [])])
def test_a_marker_that_is_hidden_as_it_moves_is_named_where_enough_was_learned(
    learned: int, named: list[str], nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm, options=GuardOptions(learned=learned))
    trial.rest(START)
    trial.rest(FIRST)
    assert len(trial.agent.vision.memory.observations) == 2
    trial.hidden = True
    trial.rest(START, 60)
    assert trial.kinds == named


def test_a_marker_that_is_hidden_at_rest_is_named_before_anything_was_learned(trial: Trial) -> None:
    trial.rest(START)
    trial.hidden = True
    trial.rest(START, 60)
    assert trial.kinds == [faults.MARKER_HIDDEN]


def test_a_picture_that_stays_while_the_head_turns_is_of_a_frozen_camera(trial: Trial) -> None:
    trial.hidden = trial.frozen = True
    trial.rest(FIRST, 30)
    assert trial.kinds == []
    turned = FIRST.copy()
    turned[1] += 0.3
    trial.rest(turned, 30)
    assert trial.kinds == [faults.CAMERA_FROZEN]


def test_a_picture_that_stays_while_the_map_turns_the_estimated_head_is_no_fault(
    trial: Trial,
) -> None:
    trial.hidden = trial.frozen = True
    trial.rest(FIRST, 30)
    turned = FIRST.copy()
    turned[1] += 0.3
    agent = trial.agent
    neck = next(group for group in agent.map.groups if group.name == "neck")
    more = 1e3 * (agent.map.lengths(FIRST) - agent.map.lengths(turned))[neck.muscle_index]
    another = agent.map.with_output_layers({"neck": (neck.W2, neck.b2 + more)})
    before = agent.joint_angles[1]
    agent.recall(another, agent.antagonism.memory, agent.vision.memory)
    trial.rest(FIRST, 30)
    assert agent.joint_angles[1] - before > 0.2
    assert trial.kinds == []


def test_a_muscle_in_doubt_does_not_move_the_estimate(trial: Trial) -> None:
    before = trial.agent.joint_angles
    trial.rest(FIRST, 100, lengths_off=one_muscle(0.05))
    assert np.abs(trial.agent.joint_angles - before).max() < np.radians(1.0)
    trial.agent.estimator.doubt(np.zeros(36, dtype=bool))
    for _ in range(100):
        trial.agent.estimator.update(trial.measured, 0.02)
    assert np.abs(trial.agent.joint_angles - before).max() > np.radians(3.0)


def test_what_was_learned_just_before_a_fault_was_noticed_is_taken_back(trial: Trial) -> None:
    learned, observations = trial.agent.map, trial.agent.vision.pairs
    trial.rest(SECOND, 0)
    while trial.agent.vision.fired < 3:
        trial.step()
    assert trial.agent.map is not learned
    trial.step(lengths_off=one_muscle(0.03))
    assert trial.agent.taken_back == 1
    assert trial.agent.map is learned
    assert trial.agent.vision.pairs is observations


def test_what_was_learned_long_before_is_kept(trial: Trial) -> None:
    learned = trial.agent.map
    trial.rest(FIRST, 60)
    trial.step(lengths_off=one_muscle(0.03))
    assert trial.agent.taken_back == 0
    assert trial.agent.map is learned


def test_an_observation_of_two_markers_is_not_learned(trial: Trial) -> None:
    learned = trial.agent.map
    trial.twice = True
    trial.rest(SECOND)
    assert trial.kinds == [faults.SECOND_MARKER]
    assert trial.agent.map is learned


def test_no_command_demands_more_than_the_limit(trial: Trial) -> None:
    trial.agent.go(np.array([THIRD]), 0.1)  # the robot stays where it is: the muscles pull hard
    wanted = trial.agent.map.lengths(THIRD)
    assert MOTORS.demanded(trial.measured, wanted).max() > 1.5 * MOTORS.limit
    for _ in range(50):
        trial.step()
        assert MOTORS.demanded(trial.measured, trial.command).max() < MOTORS.limit + 1e-6
    trial.step(lengths_off=one_muscle(0.03))
    demanded = MOTORS.demanded(trial.measured, trial.command)
    assert demanded.max() < MOTORS.limit + 1e-6
    assert demanded[MUSCLE] == pytest.approx(MOTORS.bias)


def test_a_hand_that_holds_something_is_not_pushed(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(nominal_map, arm)
    guard = trial.agent.guard
    assert isinstance(guard, Guard)
    guard._gravity = lambda q: np.zeros(14)
    trial.rest(START)
    guard._disturbance.pushed = True
    trial.agent.hand_is_free = False
    trial.step()
    assert trial.agent.faults == []


@pytest.mark.parametrize("interrupted", [True, False])
def test_a_force_is_not_compared_with_one_of_long_ago(
    nominal_map: JointMuscleMap, arm: ArmKinematics, interrupted: bool
) -> None:
    """A muscle that was in doubt for a second and is believed again moves the estimate."""
    trial = Trial(
        nominal_map,
        arm,
        options=GuardOptions(learned=0, disturbance=DisturbanceMonitorOptions(factor=0.0)),
    )
    guard = trial.agent.guard
    assert isinstance(guard, Guard)
    trial.agent.learning = False
    guard._gravity = lambda q: np.zeros(14)
    trial.rest(START)
    trial.rest(START, 60, lengths_off=one_muscle(0.03 if interrupted else 0.0))
    assert trial.kinds == [faults.ENCODER_JUMP] * interrupted
    guard._gravity = lambda q: arm.frame_jacobian("grip", q)[:3].T @ [0.0, 0.0, 60.0]
    found = set()
    for _ in range(40):
        trial.step()
        found |= set(trial.kinds)
    assert (faults.PUSHED in found) is not interrupted


def test_a_push_is_found_while_a_muscle_that_is_out_of_use_reads_nonsense(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = Trial(
        nominal_map,
        arm,
        options=GuardOptions(learned=0, disturbance=DisturbanceMonitorOptions(factor=0.0)),
    )
    guard = trial.agent.guard
    assert isinstance(guard, Guard)
    trial.agent.learning = False
    guard._gravity = lambda q: np.zeros(14)
    trial.agent.leave_out(nominal_map.muscles[MUSCLE])
    trial.rest(START)
    trial.rest(START, 60, lengths_off=one_muscle(0.03))
    assert trial.kinds == [faults.MUSCLE_LEFT_OUT]
    guard._gravity = lambda q: arm.frame_jacobian("grip", q)[:3].T @ [0.0, 0.0, 60.0]
    found = set()
    for _ in range(40):
        trial.step(lengths_off=one_muscle(0.03))
        found |= set(trial.kinds)
    assert faults.PUSHED in found


def test_the_estimate_at_the_time_of_a_frame_lies_between_those_of_two_steps(trial: Trial) -> None:
    guard = trial.agent.guard
    assert isinstance(guard, Guard)
    guard._estimates.clear()
    guard._estimates.extend([(1.00, np.zeros(14)), (1.05, np.ones(14))])
    found = [guard._estimate_at(time) for time in (1.00, 1.02, 1.05, 1.07)]
    np.testing.assert_allclose(found, np.outer([0.0, 0.4, 1.0, 1.0], np.ones(14)), atol=1e-9)
    assert guard._estimate_at(0.99) is None


def test_a_new_episode_begins_without_faults(trial: Trial) -> None:
    trial.step(lengths_off=one_muscle(0.03))
    assert trial.agent.faults
    trial.agent.begin_episode()
    assert trial.agent.faults == []
    trial.steps = 0
    trial.rest(FIRST, 5)
    assert trial.agent.faults == []


def test_faults_are_plain_dictionaries_for_info(trial: Trial) -> None:
    trial.step(lengths_off=one_muscle(0.03))
    (fault,) = trial.agent.faults
    assert fault == Fault(faults.ENCODER_JUMP, trial.agent.map.muscles[MUSCLE], fault.since)
    assert faults_for_info([fault]) == [
        {"kind": "encoder_jump", "where": fault.where, "since": fault.since, "detail": ""}
    ]
    assert fault.since == pytest.approx(0.02 * (trial.steps - 1))


def test_lengths_of_which_none_is_a_number_are_refused(trial: Trial) -> None:
    with pytest.raises(AgentError, match="lengths must be"):
        trial.step(lengths_off=np.nan)
