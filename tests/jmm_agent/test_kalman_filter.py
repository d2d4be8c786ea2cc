"""Consistency of the filter: innovations and errors match its covariances."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from scipy.optimize import least_squares
from scipy.stats import chi2

from jmm_agent.kalman_filter import Consistency, JointEstimator
from jmm_agent.kalman_filter_options import EstimatorError, EstimatorOptions
from jmm_agent.mapping.length_map import QuadraticJacobian
from tests.jmm_agent.nominal_arm import Tendons

NOISE = 2e-4  # [m]
DT = 0.02  # [s]


@pytest.fixture(scope="module")
def arm() -> Tendons:
    return Tendons()


@pytest.fixture(scope="module")
def elbow() -> Tendons:
    return Tendons(("elbow",), ("brachialis", "biceps", "triceps"))


def movement(muscles: Tendons, rng: np.random.Generator, steps: int) -> np.ndarray:
    """Postures (steps, n): half of each second smooth movement to a random posture, half rest."""
    low, high = muscles.limits.T
    inside = np.array([rng.uniform(0.8 * low, 0.8 * high) for _ in range(steps // 100 + 2)])
    rows = []
    for start, end in pairwise(inside):
        phase = np.minimum(np.arange(100) / 50.0, 1.0)
        blend = 0.5 - 0.5 * np.cos(np.pi * phase)
        rows.append(start + blend[:, None] * (end - start))
    return np.concatenate(rows)[:steps]


def follow(
    estimator: JointEstimator, muscles: Tendons, postures: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """NIS, normalised estimation error squared, and |error| over the movement, after 10 steps."""
    nis, nees, errors = [], [], []
    for q in postures:
        measured = muscles.lengths(q) + rng.normal(0, NOISE, len(muscles.muscles))
        estimate = estimator.update(measured, DT)
        error = estimate.q - q
        nis.append(estimate.nis)
        nees.append(error @ np.linalg.solve(estimate.covariance, error))
        errors.append(np.abs(error))
    return np.array(nis[10:]), np.array(nees[10:]), np.array(errors[10:])


def in_band(values: np.ndarray, dof: int, confidence: float = 0.95) -> bool:
    tail = 0.5 * (1 - confidence)
    low, high = chi2.ppf([tail, 1 - tail], dof * values.size) / values.size
    return bool(low <= values.mean() <= high)


def started(muscles: Tendons, q: np.ndarray, **options: float) -> JointEstimator:
    chosen = EstimatorOptions(encoder_noise=NOISE, **options)  # type: ignore[arg-type]
    return JointEstimator(muscles, muscles.limits, chosen, q)


def seen(estimator: JointEstimator) -> Consistency:
    consistency = estimator.consistency
    assert consistency is not None
    return consistency


@pytest.mark.parametrize("which", ["arm", "elbow"])
def test_innovations_are_consistent_moving_and_still(
    which: str, request: pytest.FixtureRequest
) -> None:
    muscles: Tendons = request.getfixturevalue(which)
    dof = len(muscles.muscles) - len(muscles.joints)
    inside = steps_in_band = steps = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        postures = movement(muscles, rng, 600)
        estimator = started(muscles, postures[0])
        nis, _, _ = follow(estimator, muscles, postures, rng)
        moving = np.arange(10, 600) % 100 < 50
        inside += in_band(nis[moving], dof) + in_band(nis[~moving], dof)
        low, high = chi2.ppf([0.025, 0.975], dof)
        steps_in_band += int(np.sum((nis >= low) & (nis <= high)))
        steps += nis.size
    assert inside >= 13  # of 16 runs; P(fewer) = 0.1 % where each is inside with 95 %
    assert 0.935 < steps_in_band / steps < 0.965


def test_covariance_is_as_large_as_the_errors(arm: Tendons) -> None:
    ratio = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        postures = movement(arm, rng, 400)
        _, nees, _ = follow(started(arm, postures[0]), arm, postures, rng)
        ratio.append(nees.mean() / len(arm.joints))
    assert 0.8 < np.mean(ratio) < 1.25


def test_on_a_linear_map_it_is_the_exact_posterior() -> None:
    """Prediction and correction with their shared noise together use the lengths once."""
    rng = np.random.default_rng(4)
    arms = rng.normal(0, 5e-3, (6, 3))
    arms[:, 2] *= 1e-2  # a joint that the muscles hardly show

    class Linear:
        def lengths_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return arms @ q, arms

    options = EstimatorOptions(encoder_noise=1e-3, motion_noise=0.3, process_noise=1e-9)
    estimator = JointEstimator(Linear(), np.tile([-100.0, 100.0], (3, 1)), options)
    q, covariance = np.zeros(3), 0.5**2 * np.eye(3)
    for _ in range(30):
        measured = arms @ rng.normal(size=3) + 1e-3 * rng.normal(size=6)
        estimate = estimator.update(measured, 0.1)
        prior = covariance + 0.3**2 * 0.1 * np.eye(3)
        gain = prior @ arms.T @ np.linalg.inv(arms @ prior @ arms.T + 1e-6 * np.eye(6))
        q, covariance = q + gain @ (measured - arms @ q), prior - gain @ arms @ prior
        assert np.abs(estimate.q - q).max() < 1e-9
        assert np.abs(estimate.covariance - covariance).max() < 1e-9


def test_counting_one_measurement_twice_is_seen_to_be_inconsistent(arm: Tendons) -> None:
    """The paper's two equations, with their noises taken as independent."""
    rng = np.random.default_rng(0)
    postures = movement(arm, rng, 400)
    naive = ExtendedKalmanFilter(dim_x=14, dim_z=36)
    naive.x, naive.P, naive.R = postures[0][:, None], 1e-4 * np.eye(14), NOISE**2 * np.eye(36)
    last, nis, nees = None, [], []
    for q in postures:
        measured = arm.lengths(q) + rng.normal(0, NOISE, 36)
        if last is not None:
            inverse = np.linalg.pinv(arm.lengths_and_jacobian(naive.x[:, 0])[1])
            naive.B = inverse
            naive.Q = 2 * NOISE**2 * inverse @ inverse.T + 1e-9 * np.eye(14)
            naive.x = naive.x + (inverse @ (measured - last))[:, None]
            naive.P = naive.P + naive.Q
        last = measured
        naive.update(
            measured[:, None],
            lambda x: arm.lengths_and_jacobian(x[:, 0])[1],
            lambda x: arm.lengths(x[:, 0])[:, None],
        )
        error = naive.x[:, 0] - q
        nis.append((naive.y.T @ naive.SI @ naive.y).item())
        nees.append(error @ np.linalg.solve(naive.P, error))
    assert np.mean(nees[10:]) > 1.2 * 14  # and its covariance is too small
    assert not in_band(np.array(nis[10:]), 36, 0.9999)


