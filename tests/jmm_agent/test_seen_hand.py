"""An agent that sees its hand without a marker: from the frame to the map, and what is dropped."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.agent_log import RecordedAgent
from jmm_agent.errors import AgentError
from jmm_agent.guard import faults
from jmm_agent.guard.guard import Guard, GuardOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.options import LearningOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.options import AgentOptions
from jmm_agent.updaters import VisionOptions
from jmm_agent.updaters.unexpected_poses import CONTRADICTED, UNEXPECTED
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.camera_clock import CameraClock
from jmm_agent.vision.hand_detection import HandDetection, HandSkip
from jmm_agent.vision.marker_observation import usual_noise
from jmm_agent.vision.pose_covariance import UNKNOWN
from tests.jmm_agent.moving_arm import MovingArm, MovingHand
from tests.jmm_agent.nominal_arm import posture_set

LEARNED = posture_set()[1:9]


def learned(agent: Agent) -> list[bytes]:
    layers = [layer for group in agent.map.groups for layer in group.layers]
    return [part.tobytes() for part in (*layers, agent.vision.memory.angles)]


@pytest.fixture
def trial(nominal_map: JointMuscleMap, arm: ArmKinematics) -> MovingArm:
    return MovingArm(nominal_map, arm, hand=MovingHand())


@pytest.fixture(scope="module")
def visited(nominal_map: JointMuscleMap, arm: ArmKinematics) -> MovingArm:
    """A trial after visits of `LEARNED`; tests go on with copies."""
    trial = MovingArm(nominal_map, arm, hand=MovingHand())
    trial.visit(*LEARNED)
    return trial


@pytest.fixture
def trained(visited: MovingArm) -> MovingArm:
    """A copy of a trial after visits of `LEARNED`."""
    return visited.copied()


def test_it_learns_about_as_well_as_from_a_marker(
    trained: MovingArm, nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    marked = MovingArm(nominal_map, arm)
    before = marked.error
    marked.visit(*LEARNED)
    for one in (trained, marked):
        assert one.agent.vision.fired == len(LEARNED)
    assert trained.error < 0.5 * before
    assert trained.error < 1.5 * marked.error + 0.3


def test_a_copy_of_the_arm_goes_on_as_the_arm_would(trial: MovingArm) -> None:
    other = trial.copied()
    for one in (trial, other):
        one.visit(LEARNED[0])
        assert one.agent.vision.fired == 1
    assert learned(other.agent) == learned(trial.agent)


def test_an_observation_has_the_frames_and_the_covariance_of_the_detection(
    trial: MovingArm,
) -> None:
    trial.visit(LEARNED[0])
    [found] = trial.agent.vision.memory.observations
    assert found.frames == ("hand", "eye")
    np.testing.assert_array_equal(found.covariance, MovingHand.COVARIANCE)
    hand = trial.agent.hand
    assert hand is not None
    np.testing.assert_array_equal(hand.pose, found.pose)
    assert trial.agent.markers == {}


class TwoHands(MovingHand):
    """Detector that sees the hand of a `MovingArm` and another robot's, which is still."""

    def hands(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> tuple[HandDetection, ...] | HandSkip:
        there = self.arm.kinematics.pose("hand", LEARNED[3], relative_to="thorax")
        there[:3, 3] += (0.05, 0.1, 0.05)
        other = self.arm.pose_in("thorax", frame_rgb) @ there  # which does not move in the world
        own = self.detect(frame_rgb, expected)
        assert isinstance(own, HandDetection)
        return HandDetection(other, self.COVARIANCE), own


@pytest.mark.parametrize("where", ["step", pytest.param("process", marks=pytest.mark.slow)])
def test_beside_another_hand_it_learns_from_its_own_one_that_it_knows_by_its_movements(
    nominal_map: JointMuscleMap, arm: ArmKinematics, where: Any
) -> None:
    trial = MovingArm(nominal_map, arm, hand=TwoHands(), learning=LearningOptions(where, 3))
    before = trial.error
    trial.visit(*posture_set()[1:13])
    trial.agent.finish_learning()
    why = f"the hand was not seen: {HandSkip.TWICE.value}"
    assert set(trial.agent.vision.dropped) == {why}
    assert trial.agent.vision.dropped[why] <= 5
    assert trial.agent.vision.fired >= 7
    assert trial.error < 0.5 * before
    trial.agent.close()


def test_observations_are_predicted_and_counted(trained: MovingArm) -> None:
    assert trained.agent.predictions.count == len(LEARNED)
    assert trained.agent.predictions.coverage >= 0.75


@pytest.mark.parametrize("skip", list(HandSkip))
def test_frames_without_a_pose_are_dropped_with_a_reason(trial: MovingArm, skip: HandSkip) -> None:
    trial.hand.skip = skip
    trial.visit(LEARNED[0])
    assert trial.agent.vision.fired == 0
    assert trial.agent.vision.dropped == {f"the hand was not seen: {skip.value}": 1}
    assert trial.agent.hand is None


def test_what_was_learned_survives_a_file(
    trial: MovingArm, nominal_map: JointMuscleMap, arm: ArmKinematics, tmp_path: Path
) -> None:
    trial.visit(*LEARNED[:3])
    trial.agent.save(tmp_path / "agent.npz")
    other = MovingArm(nominal_map, arm, hand=MovingHand())
    other.agent.load(tmp_path / "agent.npz")
    assert learned(other.agent) == learned(trial.agent)
    pairs = zip(
        other.agent.vision.memory.observations, trial.agent.vision.memory.observations, strict=True
    )
    for one, saved in pairs:
        assert one.frames == saved.frames
        np.testing.assert_array_equal(one.covariance, saved.covariance)


@pytest.mark.parametrize("where", ["step", pytest.param("process", marks=pytest.mark.slow)])
def test_beside_the_loop_a_log_repeats_the_run_to_the_bit(
    nominal_map: JointMuscleMap, arm: ArmKinematics, where: Any
) -> None:
    options = {"learning": LearningOptions(where, 3)}
    live = MovingArm(nominal_map, arm, hand=MovingHand(), **options)
    recorded: Any = RecordedAgent(live.agent)
    live.agent = recorded
    live.visit(*LEARNED[:2])
    recorded.finish_learning()
    again = MovingArm(nominal_map, arm, hand=MovingHand(), learning=LearningOptions("step", 3))
    again.path = live.path
    recorded.log.replay(again.agent)
    assert live.agent.vision.fired == 2
    assert learned(again.agent) == learned(live.agent)
    recorded.close()


def test_a_copy_continues_as_the_original(trial: MovingArm) -> None:
    trial.visit(LEARNED[0])
    assert learned(deepcopy(trial.agent)) == learned(trial.agent)


def test_frames_of_a_blurred_hand_are_not_learned(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    clock = CameraClock(exposure=0.1)
    trial = MovingArm(nominal_map, arm, hand=MovingHand(), camera_clock=clock)
    trial.visit(LEARNED[0])
    assert trial.agent.vision.fired == 1


def test_the_delay_of_the_camera_is_estimated_from_the_hand(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    clock = CameraClock(delay=None)
    trial = MovingArm(
        nominal_map, arm, interval=0.04, delay=0.1, stamped_late=True, hand=MovingHand(),
        camera_clock=clock,
    )  # fmt: skip
    trial.visit(*LEARNED[:4])
    found = trial.agent.camera_delay
    assert not found.reason
    assert found.delay == pytest.approx(0.1, abs=0.02)


OFF = np.array([0.06, -0.06, 0.05])
"""Error of a pose that is far off [m]."""


def test_a_pose_that_is_far_off_is_not_learned_once_the_robot_is_known(trained: MovingArm) -> None:
    trained.hand.off = OFF
    trained.visit(posture_set()[12])
    assert trained.agent.vision.fired == len(LEARNED)
    assert trained.agent.vision.dropped == {UNEXPECTED: 1}
    trained.hand.off = 0.0 * OFF
    trained.visit(posture_set()[13])
    assert trained.agent.vision.fired == len(LEARNED) + 1


def test_a_robot_that_has_changed_is_learned_from_the_second_time_on(trained: MovingArm) -> None:
    """Of a hand that is mounted elsewhere, one look is lost."""
    trained.hand.off = OFF
    trained.visit(*posture_set()[12:15])
    assert trained.agent.vision.fired >= len(LEARNED) + 2
    assert trained.agent.vision.dropped[UNEXPECTED] == 1


def test_a_pose_that_was_far_off_before_the_robot_was_known_is_forgotten(trial: MovingArm) -> None:
    trial.hand.off = OFF
    trial.visit(LEARNED[0])
    [wrong] = [found.pose for found in trial.agent.vision.memory.observations]
    trial.hand.off = 0.0 * OFF
    trial.visit(*LEARNED[1:])
    assert trial.agent.vision.dropped[CONTRADICTED] == 1
    left = [found.pose for found in trial.agent.vision.memory.observations]
    assert len(left) >= len(LEARNED) - 2
    assert not any(np.array_equal(pose, wrong) for pose in left)


def test_right_poses_are_neither_unexpected_nor_contradicted(trained: MovingArm) -> None:
    trained.visit(*posture_set()[9:15])
    assert trained.agent.vision.dropped == {}


def test_without_a_limit_all_poses_are_learned(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = MovingArm(nominal_map, arm, hand=MovingHand(), vision={"unexpected": 0.0})
    trial.visit(*LEARNED)
    trial.hand.off = OFF
    trial.visit(posture_set()[12])
    assert UNEXPECTED not in trial.agent.vision.dropped
    with pytest.raises(AgentError, match="unexpected is 1"):
        VisionOptions(unexpected=1.0)


def guarded(trial: MovingArm, **options: Any) -> None:
    camera = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)
    agent = trial.agent
    agent.guard = Guard(
        agent.map.muscles, trial.kinematics, camera, None, None, GuardOptions(**options)
    )


def test_a_guard_names_a_picture_of_the_hand_and_nothing_is_learned(trial: MovingArm) -> None:
    guarded(trial)
    trial.visit(*LEARNED[:2])
    assert trial.agent.faults == []
    trial.hand.fixed = trial.kinematics.pose("hand", trial.q, relative_to="eye")
    fired, here = trial.agent.vision.fired, trial.hand.fixed[:3, 3]

    def away(q: np.ndarray) -> float:
        there = trial.kinematics.pose("hand", q, relative_to="eye")[:3, 3]
        return float(np.linalg.norm(there - here))

    trial.visit(max(posture_set()[:60], key=away))
    assert [fault.kind for fault in trial.agent.faults] == [faults.OTHER_HAND]
    assert [fault.where for fault in trial.agent.faults] == ["hand"]
    assert trial.agent.vision.fired == fired


def test_a_guard_names_a_second_hand(trial: MovingArm) -> None:
    guarded(trial)
    trial.hand.skip = HandSkip.TWICE
    trial.visit(LEARNED[0])
    assert [fault.kind for fault in trial.agent.faults] == [faults.SECOND_HAND]


def test_a_frozen_camera_is_named(trial: MovingArm) -> None:
    guarded(trial)
    trial.visit(LEARNED[0])
    frozen = np.full((1, 1, 3), [3, 0, 9], dtype=np.uint8)
    start, fired = trial.q, trial.agent.vision.fired
    for k, share in enumerate(np.linspace(0.0, 1.0, 60)):
        stamp = 0.2 * (trial.time // 0.2) + 1e-6 * k
        trial.step(start + share * (LEARNED[1] - start), frame=frozen, frame_time=stamp)
    assert faults.CAMERA_FROZEN in [fault.kind for fault in trial.agent.faults]
    assert trial.agent.vision.fired == fired


def test_the_next_posture_is_one_that_shows_the_hand(trial: MovingArm) -> None:
    trial.visit(*LEARNED[:3])
    assert trial.agent.next_posture().in_view == 1.0
    trial.hand.seen = False
    assert trial.agent.next_posture().in_view == 0.0


def test_an_observation_is_expected_to_be_as_exact_as_those_before(trial: MovingArm) -> None:
    expected = np.sqrt([0.003**2 + 44e-6 / 3.0, 0.01**2 + 3e-4])
    before = trial.agent.posture_planner()._model.noise
    assert (before.position_noise, before.rotation_noise) == (0.003, 0.01)
    trial.visit(LEARNED[0])
    after = trial.agent.posture_planner()._model.noise
    np.testing.assert_allclose([after.position_noise, after.rotation_noise], expected)
    [found] = trial.agent.vision.memory.observations
    assert found.covariance is not None
    plain, unknown = found._replace(covariance=None), found.covariance.copy()
    unknown[3:, 3:] = UNKNOWN * np.eye(3)
    others = [plain, found._replace(covariance=unknown)]
    assert usual_noise(others, 0.003, 0.01) == pytest.approx((0.003, 0.01))


def make(nominal_map: JointMuscleMap, arm: ArmKinematics, hand: Any, **options: Any) -> Agent:
    rng = np.random.default_rng(0)
    chosen = AgentOptions(**options)
    start = posture_set()[0]
    return Agent(nominal_map, arm, None, posture_set(), start, rng, chosen, hand=hand)


def test_options_and_detectors_that_do_not_fit_are_refused(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    seen = VisionOptions(hand="seen")
    with pytest.raises(AgentError, match="needs a detector of the hand"):
        make(nominal_map, arm, None, vision=seen)
    with pytest.raises(AgentError, match="needs none of the hand"):
        make(nominal_map, arm, MovingHand())
    with pytest.raises(AgentError, match="needs a camera"):
        make(nominal_map, arm, MovingHand(), vision=seen, camera="")
    with pytest.raises(AgentError, match="'marker' or 'seen'"):
        VisionOptions(hand="touched")  # type: ignore[arg-type]
    assert make(nominal_map, arm, None, vision=seen, camera="").hand is None
