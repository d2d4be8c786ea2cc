"""Cutoff of the efforts: up to which frequency a log of torques is compared."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.simulation.measured_motion import (
    _spectra,
    effort_cutoff,
    interpolated,
    period_of,
)
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.types import Floats

CHANNELS = (
    Channel("angle", "angle", unit="rad"),
    Channel("torque", "joint", unit="N m", kind="effort"),
)
POSITION, EFFORT = 2.0, 7.0
"""Highest frequency of the position, and that of its acceleration and effort in part [Hz]."""


def reading(rng: np.random.Generator, rate: float, shape: Floats, noise: float) -> Reading:
    """Return 12 s of two tones with amplitudes (2,) and noise, on a clock with jitter."""
    time = np.arange(0.0, 12.0, 1.0 / rate)
    time = time + rng.uniform(-0.1, 0.1, len(time)) / rate
    tones = np.sin(2 * np.pi * np.outer(time, [POSITION, EFFORT]) + 0.3)
    return Reading(time, tones @ shape + noise * rng.standard_normal(len(time)))


def cutoff(rates: tuple[float, float], noises: tuple[float, float], scale: float = 1.0) -> float:
    """Return the cutoff of one position and one effort with these rates [Hz] and noises."""
    rng = np.random.default_rng(2)
    angle = reading(rng, rates[0], scale * np.array([0.5, 0.01]), scale * noises[0])
    torque = reading(rng, rates[1], np.array([3.0, 1.0]), noises[1])
    episode = Episode("only", torque.time, np.zeros((len(torque.time), 0)), (angle, torque))
    study = Study("log", Path("arm.xml"), CHANNELS, (episode,))
    noise = np.array([scale * noises[0]])
    return effort_cutoff(study, [1], [0], noise, max(map(period_of, episode.readings)))


@pytest.mark.parametrize("rates", [(1000, 1000), (1000, 150), (150, 1000), (150, 150)])
def test_the_effort_limits_the_cutoff_where_positions_are_exact(
    rates: tuple[float, float],
) -> None:
    assert cutoff(rates, (1e-9, 1e-3)) == pytest.approx(1.5 * EFFORT, rel=0.2)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("rates", [(1000, 1000), (1000, 150), (150, 1000), (150, 150)])
def test_positions_limit_the_cutoff_where_noise_hides_them(
    rates: tuple[float, float], scale: float
) -> None:
    assert POSITION <= cutoff(rates, (0.1, 0.5), scale) < 0.8 * EFFORT


def test_a_position_that_is_nowhere_seen_does_not_limit_the_cutoff() -> None:
    assert cutoff((200, 200), (1e3, 1e-3)) == pytest.approx(1.5 * EFFORT, rel=0.2)


def test_no_value_in_a_gap_is_far_from_those_around_it() -> None:
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 6.0, 1e-3)
    value = np.sin(time) + 0.1 * rng.standard_normal(len(time))
    kept = (time < 2.0) | (time > 3.2)
    found = interpolated(Reading(time[kept], value[kept]), time)

    assert np.abs(found - np.sin(time)).max() < 0.7
    np.testing.assert_allclose(found[kept], value[kept])


def test_a_jump_over_a_gap_is_in_no_spectrum() -> None:
    """A slow sine that was not read for a third of its period has no high frequencies."""
    time = np.arange(0.0, 20.0, 0.01)
    value = np.sin(0.5 * time)
    read = (time < 8.0) | (time > 12.0)
    channels = Reading(time[read], value[read])
    episode = Episode("log", time, np.zeros((len(time), 0)), (channels,))
    frequency, [power] = _spectra([episode], 0, 512)
    assert power[frequency > 5.0].max() < 1e-6 * power.max()
