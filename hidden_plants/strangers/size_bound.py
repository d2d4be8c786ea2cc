"""Lower bound of the error of an estimate of a hidden effect's size.

The structure of the effect is known, as are the noise and the distribution of the mismatches. Let
s be the true size of the effect, with the mismatches m that act in the same way, and x the change
of all readings per unit of s. The readings y change with the mismatches by S m, and s by g'm where
the amplitude of the effect is constant, so that for a given s they change by (S - x g') m. With the
covariance C of the noise and of this, no estimate that is linear in the readings and without bias
has a smaller variance than

    (x' C^-1 x)^-1,

which is the Cramer-Rao bound if the mismatches are normally distributed. For an effect that no
mismatch resembles it is (a / d)^2, where d is the oracle's detectability of a small amplitude a.
The oracle's noise includes the error of the nominal model because of its time step and of its law
of friction, which no estimate by that model can know.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mismatch import mismatch_at, mismatch_size
from hidden_plants.strangers.oracle import SPREAD, Oracle
from hidden_plants.strangers.truth import true_size
from hidden_plants.types import Floats

STEP = 0.1
"""Finite difference of the amplitude, over the amplitude."""


class SizeBound(NamedTuple):
    """Smallest standard deviation of an estimate of an effect's true size, in its unit.

    Attributes:
        oracle: with the oracle's noise, which includes the error of the nominal model.
        readings: with the noise of the readings alone.
    """

    oracle: float
    readings: float


def size_bound(oracle: Oracle, effect: Effect) -> SizeBound:
    """Compute the smallest standard deviation of an estimate of an effect's true size.

    Args:
        oracle: of the machine.
        effect: the hidden effect, about whose amplitude the readings are linearised.

    Returns:
        The bounds in the unit of `true_size`; infinite if no reading depends on the size.

    Raises:
        ValueError: the effect has no true size, or the machine leaves its ranges.
    """
    known = oracle.background
    trials = [scaled(effect, 1.0 - STEP), scaled(effect, 1.0 + STEP)]
    below, above = (known.weight * oracle.readings((one,)) for one in trials)
    if np.isnan(below).any() or np.isnan(above).any():
        raise ValueError(f"machine {oracle.stranger.seed} leaves its ranges with {effect.id}")
    none = np.zeros(mismatch_size(oracle.stranger))
    first, last = (_size(oracle, one, none) for one in trials)
    change = (above - below) / (last - first)
    slopes = known.slopes - np.outer(change, _shares(oracle, effect))
    plain = 1.0 / known.weight
    return SizeBound(
        _deviation(change, slopes), _deviation(plain * change, plain[:, None] * slopes)
    )


def scaled(effect: Effect, factor: float) -> Effect:
    """Return an effect with its amplitude times a factor."""
    size = factor * effect.parameters["size"]
    return Effect(effect.id, effect.elements, {**effect.parameters, "size": size}, size)


def _size(oracle: Oracle, effect: Effect, unit: Floats) -> float:
    found = true_size(oracle.stranger, effect, mismatch_at(oracle.stranger, unit))
    if found is None:
        raise ValueError(f"the size of {effect.id} has more than one definition")
    return found


def _shares(oracle: Oracle, effect: Effect) -> Floats:
    """Return the change of the true size per standard deviation of each mismatch (m,)."""
    units = np.eye(mismatch_size(oracle.stranger))
    middle = _size(oracle, effect, 0.0 * units[0])
    return SPREAD * np.array([_size(oracle, effect, unit) - middle for unit in units])


def _deviation(change: Floats, slopes: Floats) -> float:
    """Return (x' C^-1 x)^(-1/2) for the change x (k,) and C = I + slopes slopes' (k, m)."""
    along = slopes.T @ change
    inner = np.linalg.solve(np.eye(slopes.shape[1]) + slopes.T @ slopes, along)
    information = float(change @ change - along @ inner)
    return information**-0.5 if information > 0.0 else float("inf")
