"""Permanent elongations are found among marker observations; where there is none, none is."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.mapping.learner import BatchOptions, Learner, RidgeRule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.updaters import VisionOptions, VisionUpdater
from jmm_agent.vision.observation_fit import (
    MarkerObservation,
    ObservationFit,
    ObservationFitOptions,
    fit_observations,
)
from jmm_agent.vision.permanent_elongation import (
    elongations,
    fit_with_elongation,
    log_bayes_factors,
)
from tests.jmm_agent.small_map import LIMITS, make_map, postures

BEFORE, AFTER = 12, 3
"""Number of observations before muscles are elongated, and after."""

ELONGATION = 0.010
TRUE = postures(BEFORE + AFTER, 4)


def marker_residual(q: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residual (6,) of a marker that shows all four joints, and its Jacobian (6, 4)."""
    error = np.array([*(q[:3] - pose[:3, 3]), q[3] - pose[3, 0], 0.0, 0.0])
    return error, np.eye(6)[:, :4]


def observed(q: np.ndarray, elongation: np.ndarray) -> MarkerObservation:
    """Observe a robot whose lengths are all 15 mm off, and shorter by ``elongation`` (5,) [m]."""
    pose = np.eye(4)
    pose[:3, 3], pose[3, 0] = q[:3], q[3]
    rng = np.random.default_rng(int(1e6 * q[0]) % 1000)
    noise = 0.0003 * rng.standard_normal(5)
    return MarkerObservation(pose, make_map(0).lengths(q) + 0.015 - elongation + noise, q + 0.03)


def observations_of(elongation: np.ndarray) -> list[MarkerObservation]:
    return [observed(q, elongation * (k >= BEFORE)) for k, q in enumerate(TRUE)]


@pytest.fixture
def prior() -> MapPrior:
    return MapPrior(make_map(0), postures(100, 8), PriorOptions())


def grown(
    prior: MapPrior, observations: list[MarkerObservation], options: ObservationFitOptions
) -> tuple[ObservationFit, np.ndarray]:
    """The fit after the last observation, each added to those before as the Vision Updater does."""
    angles, elongated = np.empty((0, 4)), np.empty((0, 5))
    for count in range(1, len(observations) + 1):
        start = np.vstack([angles, observations[count - 1].guess])
        history = np.vstack([elongated, np.zeros(5)])
        fit, elongated = fit_with_elongation(
            observations[:count], prior, marker_residual, LIMITS, options, start, history
        )
        angles = fit.angles
    return fit, elongated


@pytest.mark.parametrize("muscles", [[2], [0, 3], [1, 4]])
def test_elongated_muscles_are_found_and_when_and_how_far(
    prior: MapPrior, muscles: list[int]
) -> None:
    given = ELONGATION * np.isin(np.arange(5), muscles)
    observations = observations_of(given)
    fit, elongated = grown(prior, observations, ObservationFitOptions())
    expected = np.outer(np.arange(len(observations)) < BEFORE, given > 0)
    np.testing.assert_array_equal(elongated, expected)
    found = elongations(observations, prior, fit.angles, elongated)
    np.testing.assert_allclose(found, expected * ELONGATION, atol=0.001)


def test_where_no_muscle_is_elongated_none_is_found(prior: MapPrior) -> None:
    observations = observations_of(np.zeros(5))
    fit, elongated = grown(prior, observations, ObservationFitOptions())
    assert not elongated.any()
    assert not elongations(observations, prior, fit.angles, elongated).any()
    start = np.array([one.guess for one in observations])
    plain = fit_observations(
        observations, prior, marker_residual, LIMITS, ObservationFitOptions(), start
    )
    np.testing.assert_allclose(fit.angles, plain.angles, atol=2e-3)


def test_an_elongation_is_believed_only_on_evidence(prior: MapPrior) -> None:
    observations = observations_of(np.array([0.0, 0.0, ELONGATION, 0.0, 0.0]))
    assert not grown(prior, observations, ObservationFitOptions(elongation_evidence=np.inf))[
        1
    ].any()
    assert not grown(prior, observations, ObservationFitOptions(elongation_evidence=1e6))[1].any()


def test_elongations_are_sums_of_independent_steps(prior: MapPrior) -> None:
    """The kernel's closed form: steps are sums of independent ones since each posture."""
    q = postures(4, 1)
    elongated = np.zeros((4, 5))
    elongated[:3, 2] += 1
    elongated[:1, 2] += 1
    kernels = {
        int(m): kernel for kernel in prior.groups(q, elongated=elongated) for m in kernel.muscles
    }
    assert sorted(kernels) == list(range(5))
    steps = np.array([[2, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 0], [0, 0, 0, 0]])
    np.testing.assert_allclose(kernels[2].elongation, PriorOptions().elongation ** 2 * steps)
    for muscle in (0, 1, 3, 4):
        assert not kernels[muscle].elongation.any()
    kernel = kernels[2]
    whole = kernel.features @ kernel.features.T + kernel.elongation
    whole += PriorOptions().noise ** 2 * np.eye(4)
    np.testing.assert_allclose(whole @ kernel.whiten(np.eye(4)), np.eye(4), atol=1e-9)


