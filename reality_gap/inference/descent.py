"""Descent: likely sizes of large causes, also from a start that is far from them.

The fits of a search (see `gauss_newton`) take steps of the size of a usual fault and stop where one
of them leads no further. That is enough near a model, but not where a gain of the model is fifty
times too large: half of its range is another servo there. Here gains are factors, whose logarithms
are fitted, and a trust region follows a curved valley.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import free_parameters, theta_bounds, to_theta, with_theta
from reality_gap.simulation.hypothesis import Hypothesis
from reality_gap.types import Bools, Floats

FACTORS = ("position_gain", "velocity_gain")
"""Causes whose excess e is a factor 1 + e."""
LEAST = 1e-3
"""Least factor that is tried."""
STEP = 0.05
"""Step of differences, in scales of a parameter or as a part of a factor."""
DIVERGED = 1e6
"""Residual in place of that of a replay that diverges [noise]."""


def descend(problem: Problem, start: Hypothesis, steps: int) -> Hypothesis:
    """Fit the sizes of causes to the readings of the fit and selection splits; shapes stay.

    Args:
        problem: what is to be explained.
        start: causes with the values to begin with.
        steps: largest number of steps.
    """
    scale, known = _Scale(start), dict[bytes, Floats]()

    def residuals(points: list[Floats]) -> list[Floats]:
        found = problem.replayer.residuals([scale.hypothesis(one) for one in points])
        return [problem.noise_model.whiten(finite(one)) for one in found]

    def residual(point: Floats) -> Floats:
        key = point.tobytes()
        if key not in known:
            [known[key]] = residuals([point])
        return known[key]

    def slopes(point: Floats) -> Floats:
        changes = np.where(point + STEP <= scale.high, STEP, -STEP)
        here, moved = residual(point), residuals([point + one for one in np.diag(changes)])
        return np.column_stack([(m - here) / c for m, c in zip(moved, changes, strict=True)])

    found = least_squares(
        residual,
        scale.start,
        slopes,
        bounds=(scale.low, scale.high),
        max_nfev=steps,
    )
    return scale.hypothesis(found.x)


def finite(residual: Floats) -> Floats:
    """Return a residual (n,) of which none is larger than that of a replay that diverges."""
    return np.clip(np.nan_to_num(residual, nan=DIVERGED), -DIVERGED, DIVERGED)


class _Scale:
    """The sizes of causes as a vector: theta, or the logarithms of factors.

    Attributes:
        start, low, high: of the sizes, shape (p,).
    """

    def __init__(self, start: Hypothesis) -> None:
        self._start, self._theta = start, to_theta(start)
        parameters = [p for _, p in free_parameters(start)]
        ids = [start[i][0].cause.id for i, _ in free_parameters(start)]
        self._is_size: Bools = np.array([not p.hints.shape for p in parameters])
        self._is_factor: Bools = np.array([one in FACTORS for one in ids])
        self._unit = np.array([p.scale for p in parameters])
        low, high = (self._vector(one) for one in theta_bounds(parameters))
        self.low, self.high = low - 1e-9, high + 1e-9
        self.start: Floats = np.clip(self._vector(self._theta), low, high)

    def hypothesis(self, point: Floats) -> Hypothesis:
        """Return the causes with the sizes of a point (p,)."""
        theta = self._theta.copy()
        theta[self._is_size] = point
        factor = self._is_factor
        theta[factor] = np.expm1(point[factor[self._is_size]]) / self._unit[factor]
        return with_theta(self._start, theta)

    def _vector(self, theta: Floats) -> Floats:
        """Return the sizes of a theta."""
        found, factor = theta.copy(), self._is_factor
        found[factor] = np.log(np.maximum(1.0 + theta[factor] * self._unit[factor], LEAST))
        return found[self._is_size]
