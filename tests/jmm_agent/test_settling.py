"""The settling detector: once per settling, never while something moves."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from jmm_agent.settling import SettlingDetector, SettlingOptions

PERIOD = 0.02
OPTIONS = SettlingOptions(window=0.4, change=0.0008, release=0.004)


def fired(lengths: np.ndarray, detector: SettlingDetector | None = None) -> list[int]:
    """Steps at which a run of lengths (T, m) [m] is said to have settled."""
    detector = detector or SettlingDetector(OPTIONS)
    return [step for step, row in enumerate(lengths) if detector.update(PERIOD * step, row)]


def held(values: list[float], steps: int) -> np.ndarray:
    """Two wires of which the second holds each value [m] for some steps."""
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


@given(speed=st.floats(0.0025, 0.5), wire=st.integers(0, 4), sign=st.sampled_from([-1.0, 1.0]))
def test_one_wire_that_moves_keeps_all_unsettled(speed: float, wire: int, sign: float) -> None:
    lengths = np.zeros((150, 5))
    lengths[:, wire] = sign * speed * PERIOD * np.arange(150)
    assert fired(lengths) == []


@given(period=st.integers(4, 40), phase=st.floats(0.0, 6.28), amplitude=st.floats(0.002, 0.05))
def test_a_swinging_wire_never_settles(period: int, phase: float, amplitude: float) -> None:
    steps = np.arange(200)
    swing = amplitude * np.sin(2 * np.pi * steps / period + phase)
    assert fired(np.column_stack([np.zeros(200), swing])) == []


@given(seed=st.integers(0, 1000), level=st.floats(0.0, 0.00005))
def test_noise_within_the_threshold_does_not_keep_it_awake(seed: int, level: float) -> None:
    lengths = level * np.random.default_rng(seed).standard_normal((60, 36))
    assert fired(lengths) == [20]


@given(
    jumps=st.lists(st.tuples(st.integers(1, 60), st.floats(-0.02, 0.02)), min_size=1, max_size=6)
)
def test_whatever_it_calls_rest_was_still_for_the_whole_window(
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
