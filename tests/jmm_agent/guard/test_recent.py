"""Values of the last seconds: the same span of time at any control period."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.guard.recent import Recent


@pytest.mark.parametrize("period", [0.005, 0.01, 0.02, 0.025, 0.05])
def test_it_covers_the_duration_and_no_more(period: float) -> None:
    recent, count = Recent[int](0.5), round(0.5 / period)
    for k in range(count - 1):
        recent.add(period, k)
    assert not recent.full
    for k in range(count - 1, 100_000):
        recent.add(period, k)
    assert recent.full
    assert recent.values == list(range(100_000 - count, 100_000))
    assert recent.oldest == 100_000 - count
    assert recent.newer(0.1) == recent.values[-round(0.1 / period) :]
    assert recent.older(0.4) == recent.values[: count - round(0.4 / period)]


def test_each_age_has_the_value_that_stood_then() -> None:
    recent = Recent[str](1.0)
    for dt, value in ((0.1, "a"), (0.02, "b"), (0.05, "c"), (0.03, "d")):
        recent.add(dt, value)
    ages = [0.0, 0.02, 0.03, 0.07, 0.08, 0.099, 0.1, 5.0]
    assert [value for _, value in recent.at(ages)] == list("ddccbbaa")
    assert [number for number, _ in recent.at(ages)] == [0, 0, 1, 1, 2, 2, 3, 3]


def test_jitter_changes_the_covered_time_by_less_than_a_step() -> None:
    recent, rng = Recent[float](0.5), np.random.default_rng(0)
    for _ in range(1000):
        dt = 0.02 * (1.0 + 0.6 * rng.uniform(-1.0, 1.0))
        recent.add(dt, dt)
    assert 0.5 <= sum(recent.values) < 0.54
