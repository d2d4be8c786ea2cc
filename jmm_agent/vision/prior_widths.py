"""Widths of the prior of a robot's errors, learned from the robot (empirical Bayes).

How far lengths and shapes of a nominal model and the zero posture are off differs from robot to
robot. With the most probable errors w of one kind, in units of their width s, and their posterior
covariance S, the likeliest width is

    s^2 sum w^2 / gamma,    gamma = sum (1 - diag S),

where gamma is the number of errors that the data determine (MacKay, Neural Computation 4, 1992,
eq. 2.17, 2.23). Few muscles and postures tell little, so the options' width counts as `KNOWN` more
errors. Offsets and shapes are not believed to be less wrong than usual: errors that lie in few
directions would make a prior narrow that then suppresses them. Nor are they to be more than
`LARGEST` times as wrong.

For a group of muscles with features Phi and covariance C of its lengths' errors, w = Phi' C^-1 r of
a muscle's residuals r. Joint angles and zero posture x are uncertain, too, with the fit's
Gauss-Newton matrix H, and move the residuals by J, so

    S = 1 - Phi' C^-1 Phi + B H^-1 B',    B = Phi' C^-1 J.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, solve_triangular

from jmm_agent.mapping.prior import GroupKernel, MapPrior
from jmm_agent.types import Floats

KNOWN = 8.0
"""Number of errors that the options' width counts as."""
LARGEST = 10.0
"""Largest width that is believed, in units of the usual one [1]."""
REGULARISATION = 1e-9
"""Added to the Gauss-Newton matrix, relative to its diagonal."""


class PriorWidths(NamedTuple):
    """Standard deviations of the nominal model's errors.

    Attributes:
        offset: of a muscle's length over all postures, beside the effect of the zero posture [m].
        shape: of the change of a length with posture [m].
        zero: of each joint angle at which the lengths were zeroed [rad].
        points: of the displacement of a point of attachment along each axis [m].
    """

    offset: float
    shape: float
    zero: float
    points: float


def usual_widths(prior: MapPrior) -> PriorWidths:
    """Widths of a prior before anything was measured.

    Args:
        prior: prior of the map's error.
    """
    known = prior.options
    shape = known.zeroed_shape if prior.points is None else known.remaining_shape
    return PriorWidths(known.zeroed_offset, shape, known.zero_posture, known.points)


class Linearised(NamedTuple):
    """A fit of K postures and the zero posture, at its end.

    Attributes:
        matrix: Gauss-Newton matrix ((K + 1) n, (K + 1) n), the zero posture last.
        rows: by how much each unknown posture moves each length (K, K + 1): 0 or 1.
        arms: Jacobian of the lengths by each unknown posture (K + 1, m, n) [m/rad].
        missed: measured lengths minus those of the nominal map (K, m) [m].
        kernels: of the lengths' errors, for each group of muscles.
        zero: the zero posture (n,) [rad].
    """

    matrix: Floats
    rows: Floats
    arms: Floats
    missed: Floats
    kernels: Sequence[GroupKernel]
    zero: Floats


def likeliest_widths(fit: Linearised, present: PriorWidths, usual: PriorWidths) -> PriorWidths:
    """Widths that make what was measured likelier (module docstring).

    Args:
        fit: the fit with the present widths.
        present: the present widths.
        usual: widths before anything was measured.
    """
    matrix = fit.matrix.copy()
    matrix[np.diag_indices_from(matrix)] *= 1.0 + REGULARISATION
    lower = np.tril(cho_factor(matrix, lower=True)[0])
    squares, determined = np.zeros(4), np.zeros(4)
    for kernel in fit.kernels:
        weights = kernel.features.T @ kernel.whiten(fit.missed[:, kernel.muscles])
        known = np.sum(kernel.features * kernel.whiten(kernel.features), axis=0)
        known = len(kernel.muscles) * known - _by_postures(fit, kernel, lower)
        kinds = slice(0, 1), slice(1, 1 + kernel.units), slice(1 + kernel.units, None)
        for kind, own in zip((0, 1, 3), kinds, strict=True):
            squares[kind] += np.sum(weights[own] ** 2)
            determined[kind] += known[own].sum()
    joints = len(fit.zero)
    last = np.zeros((len(matrix), joints))
    last[-joints:] = np.eye(joints)
    spread = np.sum(solve_triangular(lower, last, lower=True) ** 2) / present.zero**2
    squares[2] = np.sum(fit.zero**2) / present.zero**2
    determined[2] = joints - spread
    least = np.maximum(determined, 0.0)
    widths = (KNOWN * np.array(usual) ** 2 + np.array(present) ** 2 * squares) / (KNOWN + least)
    offset, shape, zero, points = np.sqrt(widths).tolist()
    return PriorWidths(
        min(max(offset, usual.offset), LARGEST * usual.offset),
        min(max(shape, usual.shape), LARGEST * usual.shape),
        min(zero, LARGEST * usual.zero),
        min(max(points, usual.points), LARGEST * usual.points),
    )


def _by_postures(fit: Linearised, kernel: GroupKernel, lower: Floats) -> Floats:
    """Part of S that uncertain postures cause, by feature (F,), sum over the muscles."""
    pulled = kernel.features.T @ kernel.whiten(fit.rows)
    total = np.zeros(len(pulled))
    for muscle in kernel.muscles:
        moved = (pulled[:, :, None] * fit.arms[:, muscle]).reshape(len(pulled), -1)
        solved = solve_triangular(lower, moved.T, lower=True, check_finite=False)
        total += np.sum(solved**2, axis=0)
    return total
