"""Expansion: about which deviations within the tolerances the readings are linearised.

Where small deviations of a model change the readings by many noises, as in a machine that is moved
without feedback, the changes are not linear in the deviations, and what linear columns leave looks
like a fault. With the residual r(s) of a replay with deviations s in units of their tolerances, and
the changes N(s) of the readings by one more tolerance each, the residual

    r(s) + N(s) s

is that of the nominal model apart from what is not linear up to s. Replays of hypotheses are
corrected alike, so that the deviations still have a normal prior with the mean 0. The most probable
s is found by Gauss-Newton steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.inference.tolerances import Tolerance
from reality_gap.inference.whitening import explained_by_tolerances, whitening
from reality_gap.simulation.hypothesis import has_effects
from reality_gap.simulation.replayer import Expansion, Replayer
from reality_gap.study.splits import SELECT, split
from reality_gap.study.system import System
from reality_gap.types import Floats

LARGE = 5.0
"""RMS of what tolerances explain from which on it is not taken for linear [noise]."""
UNEXPLAINED = 1.05
"""Mean square of the whitened residual up to which linear columns suffice."""
STEPS = 3
"""Largest number of steps."""
SHARES = (1.0, 0.5, 0.25)
"""Shares of a step that are tried."""
BETTER = 0.98
"""Factor by which a step must reduce the mean square of the whitened residual."""
MOST = 3.0
"""Largest deviation of a parameter in the expansion, in tolerances."""
COUNT = 80
"""Largest number of parameters in the expansion: those that explain most."""
SMALL = 0.25
"""Finite difference, in tolerances."""


class Expanded(NamedTuple):
    """Linearisation about deviations within the tolerances.

    Attributes:
        residual: residual of the nominal model, corrected, shape (n,).
        columns: changes of the readings by all tolerances, shape (n, p).
    """

    residual: Floats
    columns: Floats


def expand(
    replayer: Replayer, tolerances: Sequence[Tolerance], columns: Floats, null_residual: Floats
) -> Expanded:
    """Linearise about the most probable deviations, if tolerances explain much, but not all.

    Args:
        replayer: replays hypotheses; its residuals are corrected afterwards.
        tolerances: the tolerances.
        columns: changes by all tolerances and others, shape (n, p).
        null_residual: residual of the nominal model, shape (n,).
    """
    whitened = _Whitened(replayer, columns)
    found, cost = Expanded(null_residual, columns), whitened.power(null_residual, columns)
    if whitened.explained(null_residual) < LARGE or cost < UNEXPLAINED:
        return found
    chosen = _choose(replayer, tolerances, whitened, null_residual)
    if not chosen:
        return found
    low, high = np.array([_bounds(one) for one in chosen]).T
    sizes, slopes = np.zeros(len(chosen)), np.column_stack([one.column for one in chosen])
    residual, kept = null_residual, Expansion()
    for _ in range(STEPS):
        wide = np.column_stack([columns, slopes])
        aim = np.clip(whitened.sizes(residual + slopes @ sizes, wide)[-len(chosen) :], low, high)
        trials = [sizes + share * (aim - sizes) for share in SHARES]
        residuals = _replay(replayer, chosen, trials)
        powers = [
            whitened.power(r + slopes @ s, wide) for r, s in zip(residuals, trials, strict=True)
        ]
        best = int(np.argmin(powers))
        sizes, residual = trials[best], residuals[best]
        slopes = _slopes(replayer, chosen, sizes, residual, high)
        wide = np.column_stack([columns, slopes])
        power = whitened.power(residual + slopes @ sizes, wide)
        if not power < BETTER * cost:
            break
        parts = tuple(o.deviation(float(s)) for o, s in zip(chosen, sizes, strict=True))
        kept = Expansion(parts, slopes @ sizes)
        found, cost = Expanded(residual + slopes @ sizes, wide), power
    replayer.expansion = kept
    return found


class _Whitened:
    """Whitens residuals of the readings from which causes are inferred."""

    def __init__(self, replayer: Replayer, columns: Floats) -> None:
        self._use = split(replayer.measured) <= SELECT
        self._ones = np.ones(len(self._use))
        self._columns = columns

    def power(self, residual: Floats, columns: Floats) -> float:
        """Return the mean square of a whitened residual (n,); infinite if it is not finite."""
        if not np.isfinite(residual).all():
            return float("inf")
        return float(np.mean(whitening(columns, self._ones, self._use)(residual) ** 2))

    def explained(self, residual: Floats) -> float:
        """Return the RMS of what tolerances explain of a residual (n,)."""
        found = explained_by_tolerances(self._columns, self._ones, self._use, residual)
        return float(np.sqrt(np.mean(found**2)))

    def sizes(self, residual: Floats, columns: Floats) -> Floats:
        """Return the most probable weights of columns (n, p), shape (p,)."""
        x = columns[self._use]
        gram = x.T @ x + np.eye(x.shape[1])
        return np.asarray(np.linalg.solve(gram, x.T @ residual[self._use]), dtype=np.float64)


def _choose(
    replayer: Replayer, tolerances: Sequence[Tolerance], whitened: _Whitened, residual: Floats
) -> list[Tolerance]:
    """Return the tolerances that explain most of a residual, in their order."""
    able = [one for one in tolerances if suits(replayer.system, one)]
    if not able:
        return []
    columns = np.column_stack([one.column for one in able])
    effect = np.abs(whitened.sizes(residual, columns)) * np.linalg.norm(columns, axis=0)
    return [able[i] for i in sorted(np.argsort(-effect, kind="stable")[:COUNT])]


def _replay(
    replayer: Replayer, chosen: Sequence[Tolerance], sizes: Sequence[Floats]
) -> list[Floats]:
    """Return the residuals with deviations of these sizes (p,) in tolerances."""
    replayer.expansion = Expansion()
    trials = [[o.deviation(float(x)) for o, x in zip(chosen, s, strict=True)] for s in sizes]
    return replayer.residuals(trials)


def _slopes(
    replayer: Replayer, chosen: Sequence[Tolerance], sizes: Floats, residual: Floats, high: Floats
) -> Floats:
    """Return the change of the readings by one more tolerance of each parameter, shape (n, p)."""
    steps = np.where(sizes + SMALL <= high, SMALL, -SMALL)
    residuals = _replay(replayer, chosen, list(sizes + np.diag(steps)))
    return np.column_stack([(residual - r) / h for r, h in zip(residuals, steps, strict=True)])


def suits(system: System, tolerance: Tolerance) -> bool:
    """Return whether a deviation is a number of the model, and of the simplest kind there."""
    candidate, values = tolerance.deviation(1.0)
    cause = candidate.cause
    return cause.edit is not None and not cause.fine and not has_effects(system, candidate, values)


def _bounds(tolerance: Tolerance) -> tuple[float, float]:
    """Return the smallest and the largest deviation in the expansion, in tolerances."""
    p = tolerance.parameter
    ends = sorted(((p.low - p.null) / tolerance.size, (p.high - p.null) / tolerance.size))
    return max(-MOST, ends[0]), min(MOST, ends[1])
