"""Small nonlinear least squares in a box: projected Levenberg-Marquardt."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Residual = Callable[[Floats], tuple[Floats, Floats]]

START_DAMPING = 1e-4  # relative to the quadratic term, or without one to the curvature
LEAST_DAMPING = 1e-10
MOST_DAMPING = 1e8
SMALLEST_GAIN = 1e-6  # relative fall of the cost that still counts
PATIENCE = 3  # steps in a row that may gain less


class Minimum(NamedTuple):
    """Where the search ended: `x` (n,), `cost`, steps taken, and whether it is a minimum."""

    x: Floats
    cost: float
    iterations: int
    stationary: bool


def minimise(
    residual: Residual,
    start: Floats,
    low: Floats,
    high: Floats,
    precision: Floats,
    max_iterations: int,
    enough: float = 1e-18,
    smallest_step: float = 1e-8,
    centre: Floats | None = None,
) -> Minimum:
    """Minimise |r(x)|^2 + (x - centre)' precision (x - centre) with low <= x <= high.

    Variables at a bound that the gradient pushes outwards are held; the damped Gauss-Newton step
    of the others is projected into the box and taken when the cost falls.

    Args:
        residual: x (n,) -> r (k,), dr/dx (k, n).
        start: first point, inside the box, (n,).
        low, high: the box, (n,); low = high holds a variable.
        precision: (n, n), zeros for none.
        max_iterations: most evaluations of `residual` after the first.
        enough: stop when the cost is below.
        smallest_step: stop when every variable moves less.
        centre: of the quadratic term, (n,); None: `start`.
    """
    x, damping = start, START_DAMPING
    middle = start if centre is None else centre
    error, slope = residual(x)
    pull = precision @ (x - middle)
    cost = float(error @ error + (x - middle) @ pull)
    gradient, curvature = slope.T @ error + pull, slope.T @ slope + precision
    metric = precision + LEAST_DAMPING * np.trace(curvature) * np.eye(x.size)
    if not precision.any():
        metric = np.trace(curvature) * np.eye(x.size)
    idle = 0
    for iteration in range(max_iterations):
        if cost <= enough:
            return Minimum(x, cost, iteration, True)
        damped = curvature + damping * metric
        held = ((x <= low) & (gradient >= 0)) | ((x >= high) & (gradient <= 0))
        there = _step(damped, gradient, x, low, high, held)
        if np.abs(there - x).max() < smallest_step:
            return Minimum(x, cost, iteration, True)
        new_error, new_slope = residual(there)
        pull = precision @ (there - middle)
        new_cost = float(new_error @ new_error + (there - middle) @ pull)
        if new_cost < cost:
            idle = idle + 1 if cost - new_cost < SMALLEST_GAIN * cost else 0
            x, cost, damping = there, new_cost, max(0.1 * damping, LEAST_DAMPING)
            gradient = new_slope.T @ new_error + pull
            curvature = new_slope.T @ new_slope + precision
            if idle == PATIENCE:
                return Minimum(x, cost, iteration + 1, True)
        else:
            damping *= 10.0
            if damping > MOST_DAMPING:
                return Minimum(x, cost, iteration, True)
    return Minimum(x, cost, max_iterations, cost <= enough)


def _step(
    damped: Floats, gradient: Floats, x: Floats, low: Floats, high: Floats, held: NDArray[np.bool_]
) -> Floats:
    """Newton's point from `x`, `held` variables left out; whichever meets the box stays there."""
    step = np.zeros(x.size)
    for _ in range(x.size):
        free = np.flatnonzero(~held)
        if free.size == 0:
            break
        pull = gradient + damped @ np.where(held, step, 0.0)
        step[free] = np.linalg.solve(damped[np.ix_(free, free)], -pull[free])
        there = x + step
        outside = ~held & ((there < low) | (there > high))
        if not outside.any():
            break
        step[outside] = np.clip(there, low, high)[outside] - x[outside]
        held = held | outside
    return np.minimum(np.maximum(x + step, low), high)
