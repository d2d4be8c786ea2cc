"""A guarded agent on made-up senses: faults are named and nothing is learned from them.

The robot is the drawing but for lengths that were zeroed at another posture; its encoders are
noisy, its tensions are what its motors make of the last command, and its eyes are exact.
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
from kengoro.trained_maps import trained_map
from kengoro_env.assets import asset_path
from kengoro_env.names import JOINTS
from kengoro_env.postures import posture_set

START, FIRST, SECOND, THIRD = posture_set()[:4]
MISTAKE = np.radians([1, -1, 1, 4, -4, 3, 4, -8, 7, 8, -7, 3, -3, 2])
MOTORS = MotorControl()
MUSCLE = 14


@pytest.fixture(scope="module")
def drawn(request: pytest.FixtureRequest) -> JointMuscleMap:
    return trained_map(request.config.cache.mkdir("maps"))


@pytest.fixture(scope="module")
def arm() -> ArmKinematics:
    return ArmKinematics(asset_path("mjcf/kengoro_arm/arm.xml"), JOINTS)


class Life:
    """An agent and a robot that is wherever a test puts it; it is also the agent's eyes."""

    def __init__(
        self,
        drawn: JointMuscleMap,
        arm: ArmKinematics,
        guarded: bool = True,
        options: GuardOptions | None = None,
    ) -> None:
        self._drawn, self._arm, self.hidden, self.frozen = drawn, arm, False, False
        guard = Guard(drawn.muscles, arm, Camera(640, 480, 580.0), None, MOTORS, options)
        self.agent = Agent(
            drawn, arm, self, posture_set(), START, np.random.default_rng(0),
            guard=guard if guarded else None,
        )  # fmt: skip
        self.rng, self.steps, self.q, self.twice = np.random.default_rng(1), 0, START, False
        self.command = drawn.lengths(START)
        self.agent.begin_episode()

    def detect(self, frame_rgb: np.ndarray, expected: object = None) -> Detections:
        if self.twice or self.hidden:
            return Detections({}, {0: Skip.TWICE if self.twice else Skip.NOT_SEEN}, ())
        pose = self._arm.pose("marker_hand", self.q, relative_to="eye")
        marker = MarkerPose(0, pose, np.zeros((4, 2)), 0.0, pose, 9.0)
        return Detections({0: marker}, {}, ())

    def step(self, lengths_off: Any = 0.0, tensions: Any = None) -> np.ndarray:
        time = 0.02 * self.steps
        true = self._drawn.lengths(self.q) - self._drawn.lengths(MISTAKE)
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
        self.felt = readings.lengths
        self.command = self.agent.step(readings)
        return self.command

    def rest(self, q: np.ndarray, steps: int = 60, **more: Any) -> None:
        """Go to a posture, and be there for a while."""
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
def life(drawn: JointMuscleMap, arm: ArmKinematics) -> Life:
    life = Life(drawn, arm)
    life.rest(START)
    life.rest(FIRST)
    assert life.agent.faults == []
    assert life.agent.vision.fired == 2
    return life


def test_a_guard_that_finds_nothing_changes_no_bit(
    life: Life, drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    alone = Life(drawn, arm, guarded=False)
    alone.rest(START)
    alone.rest(FIRST)
    assert alone.agent.faults == []
    assert life.agent.vision.fired == alone.agent.vision.fired == 2
    np.testing.assert_array_equal(life.agent.joint_angles, alone.agent.joint_angles)
    for one, other in zip(life.agent.map.groups, alone.agent.map.groups, strict=True):
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
    spoilt: dict[str, Any], kind: str, life: Life
) -> None:
    learned = life.agent.map
    life.rest(SECOND, **spoilt)
    assert set(life.kinds) == {kind}
    assert life.agent.map is learned
    assert not life.agent.at_rest
    life.rest(SECOND, 80)
    assert life.agent.faults == []
    assert life.agent.vision.fired == 3
    assert life.agent.map is not learned


@pytest.mark.parametrize(("learned", "named"), [(2, [faults.MARKER_HIDDEN]), (3, [])])
def test_a_marker_that_is_hidden_as_it_moves_is_named_where_enough_was_learned(
    learned: int, named: list[str], drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm, options=GuardOptions(learned=learned))
    life.rest(START)
    life.rest(FIRST)
    assert len(life.agent.vision.memory.observations) == 2
    life.hidden = True
    life.rest(START, 60)
    assert life.kinds == named


def test_a_marker_that_is_hidden_at_rest_is_named_before_anything_was_learned(life: Life) -> None:
    life.rest(START)
    life.hidden = True
    life.rest(START, 60)
    assert life.kinds == [faults.MARKER_HIDDEN]


def test_a_picture_that_stays_while_the_head_turns_is_of_a_frozen_camera(life: Life) -> None:
    life.hidden = life.frozen = True
    life.rest(FIRST, 30)
    assert life.kinds == []
    turned = FIRST.copy()
    turned[1] += 0.3
    life.rest(turned, 30)
    assert life.kinds == [faults.CAMERA_FROZEN]


