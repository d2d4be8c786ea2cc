"""Tests of the pose of uncertain points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from jmm_agent.types import Floats
from jmm_agent.vision.weighted_pnp import TAIL, solve_points

POINTS = np.random.default_rng(0).uniform(-0.08, 0.08, (16, 3))


def pose_of(random: np.random.Generator) -> Floats:
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(random.normal(0.0, 1.5, 3))[0]
    pose[:3, 3] = *random.normal(0.0, 0.02, 2), random.uniform(0.3, 0.8)
    return pose


def slopes_of(pose: Floats) -> Floats:
    points = POINTS @ pose[:3, :3].T + pose[:3, 3]
    return points[:, :2] / points[:, 2:]


def test_exact_points_give_the_exact_pose() -> None:
    random = np.random.default_rng(1)
    for _ in range(20):
        pose = pose_of(random)
        found = solve_points(POINTS, slopes_of(pose), np.tile(1e-6 * np.eye(2), (16, 1, 1)))
        assert found is not None
        assert found.pose == pytest.approx(pose, abs=1e-6)


def test_the_covariance_of_many_points_is_that_of_the_errors() -> None:
    random = np.random.default_rng(2)
    points, shares = random.uniform(-0.08, 0.08, (100, 3)), []
    for _ in range(400):
        pose = pose_of(random)
        turned = points @ pose[:3, :3].T + pose[:3, 3]
        spread = random.uniform(0.0005, 0.004, (100, 2))
        covariances = np.zeros((100, 2, 2))
        covariances[:, [0, 1], [0, 1]] = spread**2
        tails = np.sqrt(TAIL / random.chisquare(TAIL, (100, 1)))
        slopes = turned[:, :2] / turned[:, 2:] + spread * tails * random.normal(size=(100, 2))
        found = solve_points(points, slopes, covariances)
        assert found is not None
        turn = cv2.Rodrigues(found.pose[:3, :3] @ pose[:3, :3].T)[0].ravel()
        error = np.concatenate([found.pose[:3, 3] - pose[:3, 3], turn])
        shares.append(error @ np.linalg.solve(found.covariance, error))
    # 12.59 is the 95th percentile of chi squared with 6 degrees of freedom.
    assert np.mean(np.array(shares) < 12.59) == pytest.approx(0.95, abs=0.03)
    assert np.mean(shares) == pytest.approx(6.0, abs=0.6)


def test_points_that_are_far_off_hardly_move_the_pose() -> None:
    random = np.random.default_rng(3)
    away = []
    for _ in range(50):
        pose = pose_of(random)
        slopes = slopes_of(pose) + 0.001 * random.normal(size=(16, 2))
        slopes[:2] += 0.05
        found = solve_points(POINTS, slopes, np.tile(1e-6 * np.eye(2), (16, 1, 1)))
        assert found is not None
        away.append(np.linalg.norm(found.pose[:3, 3] - pose[:3, 3]))
    assert np.median(away) < 0.006


def test_points_of_no_pose_have_none_or_one_that_they_do_not_fit() -> None:
    random = np.random.default_rng(4)
    for _ in range(20):
        slopes = random.uniform(-0.2, 0.2, (16, 2))
        found = solve_points(POINTS, slopes, np.tile(1e-6 * np.eye(2), (16, 1, 1)))
        assert found is None or np.abs(slopes_of(found.pose) - slopes).max() > 0.02


def test_coincident_points_have_no_pose() -> None:
    """As a network gives them in a frame that it knows nothing of; OpenCV raises then."""
    covariances = np.tile(np.eye(2) * 1e-4, (16, 1, 1))
    assert solve_points(POINTS, np.full((16, 2), 0.01), covariances) is None
    assert (
        solve_points(np.zeros((16, 3)), slopes_of(pose_of(np.random.default_rng(2))), covariances)
        is None
    )
