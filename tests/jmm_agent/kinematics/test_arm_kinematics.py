"""Jacobians against finite differences; inverse kinematics converges and keeps limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics, IkOptions, KinematicsError
from tests.jmm_agent.nominal_arm import ARM, GROUPS, JOINTS

NECK = GROUPS["neck"]
MARKER, EYE = "marker_hand", "eye"


def postures(arm: ArmKinematics, count: int, seed: int = 0, inside: float = 1.0) -> np.ndarray:
    middle, half = arm.limits.mean(axis=1), 0.5 * np.ptp(arm.limits, axis=1)
    return middle + inside * half * np.random.default_rng(seed).uniform(-1, 1, (count, 14))


def kept(arm: ArmKinematics, q: np.ndarray) -> bool:
    return bool(np.all((q >= arm.limits[:, 0] - 1e-12) & (q <= arm.limits[:, 1] + 1e-12)))


def twist(pose: np.ndarray, other: np.ndarray) -> np.ndarray:
    return pin.log6(pin.SE3(pose).actInv(pin.SE3(other))).vector


@pytest.mark.parametrize("relative_to", [None, EYE, "scapula"])
def test_frame_jacobian_is_the_derivative_of_the_pose(
    arm: ArmKinematics, relative_to: str | None
) -> None:
    for q in postures(arm, 5):
        for frame in (MARKER, EYE, "clavicle"):
            if frame == relative_to:
                continue
            numeric = [
                twist(
                    arm.pose(frame, q - 1e-6 * axis, relative_to),
                    arm.pose(frame, q + 1e-6 * axis, relative_to),
                )
                / 2e-6
                for axis in np.eye(14)
            ]
            analytic = arm.frame_jacobian(frame, q, relative_to)
            assert np.abs(analytic - np.transpose(numeric)).max() < 1e-8


def test_the_order_of_joints_is_the_users(arm: ArmKinematics) -> None:
    mixed = ArmKinematics(ARM, JOINTS[::-1])
    q = postures(arm, 1)[0]
    assert np.array_equal(mixed.limits, arm.limits[::-1])
    assert np.allclose(mixed.pose(MARKER, q[::-1], EYE), arm.pose(MARKER, q, EYE), atol=1e-14)
    expected = arm.frame_jacobian(MARKER, q, EYE)[:, ::-1]
    assert np.allclose(mixed.frame_jacobian(MARKER, q[::-1], EYE), expected, atol=1e-14)
    target = arm.pose(MARKER, q + 0.05, EYE)
    there, here = mixed.solve(MARKER, target, q[::-1], EYE), arm.solve(MARKER, target, q, EYE)
    assert there.converged
    assert np.allclose(there.q[::-1], here.q, atol=1e-6)


def test_a_seen_pose_is_explained_from_an_estimate_that_is_12_degrees_off(
    arm: ArmKinematics,
) -> None:
    random = np.random.default_rng(1)
    low, high = arm.limits.T
    for truth in postures(arm, 100, seed=1, inside=0.9):
        estimate = np.clip(truth + np.deg2rad(12) * random.normal(size=14), low, high)
        target = arm.pose(MARKER, truth, EYE)
        result = arm.solve(MARKER, target, estimate, relative_to=EYE)
        assert result.converged, result.reason
        assert result.reason == "Reached."
        assert kept(arm, result.q)
        assert np.abs(twist(target, arm.pose(MARKER, result.q, EYE))).max() < 1e-6
        assert result.position_error < 1e-6


def test_reachable_poses_are_reached_from_the_hanging_arm(arm: ArmKinematics) -> None:
    start = np.zeros(14)
    reached = 0
    for truth in postures(arm, 50, seed=2):
        target = arm.pose("grip", truth)
        result = arm.solve("grip", target, start, options=IkOptions(restarts=5))
        reached += result.converged
        assert kept(arm, result.q)
        assert result.converged == (np.abs(twist(target, arm.pose("grip", result.q))).max() < 1e-4)
    assert reached >= 48


def test_an_unreachable_pose_is_reported(arm: ArmKinematics) -> None:
    target = arm.pose("grip", np.zeros(14))
    target[:3, 3] = (2.0, 0.0, 0.5)
    result = arm.solve("grip", target, np.zeros(14), weights=(1, 1, 1, 0, 0, 0),
                       options=IkOptions(max_iterations=1000))  # fmt: skip
    assert not result.converged
    assert kept(arm, result.q)
    assert "Out of reach" in result.reason
    assert "elbow" not in result.reason or abs(result.q[10]) < 1e-6
    distance = np.linalg.norm(arm.pose("grip", result.q)[:3, 3] - target[:3, 3])
    assert result.position_error == pytest.approx(distance, rel=1e-9)
    assert distance < 1.7  # 2.1 m from the shoulder, and it stretched out
    hurried = arm.solve(MARKER, arm.pose(MARKER, postures(arm, 1)[0]), np.zeros(14),
                        options=IkOptions(max_iterations=1))  # fmt: skip
    assert not hurried.converged
    assert "Not settled after 1" in hurried.reason


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (1.5, -1.0, 1.2)])
def test_a_result_at_the_limits_is_the_best_one_in_the_box(
    arm: ArmKinematics, turn: tuple[float, float, float]
) -> None:
    """Beyond the limits, near or half a turn away: no joint alone comes closer."""
    target = arm.pose(MARKER, arm.limits[:, 1] + 0.3, EYE)
    target[:3, :3] = target[:3, :3] @ pin.exp3(np.array(turn))
    weights = np.array([1, 2, 1, 1, 5, 0.1])
    start = arm.limits[:, 1] - 0.1
    result = arm.solve(MARKER, target, start, EYE, weights, options=IkOptions(max_iterations=2000))
    assert not result.converged
    assert "Out of reach" in result.reason
    assert kept(arm, result.q)

    def cost(q: np.ndarray) -> float:
        offset = np.linalg.inv(target) @ arm.pose(MARKER, q, EYE)
        return float(weights @ np.r_[offset[:3, 3], pin.log3(offset[:3, :3])] ** 2)

    for axis in 1e-2 * np.vstack([np.eye(14), -np.eye(14)]):
        nearby = np.clip(result.q + axis, *arm.limits.T)
        assert cost(nearby) >= cost(result.q) * (1 - 1e-5)


def test_a_rotation_that_cannot_be_reached_is_left_at_the_least_weighted_error(
    arm: ArmKinematics,
) -> None:
    """Two joints, a target far from what they can do, and weights that are not alike."""
    weights = np.array([0, 0, 0, 1, 4, 0.2])
    start = postures(arm, 1, seed=10, inside=0.2)[0]
    target = arm.pose(MARKER, start)
    target[:3, :3] = target[:3, :3] @ pin.exp3(np.array([0.5, 0.4, -0.7]))
    free = np.isin(JOINTS, ("sh_yaw", "elbow"))
    result = arm.solve(
        MARKER, target, start, weights=weights, free=free, options=IkOptions(max_iterations=2000)
    )
    assert not result.converged

    def cost(q: np.ndarray) -> float:
        return float(weights[3:] @ pin.log3(target[:3, :3].T @ arm.pose(MARKER, q)[:3, :3]) ** 2)

    for axis in 5e-3 * np.vstack([np.eye(14)[free], -np.eye(14)[free]]):
        assert cost(np.clip(result.q + axis, *arm.limits.T)) >= cost(result.q)


def test_a_weight_of_zero_leaves_an_axis_to_itself(arm: ArmKinematics) -> None:
    """A can may be grasped from any side: the rotation about the target's z is free."""
    q = postures(arm, 1, seed=4, inside=0.5)[0]
    target = arm.pose("grip", q)
    turned = target @ np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    result = arm.solve("grip", turned, q, weights=(1, 1, 1, 1, 1, 0))
    found = arm.pose("grip", result.q)
    assert result.converged
    assert np.abs(found[:3, 3] - target[:3, 3]).max() < 1e-6
    assert found[:3, 2] @ target[:3, 2] == pytest.approx(1, abs=1e-9)
    assert np.abs(result.q - q).max() < 1e-6  # nothing had to move


