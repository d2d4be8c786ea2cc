"""Encoders without noise are never named stuck, at any rate; noisy ones that stick are found."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.guard.faults import ENCODER_STUCK, MotorControl
from jmm_agent.guard.muscle_monitor import MuscleMonitor, MuscleMonitorOptions

PERIODS = [0.005, 0.02, 0.05]
MOVE, HOLD = 1.0, 2.0


def arm(period: float, duration: float, swing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Commands and true lengths (T, m) [m] of muscles that move, swing and come to rest.

    Args:
        period: of the control loop [s].
        duration: [s].
        swing: amplitude of the damped swing after each move (m,) [m].
    """
    rng, time, count = np.random.default_rng(0), np.arange(0.0, duration, period), len(swing)
    cycle, phase = np.divmod(time, MOVE + HOLD)
    postures = rng.uniform(-0.05, 0.05, (int(cycle[-1]) + 2, count))
    share = np.clip(phase / MOVE, 0.0, 1.0)[:, None]
    share = share * share * (3.0 - 2.0 * share)
    before, after = postures[cycle.astype(int)], postures[cycle.astype(int) + 1]
    command = before + share * (after - before)
    since = np.clip(phase - MOVE, 0.0, None)[:, None]
    rate, damping = 2.0 * np.pi * rng.uniform(1.0, 9.0, count), rng.uniform(1.0, 12.0, count)
    lengths = command + swing * np.sin(rate * since) * np.exp(-damping * since)
    return command, lengths + 0.003


def read(lengths: np.ndarray, noise: np.ndarray, resolution: np.ndarray) -> np.ndarray:
    """Readings (T, m) [m] by encoders with noise and resolution (m,) [m]; 0 for none."""
    readings = lengths + noise * np.random.default_rng(1).standard_normal(lengths.shape)
    steps = np.where(resolution > 0.0, resolution, 1.0)
    return np.where(resolution > 0.0, np.rint(readings / steps) * steps, readings)


def stuck(period: float, command: np.ndarray, readings: np.ndarray) -> dict[int, float]:
    """Muscles whose encoder is found stuck, and when first [s]; stamps with 30 % of jitter."""
    motors, rng = MotorControl(), np.random.default_rng(9)
    names = tuple(str(k) for k in range(command.shape[1]))
    monitor, first = MuscleMonitor(names, motors, MuscleMonitorOptions()), dict[int, float]()
    for k, (wanted, reading) in enumerate(zip(command, readings, strict=True)):
        dt = period * (1.0 + 0.3 * rng.uniform(-1.0, 1.0))
        monitor.update(dt, reading, motors.demanded(reading, wanted), wanted, wanted + 0.003)
        for kind, muscle in monitor.found():
            if kind == ENCODER_STUCK:
                first.setdefault(int(muscle), k * period)
    return first


def grid(*values: list[float]) -> list[np.ndarray]:
    """All combinations of values, each in three muscles of other moves and swings."""
    return [np.repeat(part.ravel(), 3) for part in np.meshgrid(*values, indexing="ij")]


@pytest.mark.parametrize("period", PERIODS)
def test_an_encoder_without_noise_is_never_stuck(period: float) -> None:
    resolution, swing = grid([0.0, 2e-5, 5e-5, 2e-4, 5e-4], [0.0, 1e-4, 2e-3])
    command, lengths = arm(period, 36.0, swing)
    assert stuck(period, command, read(lengths, 0.0 * swing, resolution)) == {}


@pytest.mark.parametrize("period", PERIODS)
def test_noise_about_the_resolution_is_never_stuck(period: float) -> None:
    """A reading in the middle of a step may stay the same for long."""
    resolution, share = grid([5e-5, 2e-4, 5e-4], [0.1, 0.3, 0.5, 0.8, 1.2, 2.0])
    command, lengths = arm(period, 36.0, np.full(len(share), 1e-3))
    assert stuck(period, command, read(lengths, share * resolution, resolution)) == {}


@pytest.mark.parametrize("period", PERIODS)
def test_a_noisy_encoder_that_sticks_is_found(period: float) -> None:
    noise, resolution = grid([3e-5, 1e-4, 3e-4], [0.0, 2e-5])
    command, lengths = arm(period, 30.0, np.full(len(noise), 1e-3))
    readings, sticks = read(lengths, noise, resolution), 26.3  # 25 s: the beginning of a rest
    if period == PERIODS[0]:
        sticks = 24.4  # while it moves
    readings[round(sticks / period) :] = readings[round(sticks / period)]
    found = stuck(period, command, readings)
    assert sorted(found) == list(range(len(noise)))
    after = np.array(list(found.values())) - sticks
    assert after.min() > 0.25
    assert after.max() < (2.0 if period == 0.05 else 1.0)