def test_a_quadratic_jacobian_serves_as_well(arm: Tendons) -> None:
    rng = np.random.default_rng(3)
    postures = movement(arm, rng, 300)
    options = EstimatorOptions(encoder_noise=NOISE)
    estimator = JointEstimator(QuadraticJacobian(arm), arm.limits, options, postures[0])
    nis, _, errors = follow(estimator, arm, postures, rng)
    assert in_band(nis, 22, 0.999)
    assert np.rad2deg(np.median(errors)) < 0.5


def test_a_wrong_map_is_inconsistent(elbow: Tendons, arm: Tendons) -> None:
    for muscles in (elbow, arm):
        rng = np.random.default_rng(5)
        postures = movement(muscles, rng, 200)
        wrong = rng.normal(0, 5e-3, len(muscles.muscles))
        estimator = started(muscles, postures[0])
        assert estimator.consistency is None
        follow(estimator, muscles, postures[:100], rng)
        right = seen(estimator)
        assert right.low < right.value < right.high
        assert right.consistent
        for q in postures[100:]:
            estimator.update(muscles.lengths(q) + wrong, DT)
        off = seen(estimator)
        assert not off.consistent
        assert off.value > off.high


def test_as_many_joints_as_muscles_leave_nothing_to_check(arm: Tendons) -> None:
    lone = Tendons(("elbow",), ("brachialis",))
    estimator = started(lone, np.array([0.5]))
    estimate = estimator.update(lone.lengths(np.array([0.6])), DT)
    assert estimate.dof == 0
    assert estimator.consistency is None
    assert abs(estimate.q[0] - 0.6) < 0.02


def test_it_finds_the_posture_from_20_degrees_away_in_every_joint(arm: Tendons) -> None:
    low, high = arm.limits.T
    rng = np.random.default_rng(2)
    for _ in range(20):
        q = rng.uniform(low, high)
        start = np.clip(q + np.deg2rad(20) * rng.choice([-1, 1], 14), low, high)
        estimator = started(arm, start, limit_margin=0.05)
        for _ in range(25):
            estimate = estimator.update(arm.lengths(q), DT)
        assert np.abs(estimate.q - q).max() < 1e-3
        assert estimate.nis < 1e-2


def test_a_posture_too_far_to_be_found_is_seen_as_inconsistent(arm: Tendons) -> None:
    low, high = arm.limits.T
    rng = np.random.default_rng(2)
    lost = 0
    for _ in range(20):
        q = rng.uniform(low, high)
        estimator = started(arm, np.zeros(14))
        for _ in range(60):
            estimate = estimator.update(arm.lengths(q), DT)
        consistency = seen(estimator)
        if np.abs(estimate.q - q).max() > np.deg2rad(2):
            lost += 1
            assert consistency.value > consistency.high
    assert 1 <= lost <= 10


