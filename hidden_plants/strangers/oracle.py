"""Oracle: the smallest amplitude of an effect that an ideal detector finds on a machine.

The detector knows the structure of the effect, the noise, and the distribution of the mismatches,
but not their values. Let dy be the change of all readings by the effect. Its detectability is d
with d^2 = dy' C^-1 dy, where C is the covariance of the noise plus that of the mismatches, which
comes from finite differences of the simulation in every mismatch. The noise of a channel includes
the RMS by which the nominal model misses a machine without mismatches, because of its time step and
of its law of friction. The floor is the amplitude at which d = 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import Structure
from hidden_plants.strangers.mismatch import mismatch_at, mismatch_size
from hidden_plants.strangers.native import whitened_natively
from hidden_plants.strangers.plant import real_step
from hidden_plants.strangers.readings import run, whitened
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats

THRESHOLD = 5.0
"""Value of d at the floor."""
STEPS = 7
"""Largest number of simulations in the search of a floor."""
SPREAD = 3.0**-0.5
"""Standard deviation of a uniform number in [-1, 1]."""


@dataclass(frozen=True)
class Background:
    """Readings of a machine without an effect, and their change with the mismatches.

    Attributes:
        weight: standard deviation of each reading from noise over that with the error of the
            nominal model (k,).
        middle: whitened readings with all mismatches at their mean, weighted (k,).
        slopes: change of the readings per standard deviation of each mismatch (k, m).
        inner: (I + slopes' slopes)^-1 (m, m), so that C^-1 = I - slopes inner slopes'.
    """

    weight: Floats
    middle: Floats
    slopes: Floats
    inner: Floats


class Oracle:
    """Detectability of effects on one machine; the first use simulates every mismatch once."""

    def __init__(self, stranger: Stranger) -> None:
        self.stranger = stranger
        self.step = float(stranger.model.opt.timestep)
        self._background: Background | None = None

    def distance(self, effect: Effect) -> float:
        """Detectability d of an effect; NaN if the machine leaves its ranges."""
        known = self.background
        readings = self.readings((effect,))
        if np.isnan(readings).any():
            return float("nan")
        change = known.weight * readings - known.middle
        along = change @ known.slopes
        squared = float(change @ change) - float(along @ known.inner @ along)
        return float(np.sqrt(max(squared, 0.0)))

    def floor(self, structure: Structure) -> float:
        """Amplitude at which d is `THRESHOLD`, to 15 % of d; infinite if none is physical."""
        low, high = 0.0, float("inf")
        amplitude = structure.size
        for _ in range(STEPS):
            distance = self.distance(structure.at(amplitude))
            if abs(distance / THRESHOLD - 1.0) < 0.15:
                return amplitude
            if np.isnan(distance) or distance > THRESHOLD:
                high = amplitude
            elif amplitude >= structure.most:
                return float("inf")
            else:
                low = amplitude
            factor = 0.3 if np.isnan(distance) else THRESHOLD / max(distance, 1e-3)
            following = min(amplitude * min(max(factor, 1e-3), 30.0), structure.most)
            if not low < following < high:
                following = float(np.sqrt(low * high)) if low else 0.1 * high
            amplitude = following
        return high

    def readings(self, effects: tuple[Effect, ...] = (), step: float | None = None) -> Floats:
        """Whitened readings of a machine with its mean mismatches; NaN if it leaves its ranges."""
        none = mismatch_at(self.stranger, np.zeros(mismatch_size(self.stranger)))
        found = run(self.stranger, none, effects, step or self.step)
        return whitened(self.stranger, found) if found.sound else np.array([np.nan])

    def _natively(self, unit: Floats) -> Floats:
        return whitened_natively(self.stranger, mismatch_at(self.stranger, unit), self.step)

    @property
    def background(self) -> Background:
        """Readings without an effect, and their change with the mismatches."""
        if self._background is None:
            units = np.eye(mismatch_size(self.stranger))
            middle, start = self.readings(), self._natively(0.0 * units[0])
            exact = self.readings(step=real_step(self.stranger))
            if np.isnan(middle).any() or np.isnan(exact).any():
                raise ValueError(f"machine {self.stranger.seed} leaves its ranges")
            weight = self._weight(start - exact)
            if self.stranger.traits.kind == "efforts":  # nothing is integrated there
                weight = np.ones_like(weight)
            columns = [weight * (self._natively(unit) - start) for unit in units]
            slopes = SPREAD * np.array(columns).T
            inner = np.asarray(np.linalg.inv(units + slopes.T @ slopes), dtype=np.float64)
            self._background = Background(weight, weight * middle, slopes, inner)
        return self._background

    def _weight(self, error: Floats) -> Floats:
        """Weight of each reading from the error of the nominal model, by channel (k,)."""
        rows, start = [], 0
        for time, _ in self.stranger.commands:
            for _ in self.stranger.sensors:
                part = error[start : start + len(time)]
                rows.append(np.full(len(time), (1.0 + float(np.mean(part**2))) ** -0.5))
                start += len(time)
        return np.concatenate(rows)
