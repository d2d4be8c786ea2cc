"""How likely the data are under a suspect: marginal likelihoods of linear Gaussian models."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from reality_gap.types import Floats

PRIOR = 3.0
"""Standard deviation of a fault's parameters, in units of their ``scale``, where one must do."""
SIZES = (3.0, 1.0, 0.3, 0.1)
"""Standard deviations that are equally likely: nobody knows how large a fault will be."""


@dataclass(frozen=True)
class LinearFit:
    """A linear fit of whitened residuals.

    Attributes:
        theta: (p,) in scales from the null.
        evidence: log marginal likelihood over the one without these columns [nats].
    """

    theta: Floats
    evidence: float


def fit_normal(
    gram: Floats, right: Floats, low: Floats, high: Floats, cause: NDArray[np.int64]
) -> LinearFit:
    """Fit whitened columns to a whitened residual, with a normal prior within bounds.

    Args:
        gram: (p, p) products of the columns, per scale of a parameter.
        right: (p,) products of the columns with the residual.
        low, high: (p,) bounds of theta.
        cause: (p,) which cause a parameter belongs to; see `complexity`.
    """
    precision = gram + np.eye(len(right)) / PRIOR**2
    theta: Floats = np.linalg.solve(precision, right).astype(np.float64)
    if np.any(theta < low) or np.any(theta > high):
        root = np.linalg.cholesky(precision).T
        theta = lsq_linear(root, np.linalg.solve(root.T, right), bounds=(low, high)).x.astype(
            np.float64
        )
    quality = float(right @ theta - 0.5 * theta @ gram @ theta)
    price = complexity(gram, theta, cause, np.zeros(len(right), dtype=bool))
    return LinearFit(theta, quality - price)


def complexity(
    gram: Floats, theta: Floats, cause: NDArray[np.int64], flat: NDArray[np.bool_]
) -> float:
    """What a model pays for the room that its parameters have [nats].

    By Laplace: theta's distance from the null in prior deviations, and half the log determinant of
    posterior over prior precision; averaged over `SIZES` for each cause by itself.

    Args:
        gram: (p, p) Fisher information per squared scale.
        theta: (p,) in scales from the null.
        cause: (p,) which cause each parameter belongs to; -1 for those whose deviation is `PRIOR`.
        flat: (p,) whether where a parameter stands costs nothing.
    """
    causes = np.unique(cause[cause >= 0])
    distance = np.where(flat, 0.0, theta**2)
    logs = []
    for sizes in product(SIZES, repeat=len(causes)):
        deviation = np.full(len(theta), PRIOR)
        for one, size in zip(causes, sizes, strict=True):
            deviation[(cause == one) & ~flat] = size
        room = np.eye(len(theta)) + deviation[:, None] * gram * deviation
        logs.append(-0.5 * float(np.sum(distance / deviation**2) + np.linalg.slogdet(room)[1]))
    return float(np.log(len(logs)) - np.logaddexp.reduce(logs))


def occam(gram: Floats) -> float:
    """Half the log determinant of posterior over prior precision, with deviation `PRIOR` [nats]."""
    _, size = np.linalg.slogdet(np.eye(len(gram)) + PRIOR**2 * gram)
    return 0.5 * float(size)
