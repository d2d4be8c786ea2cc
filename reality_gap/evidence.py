"""How likely the data are under a suspect: marginal likelihoods of linear Gaussian models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

Array = NDArray[np.float64]

PRIOR = 3.0
"""Standard deviation of a fault's parameters, in units of their ``scale``."""


@dataclass(frozen=True)
class LinearFit:
    """A linear fit of whitened residuals.

    Attributes:
        theta: (p,) in scales from the null.
        evidence: log marginal likelihood over the one without these columns [nats].
    """

    theta: Array
    evidence: float


def linear_fit(residual: Array, columns: Array, low: Array, high: Array) -> LinearFit:
    """Fit whitened columns to a whitened residual, with a normal prior within bounds.

    Args:
        residual: (u,) whitened.
        columns: (u, p) whitened, per scale of a parameter.
        low, high: (p,) bounds of theta.
    """
    gram, right = columns.T @ columns, columns.T @ residual
    return fit_normal(gram, right, low, high)


def fit_normal(gram: Array, right: Array, low: Array, high: Array) -> LinearFit:
    """The same from the normal equations: ``gram`` (p, p) and ``right`` (p,)."""
    precision = gram + np.eye(len(right)) / PRIOR**2
    theta = np.linalg.solve(precision, right)
    if np.any(theta < low) or np.any(theta > high):
        root = np.linalg.cholesky(precision).T
        theta = lsq_linear(root, np.linalg.solve(root.T, right), bounds=(low, high)).x
    quality = float(right @ theta - 0.5 * theta @ precision @ theta)
    return LinearFit(np.asarray(theta, dtype=np.float64), quality - occam(gram))


def occam(gram: Array) -> float:
    """What a model pays for the room that its parameters have [nats].

    Half the log determinant of posterior over prior precision, for ``gram`` (p, p), the Fisher
    information per squared scale.
    """
    _, size = np.linalg.slogdet(np.eye(len(gram)) + PRIOR**2 * gram)
    return 0.5 * float(size)
