"""The clocks experiment: a small run by two clocks, and its comparison with exact stamps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from experiments.clocks.run import CONDITIONS, MUST, QUICK, conclude, ratio_metric, run


def result(error: float) -> dict[str, Any]:
    return {
        "error_deg": error, "hand_mm": 20.0, "map_mm": 2.0 * error, "learned": 27, "dropped": {},
        "skipped": 3, "named": {"never_settled": 1}, "duration": 50.0,
    }  # fmt: skip


def test_every_condition_is_compared_with_exact_stamps_at_its_period() -> None:
    for condition in CONDITIONS.values():
        exact = CONDITIONS[condition.exact]
        assert exact.period == condition.period
        assert exact.guarded == condition.guarded
        assert exact.clock == CONDITIONS["exact_20"].clock


def test_the_upper_end_of_the_interval_must_be_low() -> None:
    assert ratio_metric(dict.fromkeys(range(5), MUST - 0.01))["reached"]
    found = ratio_metric({0: 0.9, 1: 0.95, 2: 1.0, 3: 1.3, 4: 1.4})
    assert found["median"] < MUST < found["high"]
    assert not found["reached"]


def test_errors_are_compared_on_the_same_robot() -> None:
    results = {
        seed: {
            name: result(float(seed) * (1.05 if condition.exact != name else 1.0))
            for name, condition in CONDITIONS.items()
        }
        for seed in (1, 2, 3)
    }
    found = conclude(results, QUICK)
    assert found.metrics["ratio_all_5"]["median"] == pytest.approx(1.05)
    assert found.metrics["ratio_all_5"]["reached"]
    assert found.metrics["error_exact_20"]["median"] == 2.0
    (table,) = found.tables
    assert len(table.rows) == len(CONDITIONS)
    assert table.rows[0][-1] == "3 never_settled"


def test_a_robot_learns_by_a_clock_with_all_deviations(request: pytest.FixtureRequest) -> None:
    cache: Path = request.config.cache.mkdir("maps")
    found = {name: run(name, 0, QUICK, cache) for name in ("exact_50", "all_50")}
    assert found["exact_50"]["learned"] == found["all_50"]["learned"] == QUICK.learned
    assert found["exact_50"]["skipped"] == 0 < found["all_50"]["skipped"]
    assert found["exact_50"]["named"] == found["all_50"]["named"] == {}
    assert found["all_50"]["error_deg"] < 2.0 * found["exact_50"]["error_deg"]
