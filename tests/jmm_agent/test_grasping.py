"""Plans of grasps: the grip point reaches the can, and an unreachable can is reported."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.grasping import GraspOptions, GraspPlan, GraspPlanner
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from tests.jmm_agent.nominal_arm import GROUPS

OPTIONS = GraspOptions()
Q = np.radians([-15, 10, 0, -8, 0, -3, 0, 5, -32, -50, 95, 0, 0, 0])
CANS = [(0.40, -0.15), (0.45, -0.10), (0.38, -0.22)]
TOP = -0.265


def can(x: float, y: float, z: float = TOP, turn: float = 0.7) -> np.ndarray:
    """Pose (4, 4) of the marker on top of a can, which may be turned about its axis."""
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    pose[:3, 3] = x, y, z
    return pose


@pytest.fixture(scope="module")
def planner(arm: ArmKinematics) -> GraspPlanner:
    return GraspPlanner(arm, "eye", GROUPS["neck"])


@pytest.fixture(scope="module")
def plans(planner: GraspPlanner) -> list[tuple[np.ndarray, GraspPlan]]:
    return [(can(*xy), planner.plan(can(*xy), Q)) for xy in CANS]


def grip(arm: ArmKinematics, q: np.ndarray) -> np.ndarray:
    return arm.pose("grip", q)


def test_the_grip_point_comes_to_the_cans_axis_below_its_top(
    arm: ArmKinematics, plans: list[tuple[np.ndarray, GraspPlan]]
) -> None:
    for pose, plan in plans:
        assert plan.reachable
        wanted = pose[:3, 3] - [0.0, 0.0, OPTIONS.grip_depth]
        np.testing.assert_allclose(plan.grip, wanted, atol=1e-12)
        for q in (plan.approach[-1], plan.lift[0]):
            assert np.linalg.norm(grip(arm, q)[:3, 3] - wanted) < 0.005
        assert plan.worst < 0.005


def test_the_hand_comes_straight_and_level_from_the_standoff(
    arm: ArmKinematics, plans: list[tuple[np.ndarray, GraspPlan]]
) -> None:
    for _, plan in plans:
        points = np.array([grip(arm, q)[:3, 3] for q in plan.approach])
        away = np.linalg.norm(points - plan.grip, axis=1)
        wanted = OPTIONS.standoff * np.linspace(1.0, 0.0, OPTIONS.points)
        np.testing.assert_allclose(away, wanted, atol=0.006)
        thumb = [grip(arm, q)[:3, 0] for q in plan.approach]
        assert min(axis[2] for axis in thumb) > 0.9
        # The hand moves along its own direction of approach, its open side first.
        turned = grip(arm, plan.approach[-1])[:3, :3]
        moved = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
        direction = turned @ OPTIONS.approach / np.linalg.norm(OPTIONS.approach)
        assert moved @ direction > 0.9


def test_the_lift_goes_straight_up(
    arm: ArmKinematics, plans: list[tuple[np.ndarray, GraspPlan]]
) -> None:
    for _, plan in plans:
        points = np.array([grip(arm, q)[:3, 3] for q in plan.lift])
        rise = OPTIONS.lift * np.linspace(0.0, 1.0, OPTIONS.points)
        np.testing.assert_allclose(points[:, 2] - plan.grip[2], rise, atol=0.006)
        assert np.abs(points[:, :2] - plan.grip[:2]).max() < 0.006


def test_limits_are_kept_and_the_camera_points_at_the_can(
    arm: ArmKinematics, plans: list[tuple[np.ndarray, GraspPlan]]
) -> None:
    low, high = arm.limits.T
    for _, plan in plans:
        for q in (*plan.approach, *plan.lift):
            assert np.all((q >= low - 1e-9) & (q <= high + 1e-9))
        eye = arm.pose("eye", plan.approach[0])
        towards = plan.grip - eye[:3, 3]
        assert eye[:3, 2] @ towards / np.linalg.norm(towards) > np.cos(np.radians(2.0))


def test_how_the_can_is_turned_does_not_matter(planner: GraspPlanner) -> None:
    one, other = (planner.plan(can(*CANS[0], turn=turn), Q) for turn in (0.0, 2.0))
    np.testing.assert_array_equal(one.approach, other.approach)


@pytest.mark.parametrize("position", [(1.5, -0.2, TOP), (0.4, 0.9, TOP), (0.4, -0.15, 1.5)])
def test_a_can_out_of_reach_is_reported(
    position: tuple[float, float, float], planner: GraspPlanner, arm: ArmKinematics
) -> None:
    plan = planner.plan(can(*position), Q)
    assert not plan.reachable
    missed = np.linalg.norm(grip(arm, plan.approach[-1])[:3, 3] - plan.grip)
    assert plan.worst >= missed - 1e-9
    assert missed > 0.05
    for array in (plan.approach, plan.lift):
        assert np.isfinite(array).all()


def test_a_marker_seen_by_the_camera_is_found_in_the_world(
    planner: GraspPlanner, arm: ArmKinematics
) -> None:
    pose = can(*CANS[0])
    in_camera = np.linalg.inv(arm.pose("eye", Q)) @ pose
    np.testing.assert_allclose(planner.marker_in_world(in_camera, Q), pose, atol=1e-12)


def test_pointing_the_camera_moves_the_neck_alone(planner: GraspPlanner) -> None:
    turned = planner.point_camera(np.array([0.4, -0.1, -0.3]), Q)
    np.testing.assert_array_equal(turned[2:], Q[2:])
    assert np.abs(turned[:2] - Q[:2]).max() > 0.01


def test_hovering_keeps_the_grip_point_off_the_can(
    planner: GraspPlanner, arm: ArmKinematics
) -> None:
    offset = np.array([-0.05, -0.05, 0.16])
    q = planner.hover(can(*CANS[0]), offset, Q)
    wanted = can(*CANS[0])[:3, 3] - [0, 0, OPTIONS.grip_depth] + offset
    np.testing.assert_allclose(grip(arm, q)[:3, 3], wanted, atol=0.01)


def test_an_unknown_joint_at_rest_is_named(arm: ArmKinematics) -> None:
    with pytest.raises(AgentError, match="knee"):
        GraspPlanner(arm, "eye", GROUPS["neck"], GraspOptions(rest=(("knee", 0.1),)))
