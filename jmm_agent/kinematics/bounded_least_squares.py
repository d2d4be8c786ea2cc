"""Small nonlinear least squares in a box, by projected Levenberg-Marquardt.

Minimises |r(x)|^2 + (x - c)' P (x - c) with low <= x <= high. Variables at a bound that the
gradient pushes outwards are held; the damped Gauss-Newton step of the others stays in the box, and
is taken if the cost falls. Where the step alone does not lower the cost, the step after it may:
this second-order correction follows the curved valley of a precise r and a weak quadratic term.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from jmm_agent.types import Floats

Residual = Callable[[Floats], tuple[Floats, Floats]]
"""x (n,) -> residual r (k,) and its Jacobian dr/dx (k, n)."""

START_DAMPING = 1e-4  # relative to the quadratic term, or without one to the curvature
LEAST_DAMPING = 1e-7
MOST_DAMPING = 1e8
FLOOR = 1e-6  # of the metric, relative to the curvature
SMALLEST_COST = 1e-18  # ends the search
SMALLEST_STEP = 1e-8  # of any variable; a smaller one ends the search
SMALLEST_GAIN = 1e-6  # relative fall of the cost that still counts
PATIENCE = 3  # steps in a row that may gain less


class Minimum(NamedTuple):
    """End of a search.

    Attributes:
        x: the point (n,).
        cost: there.
        iterations: steps taken.
        stationary: whether it is a minimum.
    """

    x: Floats
    cost: float
    iterations: int
    stationary: bool


class _Point(NamedTuple):
    """A point, its cost, and half the cost's gradient and Gauss-Newton curvature."""

    x: Floats
    cost: float
    gradient: Floats
    curvature: Floats


def minimise(
    residual: Residual,
    start: Floats,
    low: Floats,
    high: Floats,
    precision: Floats,
    max_iterations: int,
    centre: Floats | None = None,
) -> Minimum:
    """Minimise |r(x)|^2 + (x - centre)' precision (x - centre) with low <= x <= high.

    Args:
        residual: of x (n,), with its Jacobian.
        start: first point (n,), inside the box.
        low: lower bounds (n,).
        high: upper bounds (n,); equal to the lower one for a variable that is held.
        precision: (n, n), positive semidefinite; zeros for none.
        max_iterations: largest number of steps.
        centre: of the quadratic term (n,); None: `start`.
    """
    at = partial(_evaluated, residual, precision, start if centre is None else centre)
    here, damping, idle = at(start), START_DAMPING, 0
    metric = _metric(here.curvature, precision)
    for iteration in range(max_iterations):
        if here.cost <= SMALLEST_COST:
            return Minimum(here.x, here.cost, iteration, True)
        x = _step(here, damping * metric, low, high)
        if np.abs(x - here.x).max() < SMALLEST_STEP:
            return Minimum(here.x, here.cost, iteration, True)
        there, corrected = at(x), False
        if there.cost >= here.cost:
            there, corrected = at(_step(there, damping * metric, low, high)), True
        if there.cost < here.cost:
            idle = idle + 1 if here.cost - there.cost < SMALLEST_GAIN * here.cost else 0
            here = there
            damping = damping if corrected else max(0.1 * damping, LEAST_DAMPING)
            if idle == PATIENCE:
                return Minimum(here.x, here.cost, iteration + 1, True)
        else:
            damping *= 10.0
            if damping > MOST_DAMPING:
                return Minimum(here.x, here.cost, iteration + 1, True)
    return Minimum(here.x, here.cost, max_iterations, here.cost <= SMALLEST_COST)


def _evaluated(residual: Residual, precision: Floats, centre: Floats, x: Floats) -> _Point:
    error, slope = residual(x)
    pull = precision @ (x - centre)
    cost = float(error @ error + (x - centre) @ pull)
    return _Point(x, cost, slope.T @ error + pull, slope.T @ slope + precision)


def _metric(curvature: Floats, precision: Floats) -> Floats:
    """What the damping multiplies (n, n): the quadratic term, or the identity without one."""
    metric = np.trace(curvature) * np.eye(len(curvature))
    return precision + FLOOR * metric if precision.any() else metric


def _step(point: _Point, damping: Floats, low: Floats, high: Floats) -> Floats:
    """End of the damped Newton step (n,); a variable that meets its bound stays there."""
    x, gradient = point.x, point.gradient
    damped = point.curvature + damping
    held = ((x <= low) & (gradient >= 0)) | ((x >= high) & (gradient <= 0))
    step = np.zeros(x.size)
    for _ in range(x.size):
        free = np.flatnonzero(~held)
        if free.size == 0:
            break
        pull = gradient + damped @ np.where(held, step, 0.0)
        step[free] = dposv(damped[free][:, free], -pull[free])[1]
        there = x + step
        outside = ~held & ((there < low) | (there > high))
        if not outside.any():
            break
        step[outside] = (np.minimum(np.maximum(there, low), high) - x)[outside]
        held = held | outside
    return np.minimum(np.maximum(x + step, low), high)
