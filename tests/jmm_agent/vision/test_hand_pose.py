"""The clock of measured poses over changes of the map and episodes."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.vision.hand_pose import ArmSample, HandPoses
from tests.jmm_agent.nominal_arm import posture_set

POSTURES = posture_set()[:6]


def posture(time: float) -> np.ndarray:
    """Joint angles (14,) [rad] of a hand that moves for 1 s and rests for 1 s, again and again."""
    number, since = divmod(max(time, 0.0), 2.0)
    share = min(since, 1.0)
    start, end = (POSTURES[int(number + k) % len(POSTURES)] for k in (0, 1))
    return np.asarray(start + share**2 * (3.0 - 2.0 * share) * (end - start))


def follow(
    poses: HandPoses,
    arm: ArmKinematics,
    late: float = 0.5,
    movements: range = range(4),
    map_changes: bool = False,
) -> None:
    """Movements of a hand whose poses are stamped too late [s]."""
    none = np.zeros(36)
    for step in range(100 * movements.start, 100 * movements.stop):
        time = 0.02 * step
        poses.record(ArmSample(time, np.inf, posture(time), none, none, none, None))
        if step % 5 == 0:
            pose = arm.pose("hand", posture(time - late))
            poses.add(pose, 1e-6 * np.eye(6), time, ("hand", None))
        if step % 100 == 85:
            if map_changes:
                poses.map_changed()
            poses.end_movement()


@pytest.mark.parametrize("map_changes", [False, True])
def test_movements_are_not_compared_over_a_change_of_the_map(
    arm: ArmKinematics, map_changes: bool
) -> None:
    poses = HandPoses(arm, 0.4, 0.003)
    follow(poses, arm, map_changes=map_changes)
    assert ("s too late" in poses.clock_problem) is not map_changes


@pytest.mark.parametrize(("first", "then"), [(0.5, 0.0), (0.0, 0.5)])
def test_a_clock_that_is_set_right_or_wrong_is_judged_by_the_newest_movements(
    arm: ArmKinematics, first: float, then: float
) -> None:
    poses = HandPoses(arm, 0.4, 0.003)
    follow(poses, arm, first, range(8))
    assert bool(poses.clock_problem) is (first != 0.0)
    follow(poses, arm, then, range(8, 21))
    assert bool(poses.clock_problem) is (then != 0.0)


def test_a_new_episode_ends_what_was_found_about_the_clock(arm: ArmKinematics) -> None:
    poses = HandPoses(arm, 0.4, 0.003)
    follow(poses, arm)
    poses.reset()
    assert poses.clock_problem == ""
    poses.end_movement()
    assert poses.clock_problem == ""