def test_joints_that_are_not_free_stay(arm: ArmKinematics) -> None:
    q = postures(arm, 1, seed=5, inside=0.5)[0]
    free = np.array([name not in NECK for name in JOINTS])
    result = arm.solve(MARKER, arm.pose(MARKER, np.where(free, q + 0.1, q), EYE), q, EYE, free=free)
    assert result.converged
    assert np.array_equal(result.q[:3], q[:3])
    assert np.abs(result.q[3:] - q[3:]).max() > 0.01


def test_covariance_weighted_ik_is_the_kalman_update_for_a_small_error(arm: ArmKinematics) -> None:
    random = np.random.default_rng(6)
    q = postures(arm, 1, seed=6, inside=0.5)[0]
    half = random.normal(size=(14, 14))
    covariance = 1e-4 * (half @ half.T + np.eye(14))
    variance = np.r_[np.full(3, 1e-3), np.full(3, 5e-3)] ** 2
    seen = 1e-4 * random.normal(size=6)
    target = (pin.SE3(arm.pose(MARKER, q, EYE)) * pin.exp6(seen)).homogeneous
    result = arm.solve(
        MARKER, target, q, EYE, 1 / variance, np.linalg.inv(covariance),
        options=IkOptions(position_tolerance=1.0, rotation_tolerance=1.0),
    )  # fmt: skip
    jacobian = arm.frame_jacobian(MARKER, q, EYE)
    gain = np.linalg.solve(
        jacobian @ covariance @ jacobian.T + np.diag(variance), jacobian @ covariance
    ).T
    assert result.converged
    assert np.abs(result.q - q - gain @ seen).max() < 1e-2 * np.abs(gain @ seen).max()


