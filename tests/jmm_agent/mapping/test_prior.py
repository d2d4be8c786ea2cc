"""The prior's correction against the closed form of the smallest change."""

from __future__ import annotations

from dataclasses import replace

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


@pytest.fixture
def displaced(nominal_map: JointMuscleMap) -> MapPrior:
    """A prior that knows what displaced points do."""
    rng = np.random.default_rng(5)
    points = tuple(rng.normal(size=(*g.W2.shape, 6)) for g in nominal_map.groups)
    return MapPrior(nominal_map, TYPICAL, OPTIONS, points)


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


def test_errors_of_displaced_points_are_learned_from_few_pairs(
    nominal_map: JointMuscleMap, prior: MapPrior, displaced: MapPrior
) -> None:
    assert displaced.points is not None
    q, asked, rng = postures(8, 1), postures(100, 2), np.random.default_rng(6)

    def change(at: np.ndarray) -> np.ndarray:
        found = np.zeros((len(at), 5))
        for weights, group in zip(displaced.points or (), nominal_map.groups, strict=True):
            shifts = 0.004 * np.random.default_rng(8).normal(size=weights.shape[::2])
            effect = np.einsum("kh,mhp,mp->km", group.hidden(at), weights, shifts)
            found[:, group.muscle_index] = effect
        return found

    lengths = nominal_map.lengths(q) + change(q) + rng.normal(0.0, 1e-7, (8, 5))
    true, noise = nominal_map.lengths(asked) + change(asked), np.full(8, 1e-7)
    known = replace(OPTIONS, offset=0.1, shape=1e-6, points=0.004)
    knowing = MapPrior(nominal_map, TYPICAL, known, displaced.points)
    error = knowing.corrected(q, lengths, noise).lengths(asked) - true
    without = prior.corrected(q, lengths, noise).lengths(asked) - true
    assert np.sqrt(np.mean(error**2)) < 0.05 * np.sqrt(np.mean(without**2))


def test_displaced_points_are_features_beside_the_others(
    nominal_map: JointMuscleMap, displaced: MapPrior
) -> None:
    q = postures(5, 4)
    found = {int(kernel.muscles[0]): kernel for kernel in displaced.groups(q)}
    assert sorted(found) == [0, 1, 2, 3, 4]
    for rank, group in enumerate(nominal_map.groups):
        hidden = group.hidden(q) - group.hidden(TYPICAL).mean(axis=0)
        for row, muscle in enumerate(group.muscle_index):
            assert displaced.points is not None
            points = OPTIONS.points * hidden @ displaced.points[rank][row]
            phi = np.hstack([features(nominal_map, rank, q), points])
            np.testing.assert_allclose(found[int(muscle)].features, phi, atol=1e-12)
            expected = np.linalg.solve(phi @ phi.T + OPTIONS.noise**2 * np.eye(5), np.arange(5.0))
            np.testing.assert_allclose(found[int(muscle)].whiten(np.arange(5.0)), expected)


def test_the_correction_for_displaced_points_is_that_of_their_kernel(displaced: MapPrior) -> None:
    q, asked = postures(6, 1), postures(40, 2)
    lengths = displaced.map.lengths(q) + 0.02 * np.random.default_rng(3).normal(size=(6, 5))
    noise = np.full(6, 0.002)
    change = displaced.corrected(q, lengths, noise).lengths(asked) - displaced.map.lengths(asked)
    both = displaced.groups(np.vstack([asked, q]))
    for kernel, whole in zip(displaced.groups(q, noise), both, strict=True):
        crossed = whole.features[:40] @ whole.features[40:].T
        residual = (lengths - displaced.map.lengths(q))[:, kernel.muscles]
        expected = crossed @ kernel.whiten(residual)
        np.testing.assert_allclose(change[:, kernel.muscles], expected, atol=1e-12)


def test_the_spread_knows_of_displaced_points(displaced: MapPrior) -> None:
    q, asked, noise = postures(3, 1), postures(1, 2)[0], np.full(3, 0.002)
    found = displaced.spread(q, noise, asked)
    for kernel in displaced.groups(np.vstack([q, asked])):
        full = kernel.features @ kernel.features.T
        inner = np.linalg.inv(full[:3, :3] + 0.002**2 * np.eye(3))
        expected = np.sqrt(full[3, 3] - full[3, :3] @ inner @ full[:3, 3])
        assert found[kernel.muscles[0]] == pytest.approx(expected, rel=1e-6)


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
