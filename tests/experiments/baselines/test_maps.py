"""Maps of the baselines: start at the nominal model, learn pairs, and interpolate smoothly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from experiments.baselines.maps import (
    Baselines,
    CorrectedMap,
    Polynomial,
    RadialCorrelation,
    Regression,
    Table,
    TermCorrelation,
)
from jmm_agent.mapping.learner import Pairs
from jmm_agent.types import Floats
from tests.jmm_agent.small_map import make_map, postures

METHODS: dict[str, Callable[[Baselines, Pairs], CorrectedMap]] = {
    "polynomial 2": lambda baselines, pairs: baselines.polynomial(2, pairs),
    "polynomial 4": lambda baselines, pairs: baselines.polynomial(4, pairs),
    "table": lambda baselines, pairs: baselines.table(pairs),
    "process": lambda baselines, pairs: baselines.process(pairs),
}
ASKED = postures(40, 50)


@pytest.fixture(scope="module")
def baselines() -> Baselines:
    return Baselines(make_map(0), postures(200, 9))


def measured(count: int, missed: Callable[[Floats], Floats]) -> Pairs:
    """Pairs of a robot that departs from the nominal model by a function (B, n) -> (B, 1) [m]."""
    asked = postures(count, 3)
    return Pairs(asked, make_map(0).lengths(asked) + missed(asked), np.full(count, 0.001))


@pytest.mark.parametrize("name", ["table", "process"])
def test_before_anything_is_measured_the_map_is_the_drawing(
    baselines: Baselines, name: str
) -> None:
    found = METHODS[name](baselines, Pairs.none(4, 5))
    np.testing.assert_allclose(found.lengths(ASKED), make_map(0).lengths(ASKED), atol=1e-15)


def test_polynomials_come_nearer_to_the_drawing_by_degree(baselines: Baselines) -> None:
    nominal = make_map(0).lengths(ASKED)
    missed = [
        np.abs(baselines.polynomial(degree, Pairs.none(4, 5)).lengths(ASKED) - nominal).max()
        for degree in (2, 3, 4)
    ]
    assert missed[0] > missed[1] > missed[2]
    assert missed[2] < 0.1 * np.ptp(nominal)


@pytest.mark.parametrize("name", METHODS)
def test_an_offset_is_learned_for_all_postures(baselines: Baselines, name: str) -> None:
    make = METHODS[name]
    before = make(baselines, Pairs.none(4, 5)).lengths(ASKED)
    after = make(baselines, measured(12, lambda q: np.full((len(q), 1), 0.02)))
    np.testing.assert_allclose(after.lengths(ASKED) - before, 0.02, atol=0.004)


@pytest.mark.parametrize("name", METHODS)
def test_what_was_measured_is_explained(baselines: Baselines, name: str) -> None:
    pairs = measured(12, lambda q: 0.02 + 0.01 * q[:, 1:2])
    found = METHODS[name](baselines, pairs)
    before = np.abs(make_map(0).lengths(pairs.postures) - pairs.lengths).mean()
    after = np.abs(found.lengths(pairs.postures) - pairs.lengths).mean()
    assert after < 0.1 * before


@pytest.mark.parametrize("name", METHODS)
def test_the_jacobian_is_the_slope_of_the_lengths(baselines: Baselines, name: str) -> None:
    found = METHODS[name](baselines, measured(12, lambda q: 0.01 * np.sin(3.0 * q[:, 1:2])))
    here, step = ASKED[0], 1e-3 * np.array([0.3, -0.5, 0.7, 0.2])
    lengths, jacobian = found.lengths_and_jacobian(here)
    np.testing.assert_allclose(lengths, found.lengths(here), atol=1e-12)
    moved = found.lengths(here + step) - found.lengths(here - step)
    np.testing.assert_allclose(jacobian @ (2.0 * step), moved, atol=1e-7)
    assert np.abs(moved).max() > 1e-5


def test_a_polynomial_has_all_products_up_to_its_degree() -> None:
    terms = Polynomial(np.array([-1.0, 0.0]), np.array([1.0, 2.0]), 2)
    x, y = 0.5, 1.25 - 1.0
    np.testing.assert_allclose(terms(np.array([[0.5, 1.25]])), [[x, y, x * x, x * y, y * y]])


def test_terms_have_a_variance_of_one_on_average() -> None:
    typical = postures(300, 9)[:, :2]
    correlation = TermCorrelation(Polynomial(typical.min(axis=0), typical.max(axis=0), 3), typical)
    assert np.mean(np.diag(correlation(typical, typical))) == pytest.approx(1.0)


def test_a_regression_chooses_the_width_that_its_residuals_show() -> None:
    inputs = np.linspace(-3.0, 3.0, 60)[:, None]
    widths = [RadialCorrelation(0.25), RadialCorrelation(4.0)]
    for quick, width in ((6.0, 0.25), (0.5, 4.0)):
        residuals = 0.01 * np.sin(quick * inputs)
        found = Regression(inputs, residuals, widths, 0.025)
        assert found.chosen.correlation == RadialCorrelation(width)
        between = inputs[:-1] + 0.05
        np.testing.assert_allclose(found(between), 0.01 * np.sin(quick * between), atol=0.002)


def test_a_regression_far_from_its_inputs_keeps_the_offset_alone() -> None:
    inputs = np.linspace(-0.5, 0.5, 30)[:, None]
    found = Regression(
        inputs, 0.02 + 0.005 * np.sin(8.0 * inputs), [RadialCorrelation(0.25)], 0.025
    )
    np.testing.assert_allclose(found(np.array([[50.0]])), 0.02, atol=0.003)


def test_a_table_returns_its_entries_and_interpolates_between_them() -> None:
    table = Table(np.array([[0.0], [1.0]]), np.array([[0.01, 0.0], [0.03, 0.02]]))
    np.testing.assert_allclose(table(np.array([[1.0]])), [[0.03, 0.02]], atol=1e-12)
    np.testing.assert_allclose(table(np.array([[0.5]])), [[0.02, 0.01]], atol=1e-12)


def test_a_table_asks_the_nearest_entries_only() -> None:
    inputs = np.arange(20.0)[:, None]
    table = Table(inputs, np.where(inputs < 10.0, 0.0, 1.0))
    assert table(np.array([[2.2]]))[0, 0] == 0.0