def test_a_weak_prior_makes_the_least_movement_that_explains_the_pose(arm: ArmKinematics) -> None:
    random = np.random.default_rng(1)
    for truth in postures(arm, 20, seed=1, inside=0.6):
        estimate = np.clip(truth + np.deg2rad(6) * random.normal(size=14), *arm.limits.T)
        target = arm.pose(MARKER, truth, EYE)
        result = arm.solve(MARKER, target, estimate, EYE, np.full(6, 1e8), np.ones(14))
        move = result.q - estimate
        assert result.converged
        assert result.position_error < 1e-5
        assert np.linalg.norm(move) <= np.linalg.norm(truth - estimate) + 1e-6
        inner = (result.q > arm.limits[:, 0]) & (result.q < arm.limits[:, 1])
        if inner.all():  # then the least movement has no unobservable part
            assert np.abs(arm.unobservable_subspace(MARKER, result.q, EYE) @ move).max() < 1e-4


def test_a_stiff_prior_moves_where_the_estimate_is_unsure(arm: ArmKinematics) -> None:
    q = postures(arm, 1, seed=7, inside=0.5)[0]
    moved = q.copy()
    moved[10] += 0.2
    deviation = np.full(14, np.deg2rad(1))
    deviation[10] = np.deg2rad(20)
    target = arm.pose(MARKER, moved, EYE)
    result = arm.solve(MARKER, target, q, EYE, np.full(6, 1e8), deviation**-2)
    assert result.converged
    assert np.rad2deg(np.abs(result.q - moved).max()) < 0.5
    plain = arm.solve(MARKER, target, q, EYE)
    assert np.abs(plain.q - moved).max() > np.abs(result.q - moved).max()