def test_a_picture_that_stays_while_the_map_changes_its_mind_about_the_head_is_no_fault(
    life: Life,
) -> None:
    life.hidden = life.frozen = True
    life.rest(FIRST, 30)
    turned = FIRST.copy()
    turned[1] += 0.3
    agent = life.agent
    neck = next(group for group in agent.map.groups if group.name == "neck")
    more = 1e3 * (agent.map.lengths(FIRST) - agent.map.lengths(turned))[neck.muscle_index]
    another = agent.map.with_output_layers({"neck": (neck.W2, neck.b2 + more)})
    before = agent.joint_angles[1]
    agent.recall(another, agent.antagonism.memory, agent.vision.memory)
    life.rest(FIRST, 30)
    assert agent.joint_angles[1] - before > 0.2
    assert life.kinds == []


def test_a_doubted_wire_does_not_move_the_estimate(life: Life) -> None:
    before = life.agent.joint_angles
    life.rest(FIRST, 100, lengths_off=one_muscle(0.05))
    assert np.abs(life.agent.joint_angles - before).max() < np.radians(1.0)
    life.agent.estimator.doubt(np.zeros(36, dtype=bool))
    for _ in range(100):
        life.agent.estimator.update(life.felt, 0.02)
    assert np.abs(life.agent.joint_angles - before).max() > np.radians(3.0)


def test_what_was_learned_just_before_a_fault_was_noticed_is_taken_back(life: Life) -> None:
    learned, observations = life.agent.map, life.agent.vision.pairs
    life.rest(SECOND, 0)
    while life.agent.vision.fired < 3:
        life.step()
    assert life.agent.map is not learned
    life.step(lengths_off=one_muscle(0.03))
    assert life.agent.taken_back == 1
    assert life.agent.map is learned
    assert life.agent.vision.pairs is observations


def test_what_was_learned_long_before_is_kept(life: Life) -> None:
    learned = life.agent.map
    life.rest(FIRST, 60)
    life.step(lengths_off=one_muscle(0.03))
    assert life.agent.taken_back == 0
    assert life.agent.map is learned


def test_a_look_at_two_markers_is_not_learned(life: Life) -> None:
    learned = life.agent.map
    life.twice = True
    life.rest(SECOND)
    assert life.kinds == [faults.SECOND_MARKER]
    assert life.agent.map is learned


def test_no_command_demands_more_than_the_limit(life: Life) -> None:
    life.agent.go(np.array([THIRD]), 0.1)  # the robot stays where it is: the wires pull hard
    wanted = life.agent.map.lengths(THIRD)
    assert MOTORS.demanded(life.felt, wanted).max() > 1.5 * MOTORS.limit
    for _ in range(50):
        life.step()
        assert MOTORS.demanded(life.felt, life.command).max() < MOTORS.limit + 1e-6
    life.step(lengths_off=one_muscle(0.03))
    demanded = MOTORS.demanded(life.felt, life.command)
    assert demanded.max() < MOTORS.limit + 1e-6
    assert demanded[MUSCLE] == pytest.approx(MOTORS.bias)


def test_a_hand_that_holds_something_is_not_pushed(
    drawn: JointMuscleMap, arm: ArmKinematics
) -> None:
    life = Life(drawn, arm)
    guard = life.agent.guard
    assert guard is not None
    guard._gravity = lambda q: np.zeros(14)
    life.rest(START)
    guard._push.pushed = True
    life.agent.hand_is_free = False
    life.step()
    assert life.agent.faults == []


@pytest.mark.parametrize("interrupted", [True, False])
def test_a_force_is_not_compared_with_one_of_long_ago(
    drawn: JointMuscleMap, arm: ArmKinematics, interrupted: bool
) -> None:
    """A wire that was doubted for a second and is believed again moves the arm."""
    life = Life(
        drawn, arm, options=GuardOptions(learned=0, push=DisturbanceMonitorOptions(factor=0.0))
    )
    guard = life.agent.guard
    assert guard is not None
    guard._gravity = lambda q: np.zeros(14)
    life.rest(START)
    life.rest(START, 60, lengths_off=one_muscle(0.03 if interrupted else 0.0))
    assert life.kinds == [faults.ENCODER_JUMP] * interrupted
    guard._gravity = lambda q: arm.frame_jacobian("grip", q)[:3].T @ [0.0, 0.0, 60.0]
    found = set()
    for _ in range(40):
        life.step()
        found |= set(life.kinds)
    assert (faults.PUSHED in found) is not interrupted


def test_a_new_episode_begins_without_faults(life: Life) -> None:
    life.step(lengths_off=one_muscle(0.03))
    assert life.agent.faults
    life.agent.begin_episode()
    assert life.agent.faults == []
    life.steps = 0
    life.rest(FIRST, 5)
    assert life.agent.faults == []


def test_faults_are_said_in_plain_words_for_info(life: Life) -> None:
    life.step(lengths_off=one_muscle(0.03))
    (fault,) = life.agent.faults
    assert fault == Fault(faults.ENCODER_JUMP, life.agent.map.muscles[MUSCLE], fault.since)
    assert faults_for_info([fault]) == [
        {"kind": "encoder_jump", "where": fault.where, "since": fault.since}
    ]
    assert fault.since == pytest.approx(0.02 * (life.steps - 1))


def test_lengths_of_which_none_is_a_number_are_refused(life: Life) -> None:
    with pytest.raises(AgentError, match="lengths must be"):
        life.step(lengths_off=np.nan)
