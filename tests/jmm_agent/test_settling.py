"""The settling detector: once per settling, never while something moves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jmm_agent.settling import SettlingDetector, SettlingOptions

PERIOD = 0.02
OPTIONS = SettlingOptions(window=0.4, change=0.0008, release=0.004)


def fired(lengths: np.ndarray, detector: SettlingDetector | None = None) -> list[int]:
    """Steps at which a sequence of lengths (T, m) [m] settles."""
    detector = detector or SettlingDetector(OPTIONS)
    return [step for step, row in enumerate(lengths) if detector.update(PERIOD * step, row)]


def held(values: list[float], steps: int) -> np.ndarray:
    """Two muscles of which the second holds each value [m] for some steps."""
    second = np.repeat(values, steps)
    return np.column_stack([np.full(len(second), 0.1), second])


def test_still_lengths_settle_once_when_the_window_has_passed() -> None:
    detector = SettlingDetector(OPTIONS)
    assert fired(held([0.0], 200), detector) == [20]
    assert detector.since == 0.0


def test_each_rest_settles_once() -> None:
    assert fired(held([0.0, 0.01, 0.0], 60)) == [20, 80, 140]


def test_a_rest_close_to_the_last_is_the_same_rest() -> None:
    detector = SettlingDetector(OPTIONS)
    assert fired(held([0.0, 0.003, 0.0], 60), detector) == [20]
    assert fired(held([0.0, 0.005], 60)) == [20, 80]


def test_the_time_of_rest_ends_with_the_rest() -> None:
    detector = SettlingDetector(OPTIONS)
    fired(held([0.0], 40), detector)
    assert np.isfinite(detector.since)
    detector.update(41 * PERIOD, np.array([0.1, 0.02]))
    assert detector.since == np.inf


def test_a_reset_forgets_the_rest_and_the_past() -> None:
    detector = SettlingDetector(OPTIONS)
    fired(held([0.0], 40), detector)
    detector.reset()
    assert detector.since == np.inf
    assert fired(held([0.0], 40), detector) == [20]


@given(speed=st.floats(0.0025, 0.5), muscle=st.integers(0, 4), sign=st.sampled_from([-1.0, 1.0]))
def test_one_muscle_that_moves_keeps_all_unsettled(speed: float, muscle: int, sign: float) -> None:
    lengths = np.zeros((150, 5))
    lengths[:, muscle] = sign * speed * PERIOD * np.arange(150)
    assert fired(lengths) == []


@given(period=st.integers(4, 40), phase=st.floats(0.0, 6.28), amplitude=st.floats(0.002, 0.05))
def test_a_swinging_muscle_never_settles(period: int, phase: float, amplitude: float) -> None:
    steps = np.arange(200)
    swing = amplitude * np.sin(2 * np.pi * steps / period + phase)
    assert fired(np.column_stack([np.zeros(200), swing])) == []


@given(seed=st.integers(0, 1000), level=st.floats(0.0, 0.00005))
def test_noise_within_the_threshold_does_not_prevent_settling(seed: int, level: float) -> None:
    lengths = level * np.random.default_rng(seed).standard_normal((60, 36))
    assert fired(lengths) == [20]


@given(
    jumps=st.lists(st.tuples(st.integers(1, 60), st.floats(-0.02, 0.02)), min_size=1, max_size=6)
)
def test_lengths_that_settle_were_still_for_the_whole_window(
    jumps: list[tuple[int, float]],
) -> None:
    lengths = np.concatenate([np.full((steps, 1), value) for steps, value in jumps])
    for step in fired(lengths):
        window = lengths[step - 20 : step + 1]
        assert np.abs(window - lengths[step]).max() <= OPTIONS.change


def test_lengths_in_a_buffer_that_is_used_again_are_not_mistaken_for_still_ones() -> None:
    detector, buffer = SettlingDetector(OPTIONS), np.zeros(2)
    for step in range(60):
        buffer[:] = 0.01 * step
        assert not detector.update(PERIOD * step, buffer)


RESTS, MOVE, HOLD, SPEED = 10, 1.0, 3.0, 0.02


def stamps(period: float, jitter: float = 0.0, start: float = 0.0, lost: float = 0.0) -> np.ndarray:
    """Time stamps [s] of ten moves and rests by a clock.

    Args:
        period: of the control loop [s].
        jitter: largest deviation of a stamp from its moment [s].
        start: the first moment [s].
        lost: share of cycles that are missing.
    """
    rng = np.random.default_rng(1)
    time = np.arange(0.0, RESTS * (MOVE + HOLD), period)
    time = time[rng.random(len(time)) >= lost]
    return start + time + rng.uniform(-jitter, jitter, len(time))


def moves_and_rests(time: np.ndarray, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Lengths (T, 36) [m] at moments [s] after the first move began: ten moves, ten rests."""
    cycle, phase = np.divmod(time, MOVE + HOLD)
    travelled = SPEED * (MOVE * cycle + np.clip(phase, 0.0, MOVE))
    lengths = travelled[:, None] * np.linspace(-1.0, 1.0, 36)
    return lengths + noise * np.random.default_rng(seed).standard_normal(lengths.shape)