def test_the_evidence_is_that_of_two_normal_distributions(prior: MapPrior) -> None:
    """Seen joints and lengths are jointly normal around a linearised map, with a step or without.

    Vision is coarse here, so that lengths inform the joints too, and the angles are off the fit's.
    """
    options = ObservationFitOptions(position_noise=0.05, rotation_noise=0.03)
    observations = observations_of(np.array([0.0, 0.0, 0.003, 0.0, 0.0]))[-6:]
    count, elongated = len(observations), np.zeros((6, 5))
    elongated[:2, 1] = 1.0
    seen = np.array([[*one.pose[:3, 3], one.pose[3, 0]] for one in observations])
    angles = seen + np.random.default_rng(2).normal(0.0, 0.01, seen.shape)
    found = log_bayes_factors(
        observations, prior, marker_residual, options, angles, elongated, count - 1
    )
    assert found.shape == (count - 1, 5)

    expected, jacobian = prior.map.lengths_and_jacobian(angles)
    arms = np.zeros((5, count, count, 4))  # of each muscle: observations, their angles
    for k in range(count):
        arms[:, k, k] = jacobian[k]
    arms = arms.reshape(5 * count, 4 * count)
    spread = np.tile([0.05, 0.05, 0.05, 0.03], count)
    covariance = arms @ np.diag(spread**2) @ arms.T
    for kernel in prior.groups(angles, elongated=elongated):
        for muscle in kernel.muscles:
            own = slice(muscle * count, (muscle + 1) * count)
            covariance[own, own] += np.linalg.inv(kernel.whiten(np.eye(count)))
    missed = np.array([one.lengths for one in observations]) - expected
    missed = missed.T.ravel() - arms @ (seen - angles).ravel()

    def log_density(total: np.ndarray) -> float:
        return float(-np.linalg.slogdet(total)[1] - missed @ np.linalg.solve(total, missed)) / 2

    for muscle in range(5):
        for k in range(1, count):
            step = np.zeros((5, count))
            step[muscle, :k] = PriorOptions().elongation
            other = covariance + np.outer(step, step)
            exact = log_density(other) - log_density(covariance)
            assert found[k - 1, muscle] == pytest.approx(exact, rel=1e-3, abs=1e-3)


def learned(options: ObservationFitOptions, given: np.ndarray) -> tuple[VisionUpdater, Learner]:
    """The Vision Updater after all observations, one by one."""
    start = make_map(0)
    prior = MapPrior(start, postures(100, 8), PriorOptions())
    learner = Learner(start, LIMITS, RidgeRule(prior), BatchOptions(), np.random.default_rng(0))
    updater = VisionUpdater(
        learner, prior, marker_residual, LIMITS, VisionOptions(distance=0.0, observations=options)
    )
    for one in observations_of(given):
        updater.seen(one.pose, one.guess, one.lengths, one.lengths, np.full(5, 50.0))
    return updater, learner


def test_the_map_follows_an_elongated_muscle() -> None:
    given = np.array([0.0, 0.0, ELONGATION, 0.0, 0.0])
    asked = postures(50, 6)
    robot = make_map(0).lengths(asked) + 0.015 - given

    def missed(options: ObservationFitOptions) -> float:
        _, learner = learned(options, given)
        return float(np.sqrt(np.mean((learner.map.lengths(asked) - robot)[:, 2] ** 2)))

    assert missed(ObservationFitOptions()) < 0.002
    assert missed(ObservationFitOptions(elongation_evidence=np.inf)) > 0.005


def test_an_elongation_is_forgotten_with_the_observations_before() -> None:
    updater, _ = learned(
        ObservationFitOptions(memory=AFTER + 2), np.array([0.0, 0.0, ELONGATION, 0.0, 0.0])
    )
    assert updater.elongated.shape == (AFTER + 2, 5)
    np.testing.assert_array_equal(updater.elongated[:, 2], [1, 1, 0, 0, 0])


def test_an_observation_without_learning_adds_no_elongation() -> None:
    updater, _ = learned(ObservationFitOptions(), np.zeros(5))
    before = updater.elongated.copy()
    one = observed(TRUE[0], np.array([0.0, 0.0, ELONGATION, 0.0, 0.0]))
    updater.seen(one.pose, one.guess, one.lengths, one.lengths, np.full(5, 50.0), learn=False)
    np.testing.assert_array_equal(updater.elongated, before)
