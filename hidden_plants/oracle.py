"""How large an effect must be before an oracle sees it, who knows everything but the mismatches.

The oracle knows the true structure of the effect, its direction, the noise, and how the mismatches
are distributed, but not their values. With the difference dy that the effect makes in all readings,
d^2 = dy' C^-1 dy, where C is the noise's covariance plus that of the mismatches, the latter from
finite differences of the plant in every mismatch. The detection floor is the amplitude where d = 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hidden_plants.build import build
from hidden_plants.loop import Task, run_task
from hidden_plants.machine import ASSETS, Machine, load
from hidden_plants.mechanisms import mechanism_of
from hidden_plants.mechanisms.mechanism import Structure
from hidden_plants.motion import EPISODE, PERIOD, episodes
from hidden_plants.nuisance import Nuisance, mismatch, size
from hidden_plants.readings import clean_readings
from hidden_plants.robot import Readings
from hidden_plants.secret import Effect
from hidden_plants.study import CAMERA_EVERY, LATE
from hidden_plants.types import Floats

THRESHOLD = 5.0
"""The d at which an effect counts as seen."""
SECONDS = {"elbow": 20.0, "arm": 15.0}
"""Length of the logs that floors are stated for [s]."""
STEP, COARSE = 0.001, 0.002
"""Physics steps of the oracle's runs [s], of effects and of mismatches: only differences count."""
SPREAD = 3.0**-0.5
"""Standard deviation of a uniform number in [-1, 1]."""


@dataclass(frozen=True)
class Background:
    """What the oracle knows of one motion without the effect.

    Attributes:
        middle: whitened readings of the machine with all mismatches in their middle (k,).
        slopes: their change with every mismatch by one standard deviation (k, m), single precision.
        inner: (I + slopes' slopes)^-1 (m, m), so that C^-1 = I - slopes inner slopes'.
    """

    middle: Floats
    slopes: NDArray[np.float32]
    inner: Floats

    def distance(self, readings: Floats) -> float:
        """d of whitened readings (k,)."""
        change = readings - self.middle
        known = (change.astype(np.float32) @ self.slopes).astype(np.float64)
        return max(float(change @ change - known @ self.inner @ known), 0.0) ** 0.5


def whitened(
    machine: Machine,
    motion: int,
    unit: Floats,
    effects: tuple[Effect, ...] = (),
    step: float = STEP,
) -> Floats:
    """All readings of a motion without noise, over their noise, in one row.

    Args:
        machine: the drawing.
        motion: of the library.
        unit: the mismatches (`nuisance.size`,), each in [-1, 1].
        effects: hidden.
        step: of the physics [s].
    """
    nuisance = Nuisance()
    slip = mismatch(machine, nuisance, unit)
    parts: list[Floats] = []
    for k, (initial, targets) in enumerate(episodes(machine, motion, SECONDS[machine.name])):
        time = PERIOD * np.arange(len(targets), dtype=np.float64)
        task = Task(time, targets, initial, EPISODE[machine.name], k * EPISODE[machine.name])
        robot = build(machine, slip, effects, step)
        readings = clean_readings(
            robot, run_task(robot, task), time + LATE, time[::CAMERA_EVERY] + LATE
        )
        parts += _over_noise(readings, nuisance)
    return np.concatenate(parts)


def _over_noise(readings: Readings, nuisance: Nuisance) -> list[Floats]:
    rows = []
    for name, values in readings.items():
        if name == "marker_orientation":
            deviation = 0.5 * nuisance.marker_turn_noise
        elif name == "marker_position":
            deviation = nuisance.marker_noise
        elif name.startswith("length"):
            deviation = nuisance.encoder_noise
        else:
            deviation = nuisance.tension_noise
        rows.append(values.ravel() / deviation)
    return rows


@lru_cache(maxsize=4)
def background(machine: Machine, motion: int) -> Background:
    """What the oracle knows of a motion; one run of the plant for every mismatch."""
    units = np.eye(size(machine), dtype=np.float64)
    middle = whitened(machine, motion, 0.0 * units[0])
    start = whitened(machine, motion, 0.0 * units[0], step=COARSE)
    slopes = np.empty((len(middle), len(units)), dtype=np.float32)
    for column, unit in enumerate(units):
        slopes[:, column] = SPREAD * (whitened(machine, motion, unit, step=COARSE) - start)
    inner = np.linalg.inv(units + (slopes.T @ slopes).astype(np.float64))
    return Background(middle, slopes, np.asarray(inner, dtype=np.float64))


def detection_limit_of(
    machine: Machine, structure: Effect | Structure, motion: int, guess: float | None = None
) -> float:
    """The amplitude at which the oracle's d is 5; infinite where no physical one reaches it.

    Args:
        machine: the drawing.
        structure: its amplitude, if it has one, does not matter.
        motion: of the library.
        guess: an amplitude to start from.
    """
    mechanism, seen = mechanism_of(structure), background(machine, motion)
    shape = structure.parameters if isinstance(structure, Effect) else structure.shape
    low, high = 0.0, float("inf")
    bound = min(mechanism.bound, shape.get("most", mechanism.bound))
    amplitude = min(guess or mechanism.typical, bound)
    middle = np.zeros(size(machine))
    for _ in range(8):
        effect = mechanism.effect(Structure(structure.id, structure.elements, shape), amplitude)
        distance = seen.distance(whitened(machine, motion, middle, (effect,)))
        if abs(distance / THRESHOLD - 1.0) < 0.05:
            break
        if distance < THRESHOLD:
            low = amplitude
            if amplitude == bound:
                return float("inf")
        else:
            high = amplitude
        step = min(max(THRESHOLD / max(distance, 1e-3), 0.01), 100.0)
        wished = min(amplitude * step, bound)
        if not low < wished < high:
            wished = float(np.sqrt(low * high))
        amplitude = wished
    return amplitude


def detection_limit(
    effect: Effect, motion: int, machine: str = "elbow", assets: Path = ASSETS
) -> float:
    """The factor on the effect's amplitude at which the oracle sees it (d = 5) in a motion."""
    drawing = load(machine, assets)
    return detection_limit_of(drawing, effect, motion, effect.amplitude) / effect.amplitude