CLOCKS = {
    "exact": {"period": 0.02},
    "jitter of 1 us": {"period": 0.02, "jitter": 1e-6},
    "jitter of 1 ms": {"period": 0.02, "jitter": 1e-3},
    "jitter of 30 %": {"period": 0.02, "jitter": 6e-3},
    "seconds since 1970": {"period": 0.02, "start": 1.7e9},
    "since 1970 with jitter": {"period": 0.02, "start": 1.7e9, "jitter": 1e-3},
    "lost cycles": {"period": 0.02, "lost": 0.05},
    "5 ms": {"period": 0.005, "jitter": 1.5e-3},
    "60 Hz": {"period": 1 / 60},
    "30 ms": {"period": 0.03},
    "50 ms": {"period": 0.05, "jitter": 0.015, "lost": 0.05},
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_every_rest_is_found_once_by_any_clock(clock: str) -> None:
    detector, time = SettlingDetector(OPTIONS), stamps(**CLOCKS[clock])
    lengths = moves_and_rests(time - time[0], noise=1e-4)
    found = [t - time[0] for t, row in zip(time, lengths, strict=True) if detector.update(t, row)]

    cycle, phase = np.divmod(np.array(found), MOVE + HOLD)
    np.testing.assert_array_equal(cycle, np.arange(RESTS))
    assert phase.min() >= MOVE  # not before the move has ended, ...
    assert phase.max() <= MOVE + OPTIONS.window + 0.15  # ... and soon after


@pytest.mark.parametrize("noise", [3e-5, 1e-4, 3e-4])
def test_the_threshold_follows_the_noise_of_the_encoders(noise: float) -> None:
    for seed in range(5):
        assert len(fired(moves_and_rests(stamps(0.02), noise, seed))) == RESTS


@pytest.mark.parametrize("creep", [1.0e-3, 1.3e-3])
def test_one_noisy_encoder_does_not_widen_the_threshold_of_the_others(creep: float) -> None:
    """The others creep in each window [m]: less than the noisy one changes, but too much."""
    time = stamps(0.02)
    rng = np.random.default_rng(0)
    lengths = np.array([3e-4, *([5e-5] * 35)]) * rng.standard_normal((len(time), 36))
    lengths[:, 1:] += creep / 0.4 * time[:, None]
    assert fired(lengths) == []


@pytest.mark.parametrize("stamp", [0.98, 0.5, 1.0])
def test_a_stamp_that_is_not_newer_is_skipped(stamp: float) -> None:
    detector, rest = SettlingDetector(OPTIONS), np.zeros(2)
    for step in range(51):
        detector.update(PERIOD * step, rest)
    since = detector.since
    assert not detector.update(stamp, np.ones(2))
    assert detector.since == since  # its lengths did not count as a move


def test_a_gap_is_not_taken_for_a_rest() -> None:
    detector, rest = SettlingDetector(OPTIONS), np.zeros(2)
    for step in range(10):
        assert not detector.update(PERIOD * step, rest)
    assert not detector.update(10.0, rest)  # the time between is unknown
    assert [k for k in range(1, 30) if detector.update(10.0 + PERIOD * k, rest)] == [20]
