"""Evidence, compared with dense marginal likelihoods."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from reality_gap.inference import evidence
from reality_gap.inference.evidence import PRIOR, SIZES, complexity, fit_normal, occam
from reality_gap.types import Floats

Problem = tuple[Floats, Floats]


@st.composite
def problems(draw: st.DrawFn) -> Problem:
    """Whitened columns (n, p) and a whitened residual (n,)."""
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    n, p = draw(st.integers(5, 15)), draw(st.integers(1, 4))
    columns = draw(st.sampled_from([0.01, 1.0, 10.0])) * rng.standard_normal((n, p))
    return columns, columns @ rng.normal(0.0, 2.0, p) + rng.standard_normal(n)


def free(count: int) -> Floats:
    return np.full(count, np.inf)


def one_cause(count: int) -> NDArray[np.int64]:
    return np.zeros(count, dtype=np.int64)


def log_ratio(columns: Floats, residual: Floats, deviation: float) -> float:
    """Return the log evidence of normal weights of the columns [nats]."""
    noise = np.eye(len(residual))
    with_columns = noise + deviation**2 * columns @ columns.T
    return float(
        multivariate_normal.logpdf(residual, cov=with_columns)
        - multivariate_normal.logpdf(residual, cov=noise)
    )


@given(problems())
def test_with_one_size_of_prior_the_evidence_is_exact(problem: Problem) -> None:
    columns, residual = problem
    p = columns.shape[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evidence, "SIZES", (PRIOR,))
        found = fit_normal(
            columns.T @ columns, columns.T @ residual, -free(p), free(p), one_cause(p)
        )

    assert found.evidence == pytest.approx(log_ratio(columns, residual, PRIOR), abs=1e-6)


@given(problems())
def test_without_bounds_theta_is_the_posterior_mean(problem: Problem) -> None:
    columns, residual = problem
    p = columns.shape[1]

    found = fit_normal(columns.T @ columns, columns.T @ residual, -free(p), free(p), one_cause(p))

    inside = np.eye(len(residual)) + PRIOR**2 * columns @ columns.T
    expected = PRIOR**2 * columns.T @ np.linalg.solve(inside, residual)
    np.testing.assert_allclose(found.theta, expected, atol=1e-6)


@given(problems())
def test_bounds_are_respected_at_the_best_point_within(problem: Problem) -> None:
    """The slope of the log posterior is zero between bounds, and points outwards at a bound."""
    columns, residual = problem
    gram, right = columns.T @ columns, columns.T @ residual
    low, high = np.full(len(right), -0.5), np.full(len(right), 1.0)

    theta = fit_normal(gram, right, low, high, one_cause(len(right))).theta

    assert np.all((low <= theta) & (theta <= high))
    slope = right - gram @ theta - theta / PRIOR**2
    small = 1e-5 * (1.0 + np.abs(right))
    assert np.all((slope < small) | (theta > high - 1e-4))
    assert np.all((slope > -small) | (theta < low + 1e-4))


def test_a_bound_costs_evidence() -> None:
    gram, right = np.array([[100.0]]), np.array([-50.0])

    free_to_fall = fit_normal(gram, right, -free(1), free(1), one_cause(1))
    held = fit_normal(gram, right, np.zeros(1), free(1), one_cause(1))

    assert free_to_fall.theta == pytest.approx([-0.5], rel=0.01)
    assert held.theta == pytest.approx([0.0], abs=1e-9)
    assert free_to_fall.evidence > 0.0 > held.evidence


def small_model() -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.bool_]]:
    """Return information, theta, cause and flatness of five parameters of three causes."""
    root = np.random.default_rng(0).standard_normal((8, 5)) * [0.3, 1.0, 3.0, 10.0, 1.0]
    theta, cause = np.array([0.1, -1.0, 0.3, 2.0, 5.0]), np.array([0, 1, 1, 2, -1])
    return root.T @ root, theta, cause, np.array([False, False, False, True, False])


def test_the_order_of_causes_and_parameters_does_not_matter() -> None:
    gram, theta, cause, flat = small_model()
    turn = np.random.default_rng(1).permutation(5)
    renamed = np.array([2, 0, 1, -1])[cause]  # the last is that of -1

    there = complexity(gram[np.ix_(turn, turn)], theta[turn], renamed[turn], flat[turn])

    assert there == pytest.approx(complexity(gram, theta, cause, flat), rel=1e-9)


def averaged(gram: Floats, theta: Floats, cause: NDArray[np.int64]) -> float:
    """Return the penalty as an average over all combinations of sizes [nats]."""
    found = []
    for sizes in product(SIZES, repeat=int(cause.max()) + 1):
        deviation = np.array(sizes)[cause]
        ratio = np.eye(len(theta)) + deviation[:, None] * gram * deviation
        distance = float(np.sum((theta / deviation) ** 2))
        found.append(-0.5 * (distance + float(np.linalg.slogdet(ratio)[1])))
    return float(np.log(len(found)) - np.logaddexp.reduce(found))


@pytest.mark.parametrize("shared", [0.0, 1.0, 30.0])
@pytest.mark.parametrize("seed", range(6))
def test_the_penalty_of_several_causes_is_the_average_over_their_sizes(
    seed: int, shared: float
) -> None:
    """Also where columns are alike, and where readings hardly show some of them."""
    rng = np.random.default_rng(seed)
    cause = np.repeat(np.arange(4), rng.integers(1, 4, 4))
    p = len(cause)
    columns = rng.standard_normal((30, p)) + shared * rng.standard_normal((30, 1))
    columns *= 10.0 ** rng.uniform(-2.0, 2.0, p)
    theta = rng.standard_normal(p) * 10.0 ** rng.uniform(-1.0, 1.5, p)
    gram = columns.T @ columns

    found = complexity(gram, theta, cause, np.zeros(p, dtype=np.bool_))

    assert found == pytest.approx(averaged(gram, theta, cause), abs=0.1)


@pytest.mark.parametrize("seed", range(6))
def test_causes_that_predict_the_same_are_penalised_more_and_never_less(seed: int) -> None:
    """By up to 2 nats: the sizes of such causes are not independent."""
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((30, 1)) + 0.02 * rng.standard_normal((30, 4))
    gram, cause = columns.T @ columns, np.arange(4)
    theta = np.linalg.solve(gram + np.eye(4) / PRIOR**2, gram @ (10.0 * rng.standard_normal(4)))

    found = complexity(gram, theta, cause, np.zeros(4, dtype=np.bool_))

    assert -0.1 < found - averaged(gram, theta, cause) < 2.0


@pytest.mark.parametrize("seed", range(5))
def test_the_penalty_grows_with_information(seed: int) -> None:
    gram, theta, cause, flat = small_model()
    more = np.random.default_rng(seed).standard_normal((2, 5))

    assert complexity(gram + more.T @ more, theta, cause, flat) > complexity(
        gram, theta, cause, flat
    )


@pytest.mark.parametrize("owner", [0, 3, -1])
def test_a_parameter_that_the_data_do_not_show_costs_nothing(owner: int) -> None:
    """It belongs to an existing cause, to a new one, or to none."""
    gram, theta, cause, flat = small_model()
    wider = np.zeros((6, 6))
    wider[:5, :5] = gram

    found = complexity(
        wider, np.append(theta, 0.0), np.append(cause, owner), np.append(flat, False)
    )

    assert found == pytest.approx(complexity(gram, theta, cause, flat), rel=1e-9)


def penalty(theta: float, information: float, cause: int = 0, flat: bool = False) -> float:
    """Return the penalty for one parameter [nats]."""
    return complexity(
        np.array([[information]]), np.array([theta]), np.array([cause]), np.array([flat])
    )


def penalty_of_size(theta: float, information: float, size: float) -> float:
    """Return the penalty for one parameter with a known prior deviation, by Laplace [nats]."""
    return 0.5 * (theta / size) ** 2 + 0.5 * np.log(1.0 + size**2 * information)


@pytest.mark.parametrize("information", [1.0, 1e2, 1e4])
@pytest.mark.parametrize("theta", [0.0, 0.1, 1.0, 6.0])
def test_the_penalty_is_that_of_the_right_size_and_of_not_knowing_it(
    theta: float, information: float
) -> None:
    """A mean of likelihoods is at most the best of them, and at least its share."""
    best = min(penalty_of_size(theta, information, size) for size in SIZES)

    assert best <= penalty(theta, information) <= best + np.log(len(SIZES))


def test_a_small_fault_does_not_pay_for_a_large_scale() -> None:
    """In a tenth of the scale, a fault of 0.1 is one of 1; both penalties are similar."""
    large, small = penalty(0.1, 1e4), penalty(1.0, 1e2)

    assert large - small < 0.5 * np.log(10.0)
    assert penalty_of_size(0.1, 1e4, PRIOR) - penalty_of_size(1.0, 1e2, PRIOR) > 0.95 * np.log(10.0)


@pytest.mark.parametrize("theta", [0.0, 0.1, 6.0])
def test_without_a_cause_of_its_own_the_deviation_is_the_usual_one(theta: float) -> None:
    assert penalty(theta, 50.0, cause=-1) == pytest.approx(penalty_of_size(theta, 50.0, PRIOR))


def test_the_value_of_a_flat_parameter_is_not_penalised() -> None:
    penalties = [penalty(theta, 50.0, flat=True) for theta in (0.0, 1.0, 100.0)]

    np.testing.assert_allclose(penalties, penalty_of_size(0.0, 50.0, PRIOR))


@given(problems())
def test_occam_is_half_the_log_determinant(problem: Problem) -> None:
    columns, _ = problem
    ratio = np.linalg.det(np.eye(len(columns)) + PRIOR**2 * columns @ columns.T)

    assert occam(columns.T @ columns) == pytest.approx(0.5 * np.log(ratio), rel=1e-6, abs=1e-9)
