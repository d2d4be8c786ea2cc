"""The power cycle: robots that are zeroed anew, and how their errors are compared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.power_cycle.robot import CHANGE, ONE, departures, own_lengths
from experiments.power_cycle.run import (
    ANNOUNCED,
    FRESH,
    MUSCLES,
    NONE,
    OTHERS,
    POSTURE,
    QUICK,
    UNANNOUNCED,
    ZEROED,
    conclude,
    run,
)  # fmt: skip
from experiments.power_cycle.run import (
    ONE as ONE_MUSCLE,
)
from experiments.robots.world import known_world


def cache_of(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


@pytest.mark.parametrize("cycle", [MUSCLES, POSTURE])
def test_all_lengths_change_by_three_to_four_millimetres(
    cycle: str, request: pytest.FixtureRequest
) -> None:
    world = known_world(cache_of(request))
    postures = world.postures[7:12]
    before, after = (
        own_lengths(departures(name, 3, world), 3, postures, world) for name in (NONE, cycle)
    )
    change = after - before
    assert 0.7 * CHANGE < np.sqrt(np.mean(change**2)) < 1.4 * CHANGE
    assert np.abs(change - change.mean(axis=0)).max() < 5e-4  # the same at all postures
    assert (np.abs(change.mean(axis=0)) > 1e-4).mean() > 0.7


def test_a_single_muscle_is_elongated(request: pytest.FixtureRequest) -> None:
    world = known_world(cache_of(request))
    before, after = (
        own_lengths(departures(name, 3, world), 3, world.postures[:1], world)
        for name in (NONE, ONE_MUSCLE)
    )
    assert np.sort(np.abs(after - before)[0])[-2:] == pytest.approx([0.0, ONE], abs=5e-4)


def agent(errors: list[float], named: int | None = None) -> dict[str, Any]:
    return {
        "error_deg": errors, "named_after": named, "learned": 2, "elongated": [], "dropped": {}
    }  # fmt: skip


def test_the_worst_number_of_postures_counts_and_every_alarm() -> None:
    fresh, worse = agent([9.0, 8.0, 7.0]), agent([3.0, 10.0, 1.3])
    entry = {"before_deg": 1.0, "learned": 6, ANNOUNCED: agent([3.0, 2.0, 1.1]), FRESH: fresh}
    plain = {"before_deg": 1.0, "learned": 6, UNANNOUNCED: agent([1.0, 1.0, 1.0])}
    alarm = {**plain, UNANNOUNCED: agent([1.0, 1.0, 1.0], 2)}
    results = {
        seed: {
            **{cycle: {**entry, UNANNOUNCED: {**worse, "named_after": 1}} for cycle in ZEROED},
            ONE_MUSCLE: plain,
            NONE: alarm if seed == 2 else plain,
        }
        for seed in range(3)
    }
    metrics = conclude(results, QUICK).metrics
    assert metrics["muscles_announced_to_fresh"]["reached"]
    assert metrics["muscles_announced_to_fresh"]["postures"] == 0
    assert not metrics["muscles_unannounced_to_fresh"]["reached"]
    assert metrics["muscles_unannounced_to_fresh"]["median"] == 1.25
    assert metrics["muscles_announced_to_before"]["reached"]
    assert not metrics["muscles_unannounced_to_before"]["reached"]
    assert metrics["muscles_noticed"]["median"] == 1.0
    assert metrics[f"{ONE_MUSCLE}_false_alarms"]["reached"]
    assert not metrics[f"{NONE}_false_alarms"]["reached"]
    assert set(OTHERS) == {ONE_MUSCLE, NONE}
    results[1] = {**results[1], MUSCLES: {**results[1][MUSCLES], UNANNOUNCED: worse}}
    noticed = conclude(results, QUICK).metrics["muscles_noticed"]
    assert (noticed["median"], noticed["worst"]) == (1.0, 0.0)


def test_the_error_after_all_postures_is_compared_with_that_before() -> None:
    lost = agent([3.0, 1.0, 2.6])
    entry = {
        "before_deg": 2.0,
        "learned": 6,
        **dict.fromkeys((ANNOUNCED, UNANNOUNCED, FRESH), lost),
    }
    results = {seed: dict.fromkeys((*ZEROED, *OTHERS), entry) for seed in range(3)}
    found = conclude(results, QUICK)
    assert found.metrics["muscles_announced_to_before"]["median"] == pytest.approx(1.3)
    assert not found.metrics["muscles_announced_to_before"]["reached"]
    [table] = [one for one in found.tables if one.title.startswith("Error over that before")]
    assert table.rows[0][1:] == (ANNOUNCED, "1.50 (1.50)", "0.50 (0.50)", "1.30 (1.30)")
    assert len(table.rows) == len(ZEROED) * 2


def test_the_error_must_be_that_of_before_within_three_postures() -> None:
    slow = agent([3.0, 3.0, 3.0, 2.6, 2.0])
    entry = {
        "before_deg": 2.0,
        "learned": 6,
        **dict.fromkeys((ANNOUNCED, UNANNOUNCED, FRESH), slow),
    }
    results = {seed: dict.fromkeys((*ZEROED, *OTHERS), entry) for seed in range(3)}
    found = conclude(results, replace(QUICK, after=4)).metrics
    assert found["posture_announced_to_before"]["reached"]
    assert found["posture_announced_to_before_at_3"]["median"] == pytest.approx(1.3)
    assert not found["posture_announced_to_before_at_3"]["reached"]


@pytest.mark.slow
def test_lengths_are_zeroed_and_each_agent_learns_on(request: pytest.FixtureRequest) -> None:
    found = run(MUSCLES, 0, QUICK, cache_of(request))
    for name in (ANNOUNCED, UNANNOUNCED, FRESH):
        assert len(found[name]["error_deg"]) == 1 + QUICK.after
    assert found[ANNOUNCED]["error_deg"][-1] < found[FRESH]["error_deg"][-1]
    assert found[ANNOUNCED]["named_after"] is None
