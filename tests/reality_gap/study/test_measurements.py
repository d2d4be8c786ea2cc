"""Noise of readings: estimated, stated, rounded to the step of a converter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.study.measurements import channel_noise, measured, rounding_steps
from reality_gap.types import Floats
from tests.reality_gap.study.one_hinge import hinge, study

BITS_12 = 2.0 * np.pi / 4096


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return hinge(tmp_path)


def sweep(count: int = 2000) -> Floats:
    return 0.7 * np.sin(np.linspace(0.0, 6.0, count))


def rounded(values: Floats, step: float) -> Floats:
    return step * np.round(values / step)


@pytest.mark.parametrize("step", [BITS_12, 2.0 * np.pi / 256, 1e-4, np.deg2rad(0.088)])
def test_the_step_of_a_converter_is_found(model: Path, step: float) -> None:
    moving = study(model, rounded(sweep(), step))
    assert rounding_steps(moving) == pytest.approx([step], rel=1e-6)
    assert channel_noise(moving)[0] == pytest.approx(step / np.sqrt(12.0), rel=0.3)


def test_a_converter_at_rest_has_the_noise_of_its_rounding(model: Path) -> None:
    still = np.r_[rounded(sweep(200), BITS_12), np.full(2000, 3 * BITS_12)]
    assert channel_noise(study(model, still)) == pytest.approx([BITS_12 / np.sqrt(12.0)])


@pytest.mark.parametrize("decimals", [3, 4, 5])
def test_a_log_with_few_decimals_is_rounded_too(model: Path, decimals: int) -> None:
    coarse = study(model, np.round(sweep(), decimals))
    assert channel_noise(coarse)[0] >= 10.0**-decimals / np.sqrt(12.0) * (1 - 1e-9)


def test_smooth_and_noisy_readings_have_no_step(model: Path) -> None:
    noisy = sweep() + 1e-3 * np.random.default_rng(0).standard_normal(2000)
    for values in (sweep(), noisy, np.round(noisy, 9), np.linspace(0.0, 1.0, 2000) ** 2):
        assert rounding_steps(study(model, values)) == [0.0]
    assert channel_noise(study(model, noisy)) == pytest.approx([1e-3], rel=0.1)


def test_a_stated_noise_below_that_of_rounding_is_raised(model: Path) -> None:
    values = rounded(sweep(), BITS_12)
    raised = channel_noise(study(model, values, noise=1e-6))
    assert raised == pytest.approx([BITS_12 / np.sqrt(12.0)])
    assert channel_noise(study(model, values, noise=0.01)) == [0.01]
    assert channel_noise(study(model, sweep(), noise=0.0))[0] > 0.0


def test_equal_readings_in_a_row_count_as_one(model: Path) -> None:
    """A thousand readings of one rounded value do not measure it better than one of them."""
    values = np.r_[rounded(sweep(), BITS_12), np.full(1000, 50 * BITS_12)]
    found = measured(study(model, values)).noise[-1000:]
    assert np.sum(found**-2) ** -0.5 == pytest.approx(BITS_12 / np.sqrt(12.0), rel=0.01)


def test_a_slow_motion_through_the_steps_is_measured_by_all_readings(model: Path) -> None:
    """Each run of equal values between a lower and a higher one has all errors, with mean zero.

    Where the motion turns, the error of a run is not zero in the mean.
    """
    there = np.linspace(0.0, 40.0, 1000) * BITS_12
    values = rounded(np.r_[there, there[::-1]], BITS_12)
    found = measured(study(model, values)).noise
    passing = (values > 0.0) & (values < 40.0 * BITS_12)
    assert found[passing] == pytest.approx(np.full(passing.sum(), BITS_12 / np.sqrt(12.0)))
    turn = np.abs(np.arange(len(values)) - 999.5) < 12
    assert found[turn].min() > 3.0 * BITS_12 / np.sqrt(12.0)


def test_a_pause_within_a_step_counts_as_one_reading(model: Path) -> None:
    """The motion comes from below and goes on upwards, so that its errors do not tell the pause."""
    there, pause = np.linspace(0.0, 20.3, 500), np.full(300, 20.3)
    values = rounded(np.r_[there, pause, np.linspace(20.3, 40.0, 500)] * BITS_12, BITS_12)
    found = measured(study(model, values)).noise
    run = values == 20.0 * BITS_12
    assert np.sum(found[run] ** -2) ** -0.5 == pytest.approx(BITS_12 / np.sqrt(12.0), rel=0.01)
    passing = (values > 0.0) & (values < 40.0 * BITS_12) & ~run
    assert found[passing] == pytest.approx(np.full(passing.sum(), BITS_12 / np.sqrt(12.0)))


def test_noise_above_the_step_averages_out(model: Path) -> None:
    noise = 3.0 * BITS_12 * np.random.default_rng(0).standard_normal(2000)
    found = study(model, rounded(noise, BITS_12), noise=3.0 * BITS_12)
    assert measured(found).noise == pytest.approx(np.full(2000, 3.0 * BITS_12), rel=0.05)


@pytest.mark.parametrize("hold", [2, 10])
def test_a_slow_sensor_in_a_fast_log_has_its_noise(model: Path, hold: int) -> None:
    """Values are held until the next one, so that most differences are zero."""
    fresh = sweep() + 1e-3 * np.random.default_rng(0).standard_normal(2000)
    held = study(model, np.repeat(fresh, hold))
    assert channel_noise(held) == pytest.approx([1e-3], rel=0.1)
    found = measured(held).noise.reshape(-1, hold)
    assert np.sum(found**-2, axis=1) ** -0.5 == pytest.approx(np.full(2000, 1e-3), rel=0.1)