def test_a_joint_that_no_muscle_crosses_stays_where_it_was(arm: Tendons) -> None:
    """Without scapula and neck muscles the neck stays, and its variance grows with time."""
    seeing = Tendons(arm.joints, arm.muscles[18:])
    start = np.zeros(14)
    estimator = started(seeing, start)
    before = estimator.covariance
    for _ in range(20):
        estimate = estimator.update(seeing.lengths(start), DT)
    assert np.abs(estimate.q[:3]).max() < 1e-12
    assert np.all(np.diag(estimate.covariance)[:3] > np.diag(before)[:3])
    assert np.isfinite(estimate.covariance).all()


def test_limits_are_kept_and_the_filter_comes_back(arm: Tendons) -> None:
    estimator = started(arm, np.zeros(14), limit_margin=0.05)
    beyond = np.zeros(14)
    beyond[10] = -0.6  # elbow overstretched
    for _ in range(20):
        estimate = estimator.update(arm.lengths(beyond), DT)
        assert np.all(estimate.q >= arm.limits[:, 0] - 0.05 - 1e-12)
        assert np.all(estimate.q <= arm.limits[:, 1] + 0.05 + 1e-12)
    assert estimate.q[10] == pytest.approx(-0.05)
    best = least_squares(
        lambda q: 1e3 * (arm.lengths(q) - arm.lengths(beyond)),
        np.zeros(14),
        bounds=(arm.limits[:, 0] - 0.05, arm.limits[:, 1] + 0.05),
    )
    assert np.abs(estimate.q - best.x).max() < np.deg2rad(1)
    back = np.zeros(14)
    back[10] = 0.5
    for _ in range(5):
        estimate = estimator.update(arm.lengths(back), DT)
    assert np.abs(estimate.q - back).max() < 1e-3


@pytest.mark.parametrize(
    "bad", [np.full(36, np.nan), np.r_[np.inf, np.zeros(35)], np.zeros(35), np.zeros((36, 1))]
)
def test_a_bad_measurement_is_refused_and_harms_nothing(arm: Tendons, bad: np.ndarray) -> None:
    estimator, other = started(arm, np.zeros(14)), started(arm, np.zeros(14))
    good = arm.lengths(np.full(14, 0.05))
    with pytest.raises(EstimatorError, match="lengths must be 36 finite"):
        estimator.update(bad, DT)
    for _ in range(3):
        assert np.array_equal(estimator.update(good, DT).q, other.update(good, DT).q)


def test_an_absurd_measurement_and_a_broken_map_put_no_nan_into_the_state(arm: Tendons) -> None:
    estimator = started(arm, np.zeros(14))
    estimator.update(np.full(36, 1e3), DT)
    assert np.isfinite(estimator.q).all()
    assert np.isfinite(estimator.covariance).all()

    class Broken:
        def lengths_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return np.full(36, np.nan), np.ones((36, q.size))

    before = estimator.q
    with pytest.raises(EstimatorError, match="not finite"):
        estimator.set_map(Broken())
    assert np.array_equal(estimator.q, before)
    estimator.update(arm.lengths(before), DT)
    with pytest.raises(EstimatorError, match="dt is 0"):
        estimator.update(arm.lengths(before), 0)
    with pytest.raises(EstimatorError, match="14 finite"):
        estimator.reset(np.zeros(3))


def test_a_map_that_breaks_in_the_middle_of_a_step_leaves_the_state(arm: Tendons) -> None:
    class Fragile:
        healthy = True

        def lengths_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            lengths, jacobian = arm.lengths_and_jacobian(q)
            return lengths, jacobian if self.healthy else jacobian * np.nan

    source = Fragile()
    estimator = JointEstimator(source, arm.limits, EstimatorOptions(encoder_noise=NOISE))
    estimator.update(arm.lengths(np.zeros(14)), DT)
    q, covariance = estimator.q, estimator.covariance
    source.healthy = False
    with pytest.raises(EstimatorError, match="estimate kept"):
        estimator.update(arm.lengths(np.full(14, 0.1)), DT)
    assert np.array_equal(estimator.q, q)
    assert np.array_equal(estimator.covariance, covariance)


def test_a_new_map_widens_the_covariance_and_is_followed(elbow: Tendons) -> None:
    class Longer:
        def lengths_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            lengths, jacobian = elbow.lengths_and_jacobian(q)
            return lengths + 0.01, jacobian

    estimator = started(elbow, np.array([0.8]))
    estimator.update(elbow.lengths(np.array([0.8])), DT)
    before = estimator.covariance[0, 0]
    estimator.set_map(Longer())
    assert estimator.covariance[0, 0] == pytest.approx(before + 0.2**2)
    for _ in range(3):
        estimate = estimator.update(elbow.lengths(np.array([0.8])) + 0.01, DT)
    assert estimate.q[0] == pytest.approx(0.8, abs=1e-4)
    assert estimate.nis < 1e-3
