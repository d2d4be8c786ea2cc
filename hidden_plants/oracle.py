"""Detection limits: the smallest amplitude of an effect that an ideal detector finds.

The ideal detector, the oracle, knows the structure and direction of the effect, the noise, and the
distribution of the mismatches, but not the values of the mismatches. Let dy be the change of all
readings by the effect. Its detectability is d with d^2 = dy' C^-1 dy, where C is the covariance of
the noise plus that of the mismatches; the latter comes from finite differences of the simulation in
every mismatch. The detection limit is the amplitude where d = 5.
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
from hidden_plants.nuisance import Nuisance, mismatch_at, mismatch_size
from hidden_plants.readings import clean_readings, noise_of
from hidden_plants.robot import Readings
from hidden_plants.secret import Effect
from hidden_plants.study import CAMERA_EVERY, SENSOR_DELAY
from hidden_plants.types import Floats

THRESHOLD = 5.0
"""Value of d at the detection limit."""
SECONDS = {"elbow": 20.0, "arm": 15.0}
"""Length of the logs that detection limits are computed for [s]."""
STEP, COARSE = 0.001, 0.002
"""Physics steps [s] of simulations with effects and with mismatches.

They are coarser than those of a study: only differences between simulations matter.
"""
SPREAD = 3.0**-0.5
"""Standard deviation of a uniform number in [-1, 1]."""


@dataclass(frozen=True)
class Background:
    """Readings of one motion without an effect, and their change with the mismatches.

    Attributes:
        middle: whitened readings of the robot with all mismatches at their mean (k,).
        slopes: change of the readings per standard deviation of each mismatch (k, m), in single
            precision.
        inner: (I + slopes' slopes)^-1 (m, m), so that C^-1 = I - slopes inner slopes'.
    """

    middle: Floats
    slopes: NDArray[np.float32]
    inner: Floats

    def distance(self, readings: Floats) -> float:
        """Detectability d of whitened readings (k,)."""
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
    """Simulate a motion and divide all readings by their noise.

    Args:
        machine: nominal model.
        motion: index in the library.
        unit: mismatches (`nuisance.mismatch_size`,), each in [-1, 1].
        effects: hidden effects.
        step: physics step [s].

    Returns:
        Readings over their standard deviations, of all sensors and episodes (k,).
    """
    nuisance = Nuisance()
    mismatch = mismatch_at(machine, nuisance, unit)
    parts: list[Floats] = []
    for k, (initial, targets) in enumerate(episodes(machine, motion, SECONDS[machine.name])):
        time = PERIOD * np.arange(len(targets), dtype=np.float64)
        task = Task(time, targets, initial, EPISODE[machine.name], k * EPISODE[machine.name])
        robot = build(machine, mismatch, effects, step)
        readings = clean_readings(
            robot, run_task(robot, task), time + SENSOR_DELAY, time[::CAMERA_EVERY] + SENSOR_DELAY
        )
        parts += _over_noise(readings, nuisance)
    return np.concatenate(parts)


def _over_noise(readings: Readings, nuisance: Nuisance) -> list[Floats]:
    rows = []
    for name, values in readings.items():
        # A small rotation changes the quaternion by half its angle.
        unit = 0.5 if name == "marker_orientation" else 1.0
        rows.append(values.ravel() / (unit * noise_of(name, nuisance)))
    return rows


@lru_cache(maxsize=4)
def background(machine: Machine, motion: int) -> Background:
    """Compute the background of a motion, with one simulation for every mismatch."""
    units = np.eye(mismatch_size(machine), dtype=np.float64)
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
    """Search the amplitude at which d is `THRESHOLD`, to 5 % of d.

    Args:
        machine: nominal model.
        structure: where and in which shape the effect acts; the amplitude of an `Effect` is
            ignored.
        motion: index in the library.
        guess: first amplitude of the search.

    Returns:
        The amplitude in the unit of the mechanism; infinite if no physical amplitude reaches d.
    """
    mechanism, known = mechanism_of(structure), background(machine, motion)
    shape = structure.parameters if isinstance(structure, Effect) else structure.shape
    low, high = 0.0, float("inf")
    bound = min(mechanism.bound, shape.get("most", mechanism.bound))
    amplitude = min(guess or mechanism.typical, bound)
    middle = np.zeros(mismatch_size(machine))
    for _ in range(8):
        effect = mechanism.effect(Structure(structure.id, structure.elements, shape), amplitude)
        distance = known.distance(whitened(machine, motion, middle, (effect,)))
        if abs(distance / THRESHOLD - 1.0) < 0.05:
            break
        if distance < THRESHOLD:
            low = amplitude
            if amplitude == bound:
                return float("inf")
        else:
            high = amplitude
        step = min(max(THRESHOLD / max(distance, 1e-3), 0.01), 100.0)
        following = min(amplitude * step, bound)
        if not low < following < high:
            following = float(np.sqrt(low * high))
        amplitude = following
    return amplitude


def detection_limit(
    effect: Effect, motion: int, machine: str = "elbow", assets: Path = ASSETS
) -> float:
    """Compute the ratio of the detection limit to an effect's amplitude.

    Args:
        effect: of nonzero amplitude.
        motion: index in the library.
        machine: "elbow" or "arm".
        assets: folder of elbow.xml and arm.xml.

    Returns:
        The factor by which the amplitude has to be multiplied to get the detection limit.
    """
    nominal = load(machine, assets)
    return detection_limit_of(nominal, effect, motion, effect.amplitude) / effect.amplitude
