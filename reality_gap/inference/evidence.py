"""Evidence of a hypothesis: the marginal likelihood of a linear Gaussian model.

With whitened columns X of the parameters, a whitened residual r and a normal prior of theta, the
log likelihood at its best theta is reduced by a penalty for the freedom of the parameters, by
Laplace's approximation (see `complexity`). All evidence is relative to the model without these
columns and in nats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from reality_gap.types import Bools, Floats, Ints

PRIOR = 3.0
"""Standard deviation of a fault's parameters in units of their ``scale``, as a single value."""
SIZES = (100.0, 20.0, 4.0, 0.8, 0.15)
"""Equally likely standard deviations of a fault's parameters in units of their ``scale``."""


@dataclass(frozen=True)
class LinearFit:
    """Result of a linear fit to a whitened residual.

    Attributes:
        theta: parameters in scales from their null values, shape (p,).
        evidence: log marginal likelihood relative to the one without these columns [nats].
    """

    theta: Floats
    evidence: float


def fit_normal(gram: Floats, right: Floats, low: Floats, high: Floats, cause: Ints) -> LinearFit:
    """Fit whitened columns X to a whitened residual r, with a normal prior within bounds.

    Args:
        gram: X'X with columns per scale of a parameter, shape (p, p).
        right: X'r, shape (p,).
        low, high: bounds of theta, shape (p,).
        cause: index of the cause that each parameter belongs to, shape (p,); see `complexity`.
    """
    precision = gram + np.eye(len(right)) / PRIOR**2
    theta: Floats = np.linalg.solve(precision, right).astype(np.float64)
    if np.any(theta < low) or np.any(theta > high):
        root = np.linalg.cholesky(precision).T
        theta = lsq_linear(root, np.linalg.solve(root.T, right), bounds=(low, high)).x.astype(
            np.float64
        )
    quality = float(right @ theta - 0.5 * theta @ gram @ theta)
    penalty = complexity(gram, theta, cause, np.zeros(len(right), dtype=bool))
    return LinearFit(theta, quality - penalty)


def complexity(gram: Floats, theta: Floats, cause: Ints, flat: Bools) -> float:
    """Compute the penalty for the freedom of a model's parameters [nats].

    By Laplace's approximation this is half the squared distance of theta from the null in prior
    deviations, plus half the log determinant of posterior over prior precision. The likelihood is
    averaged over the deviations `SIZES`, independently for each cause. This average over all
    combinations is taken about the likeliest one, as if the deviation of one cause did not change
    what those of the others are worth. That is exact for one cause, and to within 0.1 nat for
    several, but too much by up to 2 nats where causes predict nearly the same.

    Args:
        gram: Fisher information per squared scale, shape (p, p).
        theta: parameters in scales from their null values, shape (p,).
        cause: index of the cause that each parameter belongs to, shape (p,); -1 for a parameter
            whose deviation is `PRIOR`.
        flat: whether the value of a parameter is not penalised, shape (p,).
    """
    distance = np.where(flat, 0.0, theta**2)
    own = [(cause == one) & ~flat for one in np.unique(cause[cause >= 0])]
    deviation = np.full(len(theta), PRIOR)
    for members in own:
        deviation[members] = _nearest_size(theta[members])
    best = float(_log_density(gram, distance, deviation[None])[0])
    before, averages = -np.inf, list[float]()
    while best > before:
        before, averages = best, []
        for members in own:
            trials = np.repeat(deviation[None], len(SIZES), axis=0)
            trials[:, members] = np.array(SIZES)[:, None]
            logs = _log_density(gram, distance, trials)
            averages.append(float(np.logaddexp.reduce(logs) - np.log(len(SIZES))))
            if logs.max() > best:
                best, deviation = float(logs.max()), trials[np.argmax(logs)]
    return -best - sum(average - best for average in averages)


def _nearest_size(theta: Floats) -> float:
    """Return the deviation of `SIZES` that is nearest to the RMS of theta (p,)."""
    size = np.sqrt(np.mean(theta**2)) if len(theta) else 0.0
    return min(SIZES, key=lambda one: abs(one - size))


def _log_density(gram: Floats, distance: Floats, deviation: Floats) -> Floats:
    """Return minus the penalty for prior deviations (s, p), shape (s,) [nats]."""
    ratio = np.eye(len(gram)) + deviation[:, :, None] * gram * deviation[:, None, :]
    spread = np.sum(distance / deviation**2, axis=1)
    return np.asarray(-0.5 * (spread + np.linalg.slogdet(ratio)[1]), dtype=np.float64)


def occam(gram: Floats) -> float:
    """Return half the log determinant of posterior over prior precision for `PRIOR` [nats]."""
    _, log_determinant = np.linalg.slogdet(np.eye(len(gram)) + PRIOR**2 * gram)
    return 0.5 * float(log_determinant)
