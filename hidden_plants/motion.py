"""Commanded motions: smooth and informative, planned with the nominal model."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from hidden_plants.arm_motion import arm_episodes
from hidden_plants.machine import BIAS, STIFFNESS, Machine
from hidden_plants.types import Floats

PERIOD = 0.020
"""Period of the commands [s]."""
MOTIONS = {"elbow": 4, "arm": 1}
"""Number of motions in the library of each machine; detection limits are known for these."""
EPISODE = {"elbow": 4.0, "arm": 5.0}
"""Duration of one episode [s]."""
LOW, HIGH = np.deg2rad(14.0), np.deg2rad(106.0)
"""Bounds of the elbow's commanded angle [rad]."""
HOME = np.deg2rad(60.0)
"""Angle at which every episode of the elbow begins [rad]."""


@lru_cache(maxsize=16)
def episodes(machine: Machine, motion: int, seconds: float) -> tuple[tuple[Floats, Floats], ...]:
    """Plan the episodes of a motion.

    Args:
        machine: nominal model.
        motion: index in the library.
        seconds: duration of all episodes [s], rounded to whole episodes.

    Returns:
        For each episode the initial posture (joints,) [rad], the same for all, and the target
        lengths (n, tendons) [m], one row every `PERIOD`.
    """
    count = max(1, round(seconds / EPISODE[machine.name]))
    rows = round(EPISODE[machine.name] / PERIOD)
    if machine.name == "arm":
        return tuple(arm_episodes(machine, motion, count, rows))
    rngs = [np.random.default_rng([motion, k, 11]) for k in range(count)]
    return tuple(_elbow(machine, rng, k, rows) for k, rng in enumerate(rngs))


def _elbow(
    machine: Machine, rng: np.random.Generator, index: int, rows: int
) -> tuple[Floats, Floats]:
    time = PERIOD * np.arange(rows, dtype=np.float64)
    kind = ("waves", "holds", "fast", "steps", "waves")[index % 5]
    angle = {"waves": _waves, "holds": _holds, "fast": _fast, "steps": _steps}[kind](rng, time)
    share = np.clip(time / 0.6, 0.0, 1.0)
    angle = HOME + (angle - HOME) * share**2 * (3.0 - 2.0 * share)
    tension = _balanced(machine, angle, _cocontraction(rng, time))
    target = machine.lengths(angle[:, None]) - (tension - BIAS) / STIFFNESS
    return np.array([HOME]), target


def _waves(rng: np.random.Generator, time: Floats) -> Floats:
    """A sum of three sines."""
    frequency = rng.uniform([0.2, 0.4, 0.8], [0.4, 0.8, 1.3])
    wave = np.sin(2.0 * np.pi * np.outer(time, frequency) + rng.uniform(0.0, 2.0 * np.pi, 3))
    return _fit(wave @ rng.uniform([1.0, 0.4, 0.15], [1.0, 0.8, 0.35]))


def _holds(rng: np.random.Generator, time: Floats) -> Floats:
    """Ramps between holds at angles that lie apart."""
    return _through(rng, time, times=np.array([0.25, 0.95, 1.25, 1.95, 2.25, 2.95, 3.25, 3.85]))


def _fast(rng: np.random.Generator, time: Floats) -> Floats:
    """Fast strokes of 2 to 3 rad/s without pauses."""
    stroke = rng.uniform(0.50, 0.62)
    return _through(rng, time, times=0.2 + np.repeat(np.arange(6.0), 2) * stroke, far=True)


def _steps(rng: np.random.Generator, time: Floats) -> Floats:
    """Small steps on a slow wave."""
    angle = 0.8 * np.sin(2.0 * np.pi * 0.3 * time + rng.uniform(0.0, 2.0 * np.pi))
    for instant in np.arange(0.5, 3.9, 0.5):
        angle = angle + rng.uniform(0.05, 0.11) * rng.choice([-1.0, 1.0]) * (time > instant)
    return _fit(angle)


def _through(rng: np.random.Generator, time: Floats, times: Floats, far: bool = False) -> Floats:
    """A smooth motion between stops, at rest from ``times[1::2]`` to ``times[2::2]``."""
    stops = len(times) // 2 + 1
    side, shift = rng.integers(2), rng.uniform(0.0, 0.4 if far else 0.2)
    high = (0.45, 0.6) if far else (0.6, 0.8)
    height = [
        shift + (rng.uniform(0.0, 0.1) if (k + side) % 2 else rng.uniform(*high))
        for k in range(stops)
    ]
    angle = np.full(len(time), height[0])
    for k in range(stops - 1):
        end = times[2 * k + 1]
        if far:
            end = times[2 * k + 2] if 2 * k + 2 < len(times) else 4.0
        share = np.clip((time - times[2 * k]) / (end - times[2 * k]), 0.0, 1.0)
        angle += (height[k + 1] - height[k]) * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    return LOW + (HIGH - LOW) * angle


def _fit(angle: Floats) -> Floats:
    """Scale the motion to the whole range of angles."""
    low, high = float(angle.min()), float(angle.max())
    return LOW + (HIGH - LOW) * (angle - low) / (high - low)


def _cocontraction(rng: np.random.Generator, time: Floats) -> Floats:
    """Preferred tensions of biceps, brachialis and triceps (n, 3) [N], which vary independently."""
    frequency = rng.uniform(0.15, 0.6, (2, 3))
    phase = rng.uniform(0.0, 2.0 * np.pi, (2, 3))
    wave = np.sin(2.0 * np.pi * frequency[0] * time[:, None] + phase[0])
    wave = 0.7 * wave + 0.3 * np.sin(2.0 * np.pi * frequency[1] * time[:, None] + phase[1])
    middle, swing = rng.uniform(110.0, 150.0, 3), rng.uniform(35.0, 60.0, 3)
    return middle + swing * wave


def _balanced(machine: Machine, angle: Floats, tension: Floats) -> Floats:
    """Tensions (n, 3) [N] nearest to the preferred that balance gravity, cut to 50 to 250 N."""
    table = np.linspace(LOW, HIGH, 47)[:, None]
    arms = -machine.moment_arms(table)[:, :, 0]
    arm = np.stack([np.interp(angle, table[:, 0], column) for column in arms.T], axis=1)
    need = np.interp(angle, table[:, 0], machine.gravity_torques(table)[:, 0])
    lack = need - np.sum(arm * tension, axis=1)
    change = arm * (lack / np.sum(arm * arm, axis=1))[:, None]
    return np.clip(tension + change, 50.0, 250.0)
