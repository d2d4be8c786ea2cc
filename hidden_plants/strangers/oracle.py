"""Oracle: the smallest amplitude of an effect that an ideal detector finds on a machine.

The detector knows the structure of the effect, the noise, and the distribution of the mismatches,
but not their values. Let dy be the change of all readings by the effect. Its detectability is d
with d^2 = dy' C^-1 dy, where C is the covariance of the noise plus that of the mismatches, which
comes from finite differences in every mismatch: of a quicker simulation where they are small. As
they are not linear, the likeliest mismatches are simulated, too, and d^2 is at most what these
leave of dy, and what they cost. Where a mismatch is the same change of the machine as the effect,
d^2 is at most its cost. The noise of a channel includes the RMS by which the nominal model misses a
machine without mismatches, because of its time step and of its law of friction. The floor is the
amplitude at which d = 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.inverse import seen_torques
from hidden_plants.strangers.mechanisms.mechanism import Structure
from hidden_plants.strangers.mismatch import Tolerances, mismatch_at, mismatch_size
from hidden_plants.strangers.native import whitened_natively
from hidden_plants.strangers.readings import real_run, run, whitened
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats

THRESHOLD = 5.0
"""Value of d at the floor."""
STEPS = 7
"""Largest number of simulations in the search of a floor."""
LARGE = 10.0
"""Change by a mismatch from which on it is simulated as the effects are."""
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


_RELATIVE = {
    "armature": ("armature", "dof_armature"),
    "less_damping": ("damping", ""),
    "less_friction": ("friction", ""),
    "less_stiffness": ("stiffness", ""),
    "viscous_friction": ("damping", "dof_damping"),
    "link_mass": ("mass", "body_mass"),
}
"""Effects on a joint or body that are a mismatch, and the field of the model they are relative to;
amplitudes without one are relative."""


def cost_of_same(stranger: Stranger, effect: Effect) -> float:
    """Squared mismatches, over their standard deviations, that are the same change of a machine.

    Args:
        stranger: nominal machine.
        effect: a hidden effect.

    Returns:
        Their sum; infinite if no mismatch is the same.
    """
    size, widths, model = effect.amplitude, Tolerances(), stranger.model
    if effect.id == "force_scale" and stranger.traits.kind == "motors":
        return float(len(effect.elements) * (size / (SPREAD * widths.gain)) ** 2)
    if effect.id not in _RELATIVE or not effect.parameters.get("on_joint", 1.0):
        return float("inf")
    name, field = _RELATIVE[effect.id]
    if field:
        [element] = effect.elements
        of_body = field.startswith("body")
        index = model.body(element).id if of_body else model.joint(element).dofadr[0]
        size /= float(getattr(model, field)[index])
    return float((size / (SPREAD * getattr(widths, name))) ** 2)


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
        sizes = known.inner @ along
        squared = float(change @ change) - float(along @ sizes)
        squared = min(squared, cost_of_same(self.stranger, effect))
        alike = known.weight * self.readings(sizes=SPREAD * sizes) - known.middle
        if not np.isnan(alike).any():
            squared = min(squared, float(np.sum((change - alike) ** 2) + sizes @ sizes))
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

    def readings(
        self, effects: tuple[Effect, ...] = (), sizes: Floats | None = None, real: bool = False
    ) -> Floats:
        """Whitened readings of a machine; NaN if it leaves its ranges.

        Args:
            effects: hidden effects.
            sizes: deviations of the mismatches from their means, over their half widths (m,).
            real: whether the machine has no physics step; otherwise it has the model's.
        """
        unit = np.zeros(mismatch_size(self.stranger)) if sizes is None else sizes
        mismatch = mismatch_at(self.stranger, unit)
        if real:
            found = real_run(self.stranger, mismatch, effects)
        else:
            found = run(self.stranger, mismatch, effects, self.step)
        return self._seen(whitened(self.stranger, found)) if found.sound else np.array([np.nan])

    def _natively(self, unit: Floats) -> Floats:
        mismatch = mismatch_at(self.stranger, unit)
        return self._seen(whitened_natively(self.stranger, mismatch, self.step))

    def _seen(self, readings: Floats) -> Floats:
        """What a detector compares, over its standard deviations (k,)."""
        if self.stranger.traits.kind == "efforts":
            return seen_torques(self.stranger, readings)
        return readings

    @property
    def background(self) -> Background:
        """Readings without an effect, and their change with the mismatches."""
        if self._background is None:
            units = np.eye(mismatch_size(self.stranger))
            middle, start = self.readings(), self._natively(0.0 * units[0])
            # Nothing is integrated in a log of torques, so that its model's step has no error.
            efforts = self.stranger.traits.kind == "efforts"
            exact = start if efforts else self.readings(real=True)
            if np.isnan(middle).any() or np.isnan(exact).any():
                raise ValueError(f"machine {self.stranger.seed} leaves its ranges")
            weight = np.ones_like(middle) if efforts else self._weight(start - exact)
            columns = [weight * (self._natively(unit) - start) for unit in units]
            for i, unit in enumerate(units):
                if np.linalg.norm(columns[i]) > LARGE:
                    exactly = weight * self.readings(sizes=unit) - weight * middle
                    columns[i] = columns[i] if np.isnan(exactly).any() else exactly
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
