"""The prior's correction against the closed form of the smallest change."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from tests.jmm_agent.small_map import make_map, postures

OPTIONS = PriorOptions(offset=0.03, shape=0.006, noise=0.002)
TYPICAL = postures(200, 9)


@pytest.fixture
def nominal_map() -> JointMuscleMap:
    return make_map(0)


@pytest.fixture
def prior(nominal_map: JointMuscleMap) -> MapPrior:
    return MapPrior(nominal_map, TYPICAL, OPTIONS)


def features(nominal_map: JointMuscleMap, rank: int, q: np.ndarray) -> np.ndarray:
    """The features of one group as the module's docstring defines them."""
    group = nominal_map.groups[rank]
    typical, here = (
        1 / (1 + np.exp(-((x[:, group.joint_index] - group.centre) / group.scale @ group.W1.T
                          + group.b1)))
        for x in (TYPICAL, q)
    )  # fmt: skip
    spread = np.sqrt(np.sum(np.var(typical, axis=0)))
    shape = OPTIONS.shape * (here - typical.mean(axis=0)) / spread
    return np.hstack([np.full((len(q), 1), OPTIONS.offset), shape])


def test_the_correction_is_the_ridge_solution(nominal_map: JointMuscleMap, prior: MapPrior) -> None:
    q, asked = postures(6, 1), postures(40, 2)
    lengths = nominal_map.lengths(q) + 0.02 * np.random.default_rng(3).normal(size=(6, 5))
    noise = np.array([0.001, 0.002, 0.05, 0.001, 0.03, 0.001])
    moved = prior.corrected(q, lengths, noise)
    for rank, group in enumerate(nominal_map.groups):
        # Weights of unit variance, in their own space of 1 + H numbers: argmin of the sum of
        # squares, weighed by the noise, plus the weights' own.
        phi = features(nominal_map, rank, q) / noise[:, None]
        residual = (lengths - nominal_map.lengths(q))[:, group.muscle_index] / noise[:, None]
        weights = np.linalg.solve(phi.T @ phi + np.eye(phi.shape[1]), phi.T @ residual)
        change = (moved.lengths(asked) - nominal_map.lengths(asked))[:, group.muscle_index]
        np.testing.assert_allclose(change, features(nominal_map, rank, asked) @ weights, atol=1e-12)


def test_exact_pairs_are_explained(nominal_map: JointMuscleMap, prior: MapPrior) -> None:
    q = postures(3, 1)
    lengths = nominal_map.lengths(q) + 0.02 * np.random.default_rng(3).normal(size=(3, 5))
    moved = prior.corrected(q, lengths, np.full(3, 1e-7))
    np.testing.assert_allclose(moved.lengths(q), lengths, atol=1e-6)


def test_no_pairs_and_pairs_that_fit_change_nothing(
    nominal_map: JointMuscleMap, prior: MapPrior
) -> None:
    asked = postures(20, 2)
    for q in (np.empty((0, 4)), postures(4, 1)):
        moved = prior.corrected(q, nominal_map.lengths(q), np.full(len(q), 1e-3))
        np.testing.assert_allclose(moved.lengths(asked), nominal_map.lengths(asked), atol=1e-12)


def test_pairs_of_different_exactness_are_weighed(
    nominal_map: JointMuscleMap, prior: MapPrior
) -> None:
    q = np.repeat(postures(1, 1), 2, axis=0)
    lengths = nominal_map.lengths(q) + np.array([[0.01], [-0.01]])
    moved = prior.corrected(q, lengths, np.array([1e-5, 0.1]))
    np.testing.assert_allclose(moved.lengths(q[0]), lengths[0], atol=1e-5)


def test_the_scales_are_standard_deviations_over_typical_postures(
    nominal_map: JointMuscleMap, prior: MapPrior
) -> None:
    for kernel in prior.groups(TYPICAL):
        variance = np.sum(kernel.features**2, axis=1)
        assert np.mean(variance) == pytest.approx(OPTIONS.offset**2 + OPTIONS.shape**2, rel=1e-9)


def test_whitening_is_by_kernel_and_noise(nominal_map: JointMuscleMap, prior: MapPrior) -> None:
    q = postures(5, 4)
    residual = np.random.default_rng(0).normal(size=(5, 2))
    for noise in (None, np.linspace(0.001, 0.01, 5)):
        spread = np.full(5, OPTIONS.noise) if noise is None else noise
        for rank, kernel in enumerate(prior.groups(q, noise)):
            phi = features(nominal_map, rank, q)
            expected = np.linalg.solve(phi @ phi.T + np.diag(spread**2), residual)
            np.testing.assert_allclose(kernel.whiten(residual), expected, rtol=1e-6)


def test_far_postures_learn_the_offset_more_than_the_shape(
    nominal_map: JointMuscleMap, prior: MapPrior
) -> None:
    q, asked = postures(8, 1), postures(100, 2)
    moved = prior.corrected(q, nominal_map.lengths(q) + 0.02, np.full(8, 1e-3))
    np.testing.assert_allclose(moved.lengths(asked) - nominal_map.lengths(asked), 0.02, atol=0.004)
