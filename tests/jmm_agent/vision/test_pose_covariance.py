"""The weight of a measured pose in the fit is the inverse covariance of its residual."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    ObservationWeights,
    residual_of,
)
from jmm_agent.vision.marker_residual import MarkerResidual
from jmm_agent.vision.pose_covariance import checked_covariance, checked_pose, pose_weight
from tests.jmm_agent.nominal_arm import posture_set

Q = posture_set()[5]
ROOT = np.random.default_rng(1).normal(size=(6, 6)) * np.repeat([2e-3, 1e-2], 3)[:, None]
COVARIANCE = ROOT @ ROOT.T
"""Of position [m] and rotation [rad], all six correlated."""


@pytest.fixture(scope="module")
def marker_residual(arm: ArmKinematics) -> MarkerResidual:
    return MarkerResidual(arm, "eye", "marker_hand")


def measured(true: np.ndarray, error: np.ndarray) -> np.ndarray:
    """The pose (4, 4) that is measured with an error (6,) in the axes of the reference."""
    pose = true.copy()
    pose[:3, 3] += error[:3]
    pose[:3, :3] = Rotation.from_rotvec(error[3:]).as_matrix() @ pose[:3, :3]
    return pose


@pytest.mark.parametrize("frames", [("hand", None), ("marker_hand", "eye"), ("grip", "thorax")])
def test_the_covariance_is_in_the_axes_of_the_reference(
    arm: ArmKinematics, marker_residual: MarkerResidual, frames: tuple[str, str | None]
) -> None:
    """The residuals of many measurements, times the root of the weight, are of unit variance."""
    rng = np.random.default_rng(0)
    true = arm.pose(frames[0], Q, frames[1])
    samples = []
    for error in rng.multivariate_normal(np.zeros(6), COVARIANCE, 800):
        pose = measured(true, error)
        residual, _ = marker_residual(Q, pose, frames)
        root = np.linalg.cholesky(pose_weight(COVARIANCE, pose, 0.0, 0.0)).T
        samples.append(root @ residual)
    np.testing.assert_allclose(np.cov(np.array(samples).T), np.eye(6), atol=0.2)


def test_the_jacobian_of_another_frame_is_that_of_its_residual(
    arm: ArmKinematics, marker_residual: MarkerResidual
) -> None:
    frames = ("hand", None)
    pose = measured(arm.pose("hand", Q), np.array([0.02, -0.01, 0.03, 0.2, -0.1, 0.1]))
    _, slope = marker_residual(Q, pose, frames)
    for joint, axis in enumerate(np.eye(14)):
        ends = [marker_residual(Q + step * axis, pose, frames)[0] for step in (1e-6, -1e-6)]
        np.testing.assert_allclose(slope[:, joint], (ends[0] - ends[1]) / 2e-6, atol=1e-5)


def test_what_was_not_measured_has_no_weight() -> None:
    pose = measured(np.eye(4), np.array([0, 0, 0, 0.3, 0.2, -0.4]))
    covariance = checked_covariance(np.diag([1e-6, 1e-6, np.inf, np.inf, np.inf, np.inf]))
    weight = pose_weight(covariance, pose, 0.001, 0.01)
    rotated = np.zeros((6, 6))
    rotated[:3, :3] = pose[:3, :3] @ weight[:3, :3] @ pose[:3, :3].T
    np.testing.assert_allclose(np.diag(rotated), [5e5, 5e5, 0, 0, 0, 0], rtol=1e-9, atol=1e-6)
    assert not weight[3:].any()
    large = checked_covariance(np.diag([1e-6, 1e-6, 1e6, 1e9, 1e9, 1e9]))
    np.testing.assert_array_equal(pose_weight(large, pose, 0.001, 0.01), weight)


def test_the_noise_of_the_options_is_added() -> None:
    weight = pose_weight(np.diag([1e-6] * 6), np.eye(4), 0.003, 0.01)
    np.testing.assert_allclose(np.diag(weight), [1 / 10e-6] * 3 + [1 / 101e-6] * 3)


def test_the_normal_equations_are_the_derivatives_of_the_cost(
    arm: ArmKinematics, marker_residual: MarkerResidual
) -> None:
    """With a covariance and measured joint angles, and for both observations at once."""
    angles = np.full(14, np.nan)
    angles[[3, 9]] = Q[[3, 9]] + 0.02
    pose = measured(arm.pose("hand", Q), np.array([0.02, -0.01, 0.03, 0.1, -0.1, 0.1]))
    plain = MarkerObservation(arm.pose("marker_hand", Q + 0.02, "eye"), np.zeros(36), Q)
    full = MarkerObservation(pose, np.zeros(36), Q, ("hand", None), COVARIANCE, angles)
    both = [plain, full]
    weights = ObservationWeights(both, 0.003, 0.01, 0.005)

    def cost(q: np.ndarray) -> float:
        rows = [
            residual_of(found, marker_residual, row)[0] for found, row in zip(both, q, strict=True)
        ]
        return weights.cost(q, np.array(rows))

    start = np.array([Q, Q])
    for k, found in enumerate(both):
        residual, slope = residual_of(found, marker_residual, Q)
        matrix, gradient = weights.normal_equations(k, Q, residual, slope)
        error, root = weights.whitened(k, Q, residual, slope)
        np.testing.assert_allclose(root.T @ error, gradient, rtol=1e-6, atol=1e-4)
        np.testing.assert_allclose(root.T @ root, matrix, rtol=1e-6, atol=1e-3)
        for joint in range(14):
            step = np.zeros((2, 14))
            step[k, joint] = 1e-6
            slope_of_cost = (cost(start + step) - cost(start - step)) / 2e-6
            assert 2.0 * gradient[joint] == pytest.approx(slope_of_cost, rel=1e-3, abs=0.05)


def test_a_pose_with_rounding_errors_becomes_rigid() -> None:
    rough = np.eye(4)
    rough[:3, :3] += np.random.default_rng(0).normal(0, 1e-4, (3, 3))
    rotation = checked_pose(rough)[:3, :3]
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation, rough[:3, :3], atol=1e-3)
