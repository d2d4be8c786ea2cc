"""Whitening of residuals whose covariance comes from sensor noise and tolerances of the model.

A nominal model is never exact. Each parameter of each cause has a tolerance, a deviation that is
not a fault. The residuals that tolerances cause are correlated over the whole log. Let N (n, p) be
the sensitivities of the residual, each column scaled by its tolerance, and D a diagonal matrix that
inflates the variance of readings whose errors are autocorrelated. The covariance of a residual in
units of sensor noise is then C = D + N N'. `Whitening` applies C^(-1/2), after which ordinary least
squares is maximum likelihood with all tolerances integrated out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from reality_gap.types import Bools, Floats, Ints

LEAST = 1e-10
"""Smallest size of a direction of the tolerances, relative to the largest. Where that is 1e7
noises, as in a machine that moves without feedback, one of a noise counts."""


@dataclass(frozen=True)
class Whitening:
    """C^(-1/2) of the readings in use.

    Attributes:
        use: which readings are in use, shape (n,).
        weight: 1 / sqrt(D) of those, shape (u,).
        basis: orthonormal basis of the weighted tolerances, shape (u, p).
        shrink: share of each of these directions that is removed, shape (p,).
    """

    use: Bools
    weight: Floats
    basis: Floats
    shrink: Floats

    def __call__(self, residual: Floats) -> Floats:
        """Whiten residuals in units of sensor noise, shape (n,) or (n, k), to (u,) or (u, k)."""
        scaled = (residual[self.use].T * self.weight).T
        along = self.basis.T @ scaled
        return scaled - self.basis @ (along.T * self.shrink).T


def whitening(tolerances: Floats, inflation: Floats, use: Bools) -> Whitening:
    """Compute C^(-1/2).

    Args:
        tolerances: change of the residual by each tolerance in units of sensor noise, shape (n, p).
        inflation: the diagonal of D, shape (n,); see `variance_inflation`.
        use: which readings to use, shape (n,).
    """
    weight = 1.0 / np.sqrt(inflation[use])
    scaled = tolerances[use] * weight[:, None]
    power, vectors = directions(scaled)
    basis = scaled @ (vectors / np.sqrt(power))
    return Whitening(use, weight, basis, 1.0 - 1.0 / np.sqrt(1.0 + power))


def directions(tolerances: Floats) -> tuple[Floats, Floats]:
    """Return power (k,) and orthonormal vectors (p, k) of the directions that tolerances have.

    Their squares are not formed, in which small directions would be lost beside large ones.

    Args:
        tolerances: N, shape (n, p).
    """
    triangle = np.linalg.qr(tolerances, mode="r")
    _, size, vectors = np.linalg.svd(triangle, full_matrices=False)
    large = size > LEAST * max(1.0, float(size.max(initial=0.0)))
    return size[large] ** 2, vectors[large].T


def variance_inflation(remainder: Floats, channels: Ints, limit: int = 100) -> Floats:
    """Estimate how many readings count as one, from the autocorrelation of each channel.

    n autocorrelated readings hold the information of n_eff independent ones. The inflation is
    n / n_eff = 1 + 2 sum(rho), where rho is the autocorrelation at each lag, summed up to the first
    negative one (initial positive sequence, Geyer 1992).

    Args:
        remainder: residual in units of noise, ordered by time within a channel, shape (n,).
        channels: channel of each reading, shape (n,).
        limit: largest lag.

    Returns:
        Inflation of each reading, shape (n,), at least 1.
    """
    result = np.ones(len(remainder))
    for channel in np.unique(channels):
        at = channels == channel
        x = remainder[at] - remainder[at].mean()
        power = float(x @ x)
        if len(x) < 8 or power == 0.0:
            continue
        total = 1.0
        for lag in range(1, min(limit, len(x) // 4)):
            rho = float(x[lag:] @ x[:-lag]) / power
            if rho <= 0.0:
                break
            total += 2.0 * rho
        result[at] = total
    return result


def likeliest_sizes(tolerances: Floats, inflation: Floats, use: Bools, residual: Floats) -> Floats:
    """Estimate the deviations that tolerances have, from a residual.

    They are the posterior mean of s with the residual N s and s ~ N(0, I), given the readings in
    use. As in `directions`, squares are not formed.

    Args:
        tolerances: N, shape (n, p).
        inflation: the diagonal of D, shape (n,).
        use: which readings to infer from, shape (n,).
        residual: residuals of all readings in units of sensor noise, shape (n,) or (n, k).

    Returns:
        Deviations in tolerances, shape (p,) or (p, k).
    """
    weight, count = 1.0 / np.sqrt(inflation[use]), tolerances.shape[1]
    columns = np.column_stack([tolerances, residual])[use] * weight[:, None]
    prior = np.eye(count, columns.shape[1])
    matrix: Floats = np.vstack([columns, prior])
    triangle = np.asarray(np.linalg.qr(matrix, mode="r"))
    sizes = solve_triangular(triangle[:count, :count], triangle[:count, count:])
    return np.asarray(sizes, dtype=np.float64).reshape(count, *residual.shape[1:])


def explained_by_tolerances(
    tolerances: Floats, inflation: Floats, use: Bools, residual: Floats
) -> Floats:
    """Estimate the part of a residual that tolerances explain, shape (n,).

    The arguments are those of `likeliest_sizes`, with one residual.
    """
    return tolerances @ likeliest_sizes(tolerances, inflation, use, residual)
