"""Folds: how well causes predict readings to which their parameters were not fitted.

The blocks of a log take four turns (see `reality_gap.study.splits`), which are the folds. For each
fold the parameters are fitted again to the three others, by one linear step, and the fold is
predicted. The times of an event stay: of one within the fold, the others show nothing. The
residuals are whitened by the noise and the tolerances of the nominal model (see
`reality_gap.inference.whitening`), so that a model gains nothing by what tolerances explain as
well. For the whitened residuals e and e + d of two models, the gain in log likelihood of the first
over the second is

    e' d + d' d / 2.

Its first term is uncertain. Its variance is the larger of two estimates: that by the noise and by
the tolerances, which are the same in all folds, times the mean square of e where that is above 1,
and the sum over blocks of time of the squared parts of e' d, which is robust to errors of the form
of a model. An event that lies in one block has an interval, too, which a bootstrap over blocks
would not give.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from reality_gap.diagnosis import Gain
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.held_out import LEAST_WEIGHT
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import free_parameters, is_time, prior_weights
from reality_gap.study.splits import REPORT, TURN, blocks, turn
from reality_gap.types import Floats, Ints

WIDE = 1.96
"""Half of a 95 % interval, in standard deviations."""


@dataclass(frozen=True)
class Folds:
    """The folds of a problem's readings.

    Attributes:
        problem: what is to be explained.
        fitted: the fit whose gain is to be known.
    """

    problem: Problem
    fitted: Fit

    def cross_validated(self, without: Fit) -> Gain:
        """Return the gain in log likelihood of all folds over another fit [nats].

        Args:
            without: the fit to compare with, such as the nominal model.
        """
        pairs = zip(self._refitted(without), self._own, strict=True)
        return _gain([self._compare(one, other, fold) for fold, (one, other) in enumerate(pairs)])

    def report(self, without: Fit) -> Gain:
        """Return the gain in log likelihood of the report split, to which nothing was fitted."""
        fold = TURN.index(REPORT)
        return _gain([self._compare(without.residual, self.fitted.residual, fold)])

    @cached_property
    def _own(self) -> list[Floats]:
        """Residual of the fit, refitted without each fold, shape (n,) each."""
        return self._refitted(self.fitted)

    @cached_property
    def fold(self) -> Ints:
        """Number of the fold of each reading, shape (n,)."""
        return turn(self.problem.measured)

    @cached_property
    def _block(self) -> Ints:
        """Number of the block of each reading, shape (n,)."""
        return blocks(self.problem.measured)

    @cached_property
    def _grams(self) -> list[Floats]:
        """Gram matrix of the tolerances in each fold, shape (p, p)."""
        parts = (self._part(self.problem.noise_model.tolerances, k) for k in range(len(TURN)))
        return [part.T @ part for part in parts]

    @cached_property
    def _removals(self) -> list[Floats]:
        """R of each fold, with which C^(-1/2) x = x - N R N'x, shape (p, p)."""
        return [_removal(gram) for gram in self._grams]

    @cached_property
    def _covariances(self) -> list[Floats]:
        """Covariance of the tolerances given all folds but one, by fold, shape (p, p)."""
        whole = np.sum(self._grams, axis=0) + np.eye(len(self._grams[0]))
        return [np.linalg.inv(whole - gram) for gram in self._grams]

    def _part(self, columns: Floats, fold: int) -> Floats:
        """Return columns (n, k) of the readings of a fold in units of the inflated noise."""
        use = self.fold == fold
        return columns[use] / np.sqrt(self.problem.noise_model.inflation[use])[:, None]

    def _refitted(self, fitted: Fit) -> list[Floats]:
        """Return the residual (n,) after a linear step to the optimum of the other folds, by fold.

        With the columns X of a fit and the tolerances N of a fold, X'X and N'X are sums over folds.
        """
        if fitted.is_null:
            return [fitted.residual] * len(TURN)
        stays = [is_time(p) for _, p in free_parameters(fitted.hypothesis)]
        jacobian, theta = np.delete(fitted.jacobian, stays, axis=1), np.delete(fitted.theta, stays)
        columns = np.column_stack([jacobian, fitted.residual])
        power, cross = [], []
        for fold in range(len(TURN)):
            x = self._part(columns, fold)
            power.append(x.T @ x)
            cross.append(self._part(self.problem.noise_model.tolerances, fold).T @ x)
        weights = np.delete(prior_weights(fitted.hypothesis), stays)
        weights = np.maximum(weights, LEAST_WEIGHT) ** 2
        found = []
        for fold, covariance in enumerate(self._covariances):
            along = np.sum(cross, axis=0) - cross[fold]
            precise = np.sum(power, axis=0) - power[fold] - along.T @ covariance @ along
            matrix = precise[:-1, :-1] + np.diag(weights)
            step = np.linalg.solve(matrix, precise[:-1, -1] - weights * theta)
            found.append(fitted.residual - jacobian @ step)
        return found

    def _compare(self, before: Floats, after: Floats, fold: int) -> _Part:
        """Compare two residuals (n,) in a fold."""
        removal = self._removals[fold]
        tolerances = self._part(self.problem.noise_model.tolerances, fold)

        def whiten(x: Floats) -> Floats:
            return np.asarray(x - tolerances @ (removal @ (tolerances.T @ x)))

        e, d = whiten(self._part(np.column_stack([after, before - after]), fold)).T
        precise = whiten(d)
        blocks = np.bincount(self._block[self.fold == fold], e * d)
        return _Part(
            gain=float(blocks.sum() + 0.5 * d @ d),
            noise=float(precise @ precise),
            shared=tolerances.T @ precise,
            robust=float(np.sum(blocks**2)),
            spread=max(1.0, float(e @ e) / max(1, len(e))),
        )


class _Part(NamedTuple):
    """The gain in one fold, and estimates of the variance of e'd.

    Attributes:
        gain: the gain [nats].
        noise: variance by the noise.
        shared: sensitivity of e'd to the tolerances, shape (p,), which all folds share.
        robust: sum over blocks of the squared parts of e'd.
        spread: mean square of e, at least 1.
    """

    gain: float
    noise: float
    shared: Floats
    robust: float
    spread: float


def _gain(parts: Sequence[_Part]) -> Gain:
    """Return the gain of some folds together with its interval."""
    value = sum(part.gain for part in parts)
    shared = sum((part.shared for part in parts), np.zeros(len(parts[0].shared)))
    spread = float(np.mean([part.spread for part in parts]))
    expected = spread * (sum(part.noise for part in parts) + float(shared @ shared))
    wide = WIDE * float(np.sqrt(max(expected, sum(part.robust for part in parts))))
    return Gain(value, value - wide, value + wide)


def _removal(gram: Floats) -> Floats:
    """Return R, with which C^(-1/2) x = x - N R N'x for tolerances N, shape (p, p).

    Args:
        gram: N'N of the readings in use, in units of the inflated noise, shape (p, p).
    """
    power, vectors = np.linalg.eigh(gram)
    power = np.maximum(power, 1e-9)  # rounding errors may make it negative
    return np.asarray((vectors * ((1.0 - 1.0 / np.sqrt(1.0 + power)) / power)) @ vectors.T)
