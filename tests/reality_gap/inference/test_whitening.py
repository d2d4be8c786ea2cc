"""Whitening, compared with dense covariances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reality_gap.inference.whitening import (
    explained_by_tolerances,
    likeliest_sizes,
    variance_inflation,
    whitening,
)
from reality_gap.types import Bools, Floats

Case = tuple[Floats, Floats, Bools]


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """Tolerances (n, p), inflation (n,), and which readings are in use (n,)."""
    rng = np.random.default_rng(draw(st.integers(0, 2**31)))
    n, p = draw(st.integers(4, 20)), draw(st.integers(1, 6))
    tolerances = draw(st.sampled_from([0.1, 1.0, 30.0])) * rng.standard_normal((n, p))
    use = rng.random(n) < 0.7
    use[0] = True
    return tolerances, rng.uniform(1.0, 20.0, n), use


def covariance(tolerances: Floats, inflation: Floats) -> Floats:
    """Return D + N N' (n, n)."""
    return np.diag(inflation) + tolerances @ tolerances.T


@given(cases())
def test_whitened_residuals_have_unit_covariance(case: Case) -> None:
    tolerances, inflation, use = case
    white = whitening(tolerances, inflation, use)

    matrix = white(np.eye(len(use)))

    np.testing.assert_allclose(
        matrix @ covariance(tolerances, inflation) @ matrix.T, np.eye(use.sum()), atol=1e-5
    )
    np.testing.assert_array_equal(matrix[:, ~use], 0.0)


@given(cases(), st.integers(0, 2**31))
def test_the_square_of_a_residual_is_that_under_the_covariance(case: Case, seed: int) -> None:
    tolerances, inflation, use = case
    residual = np.random.default_rng(seed).standard_normal(len(use))

    whitened = whitening(tolerances, inflation, use)(residual)

    inside = covariance(tolerances, inflation)[np.ix_(use, use)]
    expected = residual[use] @ np.linalg.solve(inside, residual[use])
    assert np.sum(whitened**2) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("largest", [1e2, 1e4, 1e5])
def test_small_tolerances_count_beside_large_ones(largest: float) -> None:
    """What deviations of one tolerance each do is explained to within their prior."""
    rng = np.random.default_rng(0)
    tolerances = rng.standard_normal((300, 8)) @ rng.standard_normal((8, 8))
    tolerances *= np.geomspace(1.0, largest, 8)
    residual = tolerances @ np.where(rng.random(8) < 0.5, -1.0, 1.0)

    whitened = whitening(tolerances, np.ones(300), np.ones(300, bool))(residual)

    assert np.sum(whitened**2) <= 8.01


def test_columns_are_whitened_one_by_one() -> None:
    rng = np.random.default_rng(0)
    tolerances, columns = rng.standard_normal((10, 2)), rng.standard_normal((10, 3))
    white = whitening(tolerances, np.full(10, 2.0), np.arange(10) % 3 > 0)

    expected = np.column_stack([white(column) for column in columns.T])

    np.testing.assert_allclose(white(columns), expected, atol=1e-12)


@pytest.mark.parametrize("power", [0.01, 1.0, 400.0])
def test_the_effect_of_a_tolerance_shrinks_by_its_power(power: float) -> None:
    direction = np.random.default_rng(1).standard_normal(12)
    tolerance = np.sqrt(power) * direction / np.linalg.norm(direction)
    white = whitening(tolerance[:, None], np.ones(12), np.ones(12, dtype=bool))

    np.testing.assert_allclose(white(tolerance), tolerance / np.sqrt(1.0 + power), rtol=1e-9)


def test_without_tolerances_readings_count_by_their_inflation() -> None:
    residual, use = np.arange(1.0, 5.0), np.array([True, False, True, True])
    white = whitening(np.zeros((4, 0)), np.array([1.0, 1.0, 4.0, 16.0]), use)

    np.testing.assert_allclose(white(residual), [1.0, 3.0 / 2.0, 4.0 / 4.0])


def autoregressive(rho: float, count: int, seed: int) -> Floats:
    """Return x (count,) with x[k] = rho x[k-1] + noise."""
    noise = np.random.default_rng(seed).standard_normal(count)
    values = np.empty(count)
    last = noise[0] / np.sqrt(1.0 - rho**2)
    for k in range(count):
        values[k] = last = rho * last + noise[k]
    return values


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 0.9])
def test_an_autocorrelated_remainder_counts_less(rho: float) -> None:
    """The integrated autocorrelation of an AR(1) process is (1 + rho) / (1 - rho)."""
    found = variance_inflation(autoregressive(rho, 20000, seed=2), np.zeros(20000, dtype=int))

    assert np.ptp(found) == 0.0
    assert found[0] == pytest.approx((1.0 + rho) / (1.0 - rho), rel=0.15)


def test_each_channel_has_its_own_inflation() -> None:
    white, red = autoregressive(0.0, 20000, seed=3), 50.0 + autoregressive(0.8, 20000, seed=4)
    turns = np.column_stack([white, red]).ravel()

    found = variance_inflation(turns, np.tile([0, 1], 20000))

    np.testing.assert_allclose(found[:2], [1.0, 9.0], rtol=0.15)


def test_alternating_short_and_constant_signals_count_in_full() -> None:
    alternates, short, constant = np.tile([1.0, -1.0], 50), np.linspace(0, 1, 7), np.full(40, 3.0)
    groups = np.repeat([0, 1, 2], [100, 7, 40])

    found = variance_inflation(np.concatenate([alternates, short, constant]), groups)

    np.testing.assert_array_equal(found, 1.0)


@given(cases(), st.integers(0, 2**31))
def test_the_part_that_tolerances_explain_is_the_posterior_mean(case: Case, seed: int) -> None:
    """E[N s | r in use], s and noise normal: N N'[:, use] C[use, use]^-1 r[use]."""
    tolerances, inflation, use = case
    residual = np.random.default_rng(seed).standard_normal(len(use))

    found = explained_by_tolerances(tolerances, inflation, use, residual)

    inside = covariance(tolerances, inflation)[np.ix_(use, use)]
    expected = (tolerances @ tolerances.T)[:, use] @ np.linalg.solve(inside, residual[use])
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_deviations_of_several_residuals_are_those_of_each() -> None:
    rng = np.random.default_rng(0)
    tolerances, residuals = rng.standard_normal((40, 3)), rng.standard_normal((40, 2))
    inflation, use = rng.uniform(1.0, 4.0, 40), np.arange(40) < 30

    both = likeliest_sizes(tolerances, inflation, use, residuals)

    each = [likeliest_sizes(tolerances, inflation, use, one) for one in residuals.T]
    np.testing.assert_allclose(both, np.column_stack(each), atol=1e-12)
    assert likeliest_sizes(tolerances[:, :0], inflation, use, residuals[:, 0]).shape == (0,)
