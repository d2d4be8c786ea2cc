"""Gaps in time stamps."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.gap_detector import GapDetector


@pytest.mark.parametrize("begin", [0.0, 1.7e9])
@pytest.mark.parametrize("period", [0.005, 0.02, 0.05])
def test_jitter_and_lost_cycles_are_no_gaps_at_any_period(period: float, begin: float) -> None:
    rng = np.random.default_rng(0)
    times = period * np.arange(1000) + rng.uniform(0.0, 0.3 * period, 1000)
    detector = GapDetector()
    kept = times[rng.uniform(size=1000) > 0.05]
    assert [detector.update(begin + time) for time in kept] == [0.0] * len(kept)


def test_a_gap_is_what_is_longer_than_a_period() -> None:
    detector = GapDetector()
    times = [0.0, 0.02, 0.04, 10.06, 10.08]
    assert [detector.update(time) for time in times] == pytest.approx([0, 0, 0, 10.0, 0])


def test_a_slow_robot_has_its_own_period() -> None:
    detector = GapDetector()
    found = [detector.update(0.5 * k) for k in range(20)]
    assert found[2:] == [0.0] * 18


def test_a_clock_that_is_set_back_counts_as_one_period() -> None:
    detector = GapDetector()
    steps = [detector.update(time) for time in (5.0, 5.02, 1.0, 1.02)]
    assert steps == pytest.approx([0.0, 0.0, -4.04, 0.0])


@pytest.mark.parametrize("period", [0.005, 0.02, 0.05])
def test_more_than_five_periods_are_a_gap_and_a_late_cycle_before_changes_that_little(
    period: float,
) -> None:
    steps = np.array([1, 1, 1, 1, 4, 5.5, 1, 1, 4.5])
    detector = GapDetector()
    found = [detector.update(time) for time in period * np.cumsum(steps)]
    assert found == pytest.approx([0, 0, 0, 0, 0, 4.5 * period, 0, 0, 0])


def test_a_single_long_step_is_no_period() -> None:
    detector = GapDetector()
    shortest = []
    for time in (0.0, 10.0, 20.0, 20.02):
        detector.update(time)
        shortest.append(detector.shortest)
    assert shortest == pytest.approx([0.0, 0.0, 10.0, 0.02])
