"""Fits of structures to runs, their errors on runs held out, and intervals of their parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from experiments.davinci.log import Runs
from experiments.davinci.models import Structure, predict
from jmm_agent.types import Floats

TORQUE_SCALE, JAW_SCALE = 0.006, 0.007
"""Errors of the best structures, which weight torques [N m] against angles [rad]."""


@dataclass(frozen=True)
class Fitted:
    """A fitted structure.

    Attributes:
        structure: that was fitted.
        values: of its parameters, shape (p,).
        jacobian, residual: at the solution, shapes (m, p) and (m,).
    """

    structure: Structure
    values: Floats
    jacobian: Floats
    residual: Floats


@dataclass(frozen=True)
class Errors:
    """RMS errors of the torque [N m] and of the jaw's angle [rad]."""

    torque: float
    jaw: float


def fit(structure: Structure, runs: Runs, start: Floats | None = None) -> Fitted:
    """Fit a structure by least squares over all samples in use; ``start`` has shape (p,)."""
    begin = structure.start() if start is None else start
    found = least_squares(
        lambda values: _residual(structure, values, runs),
        begin,
        x_scale=np.maximum(np.abs(structure.start()), 0.01),
        diff_step=1e-4,
        max_nfev=30,
        ftol=1e-5,
    )
    return Fitted(structure, found.x, found.jac, found.fun)


def _residual(structure: Structure, values: Floats, runs: Runs) -> Floats:
    torque, jaw = predict(structure, values, runs)
    return np.concatenate(
        [
            ((torque - runs.torque) / TORQUE_SCALE).T[runs.use.T],
            ((jaw - runs.jaw) / JAW_SCALE).T[runs.use.T],
        ]
    )


def errors(fitted: Fitted, runs: Runs) -> Errors:
    """Errors of a fitted structure on runs."""
    torque, jaw = predict(fitted.structure, fitted.values, runs)
    return Errors(
        float(np.sqrt(np.mean((torque - runs.torque)[runs.use] ** 2))),
        float(np.sqrt(np.mean((jaw - runs.jaw)[runs.use] ** 2))),
    )


def held_out(structure: Structure, runs: Runs, by: Floats, start: Floats) -> dict[float, Errors]:
    """Errors on each group of runs, fitted to all other runs.

    Args:
        structure: to fit.
        runs: all runs.
        by: load or frequency of each run, shape (r,).
        start: of the fits, shape (p,).
    """
    found = {}
    for value in np.unique(by):
        fitted = fit(structure, runs.chosen(by != value), start)
        found[float(value)] = errors(fitted, runs.chosen(by == value))
    return found


def intervals(fitted: Fitted, runs: Runs) -> Floats:
    """Half widths of the parameters' 95 % intervals (p,).

    Residuals are correlated within a run, so the covariance is the cluster-robust sandwich with one
    cluster a run.
    """
    owner = _owner(runs)
    inverse = np.linalg.pinv(fitted.jacobian.T @ fitted.jacobian)
    scatter = np.zeros_like(inverse)
    for run in range(len(runs.load)):
        pull = fitted.jacobian[owner == run].T @ fitted.residual[owner == run]
        scatter += np.outer(pull, pull)
    count = len(runs.load)
    covariance = inverse @ scatter @ inverse * count / (count - 1)
    return student.ppf(0.975, count - 1) * np.sqrt(np.diag(covariance))


def _owner(runs: Runs) -> NDArray[np.int64]:
    """Index of the run of each residual, shape (m,)."""
    once = np.repeat(np.arange(len(runs.load)), runs.use.sum(axis=0))
    return np.concatenate([once, once])
