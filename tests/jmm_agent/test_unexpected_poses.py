"""Poses that all others contradict, on a linear problem whose posterior is exact."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jmm_agent.types import Floats
from jmm_agent.updaters.unexpected_poses import contradicted, is_unexpected
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.observation_fit import ObservationFitOptions
from jmm_agent.vision.pose_covariance import UNKNOWN

COUNT, PROBABILITY = 12, 1e-4
OPTIONS = ObservationFitOptions(position_noise=1e-6, rotation_noise=1e-6)
COVARIANCE = np.diag([4e-6, 4e-6, 3.6e-5, 3e-4, 3e-4, 3e-4])


def poses(claimed: float = 1.0, wrong: dict[int, float] | None = None, seed: int = 0) -> Any:
    """Poses of a body at rest with noise, and the posterior by all of them."""
    rng = np.random.default_rng(seed)
    errors = rng.multivariate_normal(np.zeros(6), COVARIANCE, COUNT)
    for number, off in (wrong or {}).items():
        errors[number, 0] += off
    noise = claimed**2 * COVARIANCE
    mean = errors.mean(axis=0)
    found = []
    for error in errors:
        pose = np.eye(4)
        pose[:3, 3] = error[:3]
        pose[:3, :3] = Rotation.from_rotvec(error[3:]).as_matrix()
        found.append(MarkerObservation(pose, np.zeros(1), error, ("hand", "eye"), noise))
    posterior = SimpleNamespace(covariance_of_rest=lambda k: noise / COUNT)
    return found, np.tile(mean, (COUNT, 1)), posterior


def residual(q: Floats, pose: Floats, frames: object = None) -> tuple[Floats, Floats]:
    """Of a body whose position and small rotation are the unknowns."""
    turned = Rotation.from_matrix(pose[:3, :3]).as_rotvec()
    return q - np.append(pose[:3, 3], turned), np.eye(6)


def found(made: Any, probability: float = PROBABILITY) -> int | None:
    return contradicted(*made, residual, OPTIONS, probability)


@pytest.mark.parametrize("claimed", [1.0, 1.0 / 3.0])
def test_right_poses_are_kept_even_if_their_covariances_are_too_small(claimed: float) -> None:
    assert [found(poses(claimed, seed=seed)) for seed in range(20)] == [None] * 20


@pytest.mark.parametrize("claimed", [1.0, 1.0 / 3.0])
@pytest.mark.parametrize("off", [0.1, -0.1])
def test_the_pose_that_is_far_off_is_found(claimed: float, off: float) -> None:
    assert found(poses(claimed, {5: off})) == 5
    assert found(poses(claimed, {5: off, 8: 2.0 * off})) == 8


def test_without_a_probability_or_covariances_none_is() -> None:
    made = poses(wrong={5: 0.1})
    assert found(made, 0.0) is None
    plain = [one._replace(covariance=None) for one in made[0]]
    assert found((plain, *made[1:])) is None
    assert found(([], np.zeros((0, 6)), made[2])) is None


def test_numbers_that_were_not_measured_do_not_count() -> None:
    made = poses(wrong={5: 0.1})
    hidden = COVARIANCE.copy()
    hidden[0, 0] = UNKNOWN
    unknown = [one._replace(covariance=hidden) for one in made[0]]
    assert found((unknown, *made[1:])) is None


def test_a_prediction_is_missed_by_its_distance() -> None:
    for measured, far in ((6, 28.0), (3, 22.0)):
        near: Any = SimpleNamespace(distance=0.7 * far, measured=measured)
        away: Any = SimpleNamespace(distance=far, measured=measured)
        assert not is_unexpected(near, PROBABILITY)
        assert is_unexpected(away, PROBABILITY)
        assert not is_unexpected(away, 0.0)
    assert not is_unexpected(None, PROBABILITY)
