"""Poses of the hand that a tracker measures, in place of camera frames."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning_monitor import LearningMonitorOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from tests.jmm_agent.moving_arm import PERIOD, MovingArm
from tests.jmm_agent.nominal_arm import posture_set
from tests.jmm_agent.tracked_arm import MOCAP, TrackedArm

POSTURES = posture_set()[1:6]


def test_motion_capture_teaches_as_much_as_frames(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    seen = MovingArm(nominal_map, arm)
    tracked = TrackedArm(nominal_map, arm, sees=False)
    before = seen.error
    seen.visit(*POSTURES)
    tracked.visit(*POSTURES)
    assert tracked.agent.vision.fired == len(POSTURES)
    assert tracked.agent.faults == []
    assert tracked.agent.at_rest
    assert tracked.error < before / 2
    assert tracked.error < 1.1 * seen.error


def test_a_position_alone_is_learned_from(nominal_map: JointMuscleMap, arm: ArmKinematics) -> None:
    noise = np.array([1e-3, 1e-3, 1e-3, np.inf, np.inf, np.inf])

    def without_rotation(time: float, pose: np.ndarray) -> np.ndarray:
        return np.block([[np.eye(3), pose[:3, 3:]], [np.zeros((1, 3)), np.ones((1, 1))]])

    tracked = TrackedArm(nominal_map, arm, sees=False, noise=noise, disturb=without_rotation)
    before = tracked.error
    tracked.visit(*POSTURES[:4])
    assert tracked.agent.vision.fired == 4
    assert tracked.error < before / 1.5


def test_a_pose_is_learned_from_in_the_frame_in_which_it_is_given(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    tracked = TrackedArm(
        nominal_map, arm, sees=False, tracked="marker_hand", relative_to="eye", noise=MOCAP / 5
    )
    seen = MovingArm(nominal_map, arm)
    tracked.visit(*POSTURES[:2])
    seen.visit(*POSTURES[:2])
    q = posture_set()[20]
    one, other = tracked.agent.map.lengths(q), seen.agent.map.lengths(q)
    np.testing.assert_allclose(one, other, atol=1e-3)


def test_only_poses_of_a_rest_are_learned_from(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    tracked = TrackedArm(nominal_map, arm, sees=False)
    start = tracked.q
    for share in np.linspace(0.0, 1.0, 100):
        tracked.step(start + share * (POSTURES[3] - start))
    assert tracked.agent.vision.fired == 0
    dropped = tracked.agent.vision.dropped
    assert dropped["the hand was not at rest when its pose was measured"] > 50


def test_a_pose_that_is_300_ms_late_is_paired_with_the_lengths_of_its_time(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    """The rest is over when the pose arrives that was measured in it."""
    tracked = MovingArm(nominal_map, arm, sees=False)
    for _ in range(50):
        tracked.step(POSTURES[0])
    time, pose = tracked.time, arm.pose("hand", POSTURES[0])
    for share in np.linspace(0.0, 1.0, 15):
        tracked.step(POSTURES[0] + share * (POSTURES[1] - POSTURES[0]))
    tracked.agent.observe(pose, np.diag(MOCAP**2), time, "hand")
    tracked.step(POSTURES[1])
    assert tracked.agent.vision.fired == 1
    observation = tracked.agent.vision.memory.observations[0]
    np.testing.assert_allclose(observation.lengths, tracked.lengths(POSTURES[0]), atol=5e-4)


def test_each_rest_is_learned_from_once_and_wrong_poses_are_not(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    def jump(time: float, pose: np.ndarray) -> np.ndarray:
        pose[2, 3] += 2.0 * (time > 2.0)
        return pose

    tracked = TrackedArm(nominal_map, arm, sees=False, disturb=jump, learn_antagonism=False)
    tracked.visit(POSTURES[0])
    assert tracked.agent.vision.fired == 1
    assert tracked.agent.vision.dropped["the hand's pose was measured again in the same rest"] > 10
    learned = tracked.agent.map
    tracked.visit(POSTURES[1])
    assert tracked.agent.map is learned
    assert tracked.agent.vision.dropped["inverse kinematics did not converge"] == 1


@pytest.mark.parametrize(
    ("noise", "sentence"),
    [
        (MOCAP, r"converge \(2\); the last pose is \d{3} m and \d+ deg from the fitted posture's"),
        pytest.param(
            np.append(MOCAP[:3], np.full(3, np.inf)),
            r"is \d{3} m from the fitted posture's",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_poses_in_millimetres_are_named_with_their_distance(
    nominal_map: JointMuscleMap, arm: ArmKinematics, noise: np.ndarray, sentence: str
) -> None:
    def in_millimetres(time: float, pose: np.ndarray) -> np.ndarray:
        pose[:3, 3] *= 1000.0
        return pose

    tracked = TrackedArm(
        nominal_map,
        arm,
        sees=False,
        noise=noise,
        disturb=in_millimetres,
        learn_antagonism=False,
        learning_monitor=LearningMonitorOptions(observations=4),  # with two early ones
    )
    tracked.visit(*POSTURES[:2])
    assert tracked.agent.vision.dropped["inverse kinematics did not converge"] == 2
    [fault] = tracked.agent.faults
    assert fault.kind == "nothing_learned"
    assert re.search(sentence, fault.detail)
    assert "unit" in fault.detail


def test_the_world_may_be_named(nominal_map: JointMuscleMap, arm: ArmKinematics) -> None:
    tracked = TrackedArm(nominal_map, arm, sees=False, relative_to="world")
    tracked.visit(POSTURES[0])
    assert tracked.agent.vision.fired == 1
    assert tracked.agent.vision.memory.observations[0].frames == ("hand", None)


def test_a_stalled_tracker_is_not_waited_for_but_named(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    arm_without = MovingArm(nominal_map, arm, sees=False)
    arm_without.visit(POSTURES[0])
    assert arm_without.agent.at_rest  # no tracker is awaited
    moved = arm_without.kinematics.pose("hand", arm_without.q)
    arm_without.agent.observe(moved, np.diag(MOCAP**2), arm_without.time - 1.9, "hand")
    arm_without.visit(POSTURES[1], POSTURES[2])
    assert arm_without.agent.at_rest
    assert arm_without.agent.faults == []
    for _ in range(300):
        arm_without.step(arm_without.q)
    [fault] = arm_without.agent.faults
    assert fault.kind == "no_frame"
    assert fault.detail == "no pose of the hand was measured in this rest"


def test_while_nothing_is_learned_poses_are_evaluated_only(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    tracked = TrackedArm(nominal_map, arm, sees=False)
    tracked.agent.learning = False
    tracked.visit(POSTURES[0])
    assert tracked.agent.map is nominal_map
    assert tracked.agent.vision.dropped == {}
    assert tracked.agent.seen is not None
    np.testing.assert_allclose(
        arm.pose("hand", tracked.agent.seen.angles)[:3, 3],
        arm.pose("hand", POSTURES[0])[:3, 3],
        atol=0.005,
    )


def test_an_agent_without_a_camera_needs_no_frame_of_it(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    tracked = TrackedArm(nominal_map, arm, sees=False, camera="", marker_site="hand")
    tracked.visit(POSTURES[0])
    assert tracked.agent.vision.fired == 1
    tracked.agent.observe(arm.pose("hand", tracked.q), np.eye(6), tracked.time)
    for options in ({"camera": "none"}, {"marker_site": "none"}):
        with pytest.raises(AgentError, match="unknown frame 'none'"):
            MovingArm(nominal_map, arm, sees=False, **options)
    with pytest.raises(AgentError, match="a detector needs a camera"):
        MovingArm(nominal_map, arm, camera="")


GOOD = np.eye(4)
SKEW = np.diag(np.ones(6)) + np.eye(6, k=1)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"pose": np.eye(3)}, r"pose of a measured pose must be of shape \(4, 4\)"),
        ({"pose": np.diag([1.0, 1.0, -1.0, 1.0])}, "homogeneous matrix"),
        ({"pose": 2.0 * np.eye(4)}, "homogeneous matrix"),
        ({"pose": np.full((4, 4), np.nan)}, "must be finite"),
        ({"pose": "here"}, "must be numbers"),
        ({"covariance": np.eye(3)}, r"covariance of a measured pose must be of shape \(6, 6\)"),
        ({"covariance": -np.eye(6)}, "positive definite"),
        ({"covariance": np.zeros((6, 6))}, "positive definite"),
        ({"covariance": np.ones((6, 6))}, "positive definite"),
        ({"covariance": 1e-300 * np.eye(6)}, "at least 1e-16"),
        ({"covariance": SKEW}, "symmetric"),
        ({"time": None}, "time of a measured pose must be finite"),
        ({"time": "soon"}, "time of a measured pose must be numbers"),
        ({"time": [0.1, 0.2]}, "time of a measured pose must be of shape"),
        ({"covariance": np.full((6, 6), np.nan)}, "NaN on its diagonal"),
        ({"covariance": np.diag([1, 1, 1, 1, 1, np.inf])}, "or for none of them"),
        ({"covariance": np.diag(np.full(6, np.inf))}, "nothing was measured"),
        ({"time": np.nan}, "time of a measured pose must be finite"),
        ({"time": 9.0}, "in the future"),
        ({"frame": "nose"}, "unknown frame 'nose'"),
        ({"relative_to": "nose"}, "unknown frame 'nose'"),
        ({"frame": "eye", "relative_to": "eye"}, "No joint moves 'eye' against 'eye'"),
    ],
)
def test_what_cannot_be_a_measured_pose_is_refused_in_a_sentence(
    nominal_map: JointMuscleMap, arm: ArmKinematics, wrong: dict[str, Any], sentence: str
) -> None:
    tracked = MovingArm(nominal_map, arm, sees=False)
    tracked.step(tracked.q)
    given = {"pose": GOOD, "covariance": np.eye(6), "time": tracked.time}
    with pytest.raises(AgentError, match=sentence):
        tracked.agent.observe(**(given | wrong))
    tracked.agent.observe(**given)


def test_poses_from_before_the_first_readings_or_long_ago_are_counted(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    tracked = MovingArm(nominal_map, arm, sees=False)
    tracked.agent.observe(GOOD, np.eye(6), 1e9)
    for _ in range(round(5.0 / PERIOD)):
        tracked.step(tracked.q)
    tracked.agent.observe(GOOD, np.eye(6), 0.5)
    tracked.step(tracked.q)
    assert tracked.agent.vision.dropped == {
        "the hand's pose was measured before the first sensor readings": 1,
        "the hand's pose arrived more than 2 s late": 1,
    }


def test_with_a_camera_and_a_tracker_each_rest_is_learned_from_once(
    nominal_map: JointMuscleMap, arm: ArmKinematics, tmp_path: Path
) -> None:
    both = TrackedArm(nominal_map, arm, interval=0.06)
    both.visit(*POSTURES[:2])
    assert both.agent.vision.fired == 2
    both.agent.save(tmp_path / "memory.npz")
    other = TrackedArm(nominal_map, arm)
    other.agent.load(tmp_path / "memory.npz")
    for one, two in zip(
        *(trial.agent.vision.memory.observations for trial in (both, other)), strict=True
    ):
        assert one.frames == two.frames
        np.testing.assert_array_equal(one.pose, two.pose)
        if one.covariance is None:
            assert two.covariance is None
        else:
            np.testing.assert_array_equal(one.covariance, two.covariance)