def test_the_head_turns_to_a_point_within_its_limits(arm: ArmKinematics) -> None:
    for q in postures(arm, 20, seed=8):
        point = arm.pose(EYE, q)[:3] @ (0.0, 0.0, 0.5, 1.0)
        start = np.where(np.arange(14) < 3, 0.0, q)
        result = arm.point_camera(EYE, point, start, NECK)
        seen = np.linalg.inv(arm.pose(EYE, result.q)) @ (*point, 1.0)
        angle = np.arctan2(np.hypot(seen[0], seen[1]), seen[2])
        assert result.rotation_error == pytest.approx(angle, abs=1e-9)
        assert kept(arm, result.q)
        assert np.array_equal(result.q[3:], start[3:])
        assert result.converged, result.reason
        assert angle < 1e-3
    behind = arm.point_camera(EYE, (-3.0, 0.2, 0.5), np.zeros(14), NECK)
    assert not behind.converged
    assert behind.rotation_error > 1
    assert kept(arm, behind.q)


def test_the_unobservable_directions_leave_the_pose_alone(arm: ArmKinematics) -> None:
    q = postures(arm, 1, seed=9, inside=0.5)[0]
    unobservable = arm.unobservable_subspace(MARKER, q, EYE)
    assert unobservable.shape == (8, 14)
    assert np.allclose(unobservable @ unobservable.T, np.eye(8))
    assert np.abs(arm.frame_jacobian(MARKER, q, EYE) @ unobservable.T).max() < 1e-9
    before = arm.pose(MARKER, q, EYE)
    for direction in unobservable:
        assert np.abs(twist(before, arm.pose(MARKER, q + 1e-4 * direction, EYE))).max() < 1e-6
    assert arm.unobservable_subspace(MARKER, q, EYE, weights=(1, 1, 1, 0, 0, 0)).shape == (11, 14)


def test_bad_input_gets_one_sentence(arm: ArmKinematics) -> None:
    good, q = np.eye(4), np.zeros(14)
    skewed = np.diag([1.0, 1.0, 2.0, 1.0])
    with pytest.raises(KinematicsError, match="unknown frame 'wrist'; frames:"):
        arm.pose("wrist", q)
    with pytest.raises(KinematicsError, match=r"q must be finite numbers of shape \(14,\)"):
        arm.solve(MARKER, good, q * np.nan)
    with pytest.raises(KinematicsError, match=r"pose_target must be finite .* \(4, 4\)"):
        arm.solve(MARKER, good * np.nan, q)
    for wrong in (skewed, np.diag([1.0, 1.0, -1.0, 1.0])):
        with pytest.raises(KinematicsError, match="pose_target must be a rotation"):
            arm.solve(MARKER, wrong, q)
    with pytest.raises(KinematicsError, match="weights must be zero or positive"):
        arm.solve(MARKER, good, q, weights=(-1, 1, 1, 1, 1, 1))
    with pytest.raises(KinematicsError, match="prior_precision"):
        arm.solve(MARKER, good, q, prior_precision=np.full(14, np.inf))
    with pytest.raises(KinematicsError, match="free must be 14 flags"):
        arm.solve(MARKER, good, q, free=np.zeros(14, dtype=bool))
    with pytest.raises(KinematicsError, match="unknown joint 'nose'"):
        arm.point_camera(EYE, (1, 0, 0), q, ("nose",))
    with pytest.raises(KinematicsError, match="in the camera's centre"):
        arm.point_camera(EYE, arm.pose(EYE, q)[:3, 3], q, NECK)


@pytest.mark.parametrize("relative_to", [None, "base"])
def test_a_robot_with_one_joint_has_a_jacobian_of_one_column(
    tmp_path: Path, relative_to: str | None
) -> None:
    model = tmp_path / "finger.xml"
    model.write_text(
        '<mujoco><worldbody><site name="base" pos="0 0 1"/><body name="link">'
        '<joint name="hinge" axis="0 0 1" range="-1 1" limited="true"/><geom size="0.1"/>'
        '<site name="tip" pos="0.5 0 0"/></body></worldbody></mujoco>'
    )
    jacobian = ArmKinematics(model, ["hinge"]).frame_jacobian("tip", [0.3], relative_to)
    assert np.allclose(jacobian, [[0.0], [0.5], [0.0], [0.0], [0.0], [1.0]])
