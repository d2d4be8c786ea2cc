"""The agent's own time by any clock: it never repeats, goes back or jumps."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import CLOCK_JUMPED, STAMPS_SKIPPED
from jmm_agent.time_line import TimeLine, TimeLineOptions

PERIODS = [0.005, 0.02, 0.05]


def times(line: TimeLine, stamps: np.ndarray) -> np.ndarray:
    """The agent's time [s] at each stamp that is used."""
    found = []
    for stamp in stamps.tolist():
        tick = line.tick(stamp)
        if tick is not None:
            line.accept(tick)
            found.append(tick.time)
    return np.array(found)


def kinds(line: TimeLine) -> list[str]:
    return [fault.kind for fault in line.found()]


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("begin", [0.0, -3.0, 1.7e9])
def test_stamps_that_increase_are_the_time_to_the_bit(period: float, begin: float) -> None:
    line, rng = TimeLine(TimeLineOptions()), np.random.default_rng(0)
    stamps = begin + period * (np.arange(500) + rng.uniform(-0.3, 0.3, 500))
    stamps = stamps[rng.random(500) > 0.05]
    np.testing.assert_array_equal(times(line, stamps), stamps)
    assert line.skipped == line.jumps == 0
    assert kinds(line) == []


@pytest.mark.parametrize("period", PERIODS)
def test_repeated_and_backward_stamps_are_skipped_and_counted(period: float) -> None:
    line, rng = TimeLine(TimeLineOptions()), np.random.default_rng(0)
    stamps = period * np.arange(1000.0)
    wrong = rng.choice(np.arange(1, 1000), 50, replace=False)
    stamps[wrong] -= rng.choice([period, 3.0 * period, 0.1], 50)
    found = times(line, stamps)
    newest = np.maximum.accumulate(stamps)
    assert line.skipped == np.sum(stamps[1:] <= newest[:-1]) > 40
    np.testing.assert_array_equal(found, np.unique(newest))
    assert np.all(np.diff(found) > 0.0)
    assert line.jumps == 0
    assert kinds(line) == []


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("by", [3600.0, -3600.0, 10.0, -0.5, 1.7e9, -1.7e9])
def test_a_clock_that_is_set_is_named_and_time_goes_on(period: float, by: float) -> None:
    line, count = TimeLine(TimeLineOptions()), round(10.0 / period)
    stamps = 1.75e9 + period * np.arange(2.0 * count)
    stamps[count:] += by
    before = times(line, stamps[:count])
    assert kinds(line) == []
    after = times(line, stamps[count : count + round(0.5 / period)])
    assert kinds(line) == [CLOCK_JUMPED]
    assert after[0] == pytest.approx(before[-1] + period, abs=1e-5)
    after = np.append(after, times(line, stamps[count + round(0.5 / period) :]))
    assert kinds(line) == []
    assert line.jumps == 1
    np.testing.assert_allclose(np.diff(after), period, atol=1e-5)
    assert len(after) >= count - 0.2 / period - 2  # what stayed behind was skipped meanwhile


def test_a_clock_that_stands_still_is_named_until_it_goes_on() -> None:
    line = TimeLine(TimeLineOptions())
    times(line, 0.02 * np.arange(50.0))
    times(line, np.full(30, 0.98))
    (fault,) = line.found()
    assert (fault.kind, fault.where, fault.since) == (STAMPS_SKIPPED, "clock", 0.98)
    assert "30 of the last 80 readings" not in fault.detail  # as when it was noticed, ...
    assert "10 of the last 60 readings" in fault.detail
    times(line, 1.0 + 0.02 * np.arange(100.0))
    assert kinds(line) == []


def test_every_third_stamp_that_is_not_later_is_named() -> None:
    line = TimeLine(TimeLineOptions())
    stamps = 0.02 * np.arange(300.0)
    stamps[::3] = 0.0
    times(line, stamps)
    assert kinds(line) == [STAMPS_SKIPPED]


def test_frames_are_on_the_same_time() -> None:
    line = TimeLine(TimeLineOptions())
    times(line, 100.0 + 0.02 * np.arange(50.0))
    tick = line.tick(4000.0)
    assert tick is not None
    line.accept(tick)
    tick = line.tick(4000.02)
    assert tick is not None
    assert tick.frame_time(4000.0) == pytest.approx(tick.time - 0.02)
    assert tick.frame_time(100.9) < 0.0  # from before the jump: old
    assert tick.frame_time(9000.0) == -np.inf
    assert tick.frame_time(np.nan) == tick.frame_time(-np.inf) == -np.inf


@pytest.mark.parametrize("stamp", [np.nan, np.inf, -np.inf])
def test_a_stamp_that_is_no_number_is_refused(stamp: float) -> None:
    with pytest.raises(AgentError, match="Agent: time must be finite"):
        TimeLine(TimeLineOptions()).tick(stamp)
