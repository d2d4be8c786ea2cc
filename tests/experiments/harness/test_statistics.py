"""Statistics over robots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.harness.report import metric_table
from experiments.harness.statistics import interval, metric, paired

NUMBERS = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=20)


@given(NUMBERS)
def test_the_interval_holds_the_median_within_the_numbers(values: list[float]) -> None:
    found = interval(values)
    assert min(values) <= found.low <= found.median <= found.high <= max(values)
    assert found.median == np.median(values)
    assert found == interval(values)


def test_the_interval_covers_the_true_median_at_about_its_level() -> None:
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(200):
        found = interval(rng.normal(3.0, 1.0, 15))
        held += found.low <= 3.0 <= found.high
    assert 0.88 <= held / 200 <= 0.99


def test_the_interval_narrows_with_more_robots() -> None:
    rng = np.random.default_rng(2)
    few, many = interval(rng.normal(size=8)), interval(rng.normal(size=200))
    assert many.high - many.low < 0.5 * (few.high - few.low)


def test_pairing_takes_out_what_differs_between_robots() -> None:
    rng = np.random.default_rng(3)
    robots = rng.normal(0.0, 50.0, 12)
    better = robots - 1.0 + 0.1 * rng.normal(size=12)
    found = paired(better, robots)
    assert found.high < 0.0
    assert found.median == pytest.approx(-1.0, abs=0.2)


@pytest.mark.parametrize("values", [[], [1.0, float("nan")], [float("inf")]])
def test_what_is_no_number_is_refused(values: list[float]) -> None:
    with pytest.raises(ValueError, match="finite"):
        interval(values)


def test_a_metric_compares_the_median_with_its_threshold() -> None:
    errors = {100: 2.0, 101: 4.0, 102: 9.0}
    assert metric(errors, "deg", must=4.0)["reached"] is True
    assert metric(errors, "deg", must=3.9)["reached"] is False
    assert metric(errors, "deg")["reached"] is None
    assert metric(errors, "deg")["worst"] == 9.0
    share = metric(errors, "", must=4.5, good="high")
    assert share["reached"] is False
    assert share["worst"] == 2.0
    assert set(share) == {
        "unit", "paper", "median", "worst", "low", "high", "must", "by", "reached",
    }  # fmt: skip


def test_a_threshold_may_be_for_the_worst_robot_or_the_end_of_the_interval() -> None:
    errors = [1.0, 2.0, 3.0, 4.0, 9.0]
    assert metric(errors, "deg", must=3.0)["reached"]
    assert not metric(errors, "deg", must=8.9, by="worst")["reached"]
    assert metric(errors, "deg", must=9.0, by="worst")["reached"]
    assert not metric(errors, "", must=2.0, good="high", by="worst")["reached"]
    high = metric(errors, "deg")["high"]
    assert not metric(errors, "deg", must=high - 0.1, by="high")["reached"]
    rows = metric_table({"a": metric(errors, "", 3.0), "b": metric(errors, "", 9.0, by="worst")})
    assert [row[5] for row in rows.rows] == ["3.0", "9.0 (worst)"]
