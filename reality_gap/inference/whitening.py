"""What a residual is measured in: sensor noise, and what every honest drawing is off by.

A drawing is never exact. Every parameter of every cause has a tolerance that nobody calls a fault;
the residuals that tolerances make are correlated over the whole log. With their sensitivities N
(columns scaled by tolerance) the covariance of a residual in units of sensor noise is
C = D + N N', D diagonal. `Whitening` applies C^(-1/2), after which plain least squares is maximum
likelihood with all tolerances integrated out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reality_gap.types import Bools, Floats


@dataclass(frozen=True)
class Whitening:
    """C^(-1/2) on a part of the readings.

    Attributes:
        use: (n,) which readings.
        weight: (u,) 1 / sqrt(D) of those.
        basis: (u, p) orthonormal, spanning the weighted tolerances.
        shrink: (p,) by how much each of these directions counts less.
    """

    use: Bools
    weight: Floats
    basis: Floats
    shrink: Floats

    def __call__(self, residual: Floats) -> Floats:
        """Whiten residuals in units of sensor noise, (n,) or (n, k), to (u,) or (u, k)."""
        scaled = (residual[self.use].T * self.weight).T
        along = self.basis.T @ scaled
        return scaled - self.basis @ (along.T * self.shrink).T


def whitening(tolerances: Floats, inflation: Floats, use: Bools) -> Whitening:
    """Make C^(-1/2).

    Args:
        tolerances: (n, p) change of the residual, in units of noise, by each tolerance.
        inflation: (n,) D: the number of readings that count as one.
        use: (n,) which readings.
    """
    weight = 1.0 / np.sqrt(inflation[use])
    scaled = tolerances[use] * weight[:, None]
    power, turn = np.linalg.eigh(scaled.T @ scaled)
    large = power > 1e-6 * max(1.0, float(power.max(initial=0.0)))
    power, turn = power[large], turn[:, large]
    basis = scaled @ (turn / np.sqrt(power))
    return Whitening(use, weight, basis, 1.0 - 1.0 / np.sqrt(1.0 + power))


def inflation(remainder: Floats, groups: NDArray[np.int64], limit: int = 100) -> Floats:
    """How many readings count as one, by reading (n,), from each channel's autocorrelation.

    A remainder that wanders tells less than its number of readings; n / n_eff = 1 + 2 sum(rho),
    summed up to the first negative rho (initial positive sequence, Geyer 1992).

    Args:
        remainder: (n,) in units of noise, in order of time within a channel.
        groups: (n,) channel of each reading.
    """
    result = np.ones(len(remainder))
    for group in np.unique(groups):
        at = groups == group
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


def tolerated(tolerances: Floats, spread: Floats, use: Bools, residual: Floats) -> Floats:
    """What tolerances most likely make of a residual (n,), inferred from the readings in use."""
    scaled = tolerances[use] / np.sqrt(spread[use])[:, None]
    right = scaled.T @ (residual[use] / np.sqrt(spread[use]))
    size = np.linalg.solve(scaled.T @ scaled + np.eye(scaled.shape[1]), right)
    return tolerances @ size
