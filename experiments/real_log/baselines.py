"""Other methods, which estimate joint angles from the same samples without our map.

Each corrects the joint angles of the data sheet's transmission, and does so for each group of
joints that the data sheet couples, from the joint angles of that group, as our map does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from experiments.real_log.machine import GROUPS, joints_of
from jmm_agent.types import Floats

Correction = Callable[[Floats], Floats]
"""Joint angles by the data sheet (N, k) [rad] -> what must be added to them (N, k) [rad]."""

WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Widths of the radial kernel to choose from [rad]."""
SHAPES, NOISES = (0.03, 0.1, 0.3, 1.0), (0.03, 0.1, 0.3, 1.0)
"""Standard deviations of shape and noise to choose from, as shares of the corrections' size [1]."""
OFFSET = 2.0
"""Standard deviation of the offset, as a share of the corrections' size [1]."""


def nothing(angles: Floats, missed: Floats) -> Correction:
    """The data sheet alone."""
    return np.zeros_like


def constant(angles: Floats, missed: Floats) -> Correction:
    """One constant for each joint."""
    mean = missed.mean(axis=0)
    return lambda other: np.broadcast_to(mean, other.shape)


def linear(angles: Floats, missed: Floats) -> Correction:
    """Least squares of a constant and a slope for each joint of the group.

    Of the corrections that fit few samples equally well it is the smallest.
    """
    weights = np.linalg.lstsq(_with_constant(angles), missed)[0]
    return lambda other: _with_constant(other) @ weights


def gaussian_process(angles: Floats, missed: Floats) -> Correction:
    """Gaussian process with an offset, a radial kernel and noise, by marginal likelihood."""
    size = np.sqrt(np.mean(missed**2, axis=0)) + np.finfo(float).tiny
    scaled, best = missed / size, (-np.inf, 1.0, 1.0, np.zeros_like(missed))
    for width, shape, noise in product(WIDTHS, SHAPES, NOISES):
        covariance = _kernel(angles, angles, width, shape) + noise**2 * np.eye(len(angles))
        factor = cho_factor(covariance, lower=True)
        weights = cho_solve(factor, scaled)
        evidence = -0.5 * float(np.sum(scaled * weights))
        evidence -= missed.shape[1] * float(np.log(np.diag(factor[0])).sum())
        best = max(best, (evidence, width, shape, weights), key=lambda found: found[0])
    _, width, shape, weights = best
    return lambda other: size * (_kernel(other, angles, width, shape) @ weights)


METHODS: Mapping[str, Callable[[Floats, Floats], Correction]] = {
    "data sheet": nothing,
    "constants": constant,
    "linear regression": linear,
    "Gaussian process": gaussian_process,
}
"""Methods by title: joint angles by the data sheet (K, k) and what they miss (K, k) [rad] -> the
correction of a group."""


def corrected(method: str, sheet: Floats, measured: Floats, other: Floats) -> Floats:
    """Joint angles (N, 6) [rad] that a method estimates.

    Args:
        method: of `METHODS`.
        sheet: joint angles by the data sheet of the samples to learn from (K, 6) [rad].
        measured: their measured joint angles (K, 6) [rad].
        other: joint angles by the data sheet of other samples (N, 6) [rad].
    """
    result = other.copy()
    for group in GROUPS:
        own = joints_of(group)
        correction = METHODS[method](sheet[:, own], measured[:, own] - sheet[:, own])
        result[:, own] += correction(other[:, own])
    return result


def _kernel(one: Floats, other: Floats, width: float, shape: float) -> Floats:
    """Covariance of corrections (N, K), in units of their size squared."""
    squares = np.sum((one[:, None] - other[None]) ** 2, axis=2)
    return OFFSET**2 + shape**2 * np.exp(-0.5 * squares / width**2)


def _with_constant(angles: Floats) -> Floats:
    """Terms (N, 1 + k) of a regression."""
    return np.column_stack([np.ones(len(angles)), angles])
