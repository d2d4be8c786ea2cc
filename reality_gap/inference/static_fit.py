"""Static fit: many parameters at moments of rest, with the positions of the joints unknown.

A model that is slightly wrong everywhere is replayed far from what was measured: its joints are at
other positions, tendons reach their force limits, and the residual is far from linear in the
parameters. Here the positions x_k of the joints at each moment of rest k are unknowns, too, as
camera poses are in bundle adjustment (Triggs et al. 2000). With parameters theta, the fit minimises

    sum_k |r_k(theta, x_k)|^2 + |theta / width|^2 + sum_k |(x_k - x_k0) / ROAM|^2,

where r_k holds the whitened errors of the readings and of the balance of forces. The Gauss-Newton
equations are block diagonal in x. The positions are eliminated by a Schur complement, so that the
system to be solved has as many unknowns as there are parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.theta import free_parameters, theta_bounds, to_theta, with_theta
from reality_gap.simulation.hypothesis import Hypothesis, Part, build
from reality_gap.simulation.statics import Balance, Statics
from reality_gap.study.system import System
from reality_gap.types import Floats

WIDTHS = {"attachment_shift": 2.0, "length_offset": 2.0}
"""Prior deviations in scales by cause, and `PRIOR` for the others. They are small for causes that
act on all tendons at once."""
ROUNDS = 12
"""Largest number of steps."""
ENOUGH = 2e-3
"""Relative decrease of the cost below which a step is the last."""
ROAM = 0.5
"""Prior deviation of positions from those of the nominal replay [rad or m]."""
NUDGE = 1e-5
"""Finite difference of positions [rad or m]."""
STEP = 3e-3
"""Finite difference of parameters, in scales."""
LEAP = 0.5
"""Largest change of a position in one step [rad or m]."""
ROUNDING = 1e-12
"""How far beyond its bounds a step may end, so that the interval is never empty [scales]."""
FIRST_DAMPING = 1e-3
"""Damping of the first step; see `_Normal.reduced`."""
MOST_DAMPING = 1e8
"""Damping from which on the fit ends."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations at rest, including errors that no parameter of the fit explains.

    Attributes:
        reading: of the mean reading of each channel in SI units, shape (c,).
        force: of the force of an actuator [N or N m].
        torque: of the balance of forces at each joint [N m or N].
    """

    reading: Floats
    force: float
    torque: float


@dataclass(frozen=True)
class StaticFit:
    """Result of a static fit.

    Attributes:
        hypothesis: candidates with their values.
        deviation: standard deviation of each parameter in SI units, by candidate.
        covariance: joint covariance of theta, shape (p, p).
        qpos: positions of the joints at the moments of rest, shape (k, nq).
        cost: cost before each step and after the last.
    """

    hypothesis: list[Part]
    deviation: list[dict[str, float]]
    covariance: Floats
    qpos: Floats
    cost: tuple[float, ...]


class _Point(NamedTuple):
    """Parameters theta (p,), and positions of the joints (k, nq)."""

    theta: Floats
    qpos: Floats


class _Objective:
    """Whitened residuals and cost of a point.

    Attributes:
        start: the initial point.
        low, high: bounds of theta, shape (p,).
        width: prior deviations of theta, shape (p,).
    """

    def __init__(
        self, system: System, statics: Statics, hypothesis: Hypothesis, qpos: Floats, noise: Noise
    ) -> None:
        self._system, self._statics, self._hypothesis = system, statics, hypothesis
        self._noise = noise
        free = free_parameters(hypothesis)
        self.low, self.high = theta_bounds([p for _, p in free])
        self.width = np.array([WIDTHS.get(hypothesis[i][0].cause.id, PRIOR) for i, _ in free])
        self._used = np.isfinite(statics.moments.value) & statics.positions
        self.start = _Point(to_theta(hypothesis), qpos)
        self.whiten_at(self.start)

    def parts(self, theta: Floats) -> list[Part]:
        """Return the candidates with the values of theta."""
        return list(with_theta(self._hypothesis, theta))

    def _balance(self, point: _Point) -> Balance:
        return self._statics.balance(build(self._system, self.parts(point.theta)), point.qpos)

    def whiten_at(self, point: _Point) -> None:
        """Compute the whitening (k, nv, nv) of the balance from the lever arms at a point."""
        arms = self._balance(point).arms
        covariance = self._noise.force**2 * np.einsum("kuv,kuw->kvw", arms, arms)
        covariance += self._noise.torque**2 * np.eye(arms.shape[2])
        self._whiten = np.linalg.inv(np.linalg.cholesky(covariance))

    def residual(self, point: _Point) -> Floats:
        """Return the whitened errors of readings and balance, shape (k, c + nv)."""
        found = self._balance(point)
        gap = (found.reading - self._statics.moments.value) / self._noise.reading
        torque = np.einsum("kij,kj->ki", self._whiten, found.torque)
        return np.hstack([np.where(self._used, gap, 0.0), torque])

    def cost(self, point: _Point, residual: Floats) -> float:
        """Return the cost of a point with its residual."""
        roamed = np.sum(((point.qpos - self.start.qpos) / ROAM) ** 2)
        return float(np.sum(residual**2) + np.sum((point.theta / self.width) ** 2) + roamed)

    def linearise(self, point: _Point, residual: Floats) -> _Normal:
        """Return the normal equations at a point with its residual."""
        own, shared = self._by_position(point, residual), self._by_theta(point, residual)
        flat = shared.reshape(-1, len(point.theta))
        return _Normal(
            own=np.matmul(own.transpose(0, 2, 1), own) + np.eye(point.qpos.shape[1]) / ROAM**2,
            cross=np.matmul(own.transpose(0, 2, 1), shared),
            shared=flat.T @ flat + np.diag(self.width**-2),
            own_slope=np.einsum("kri,kr->ki", own, residual)
            + (point.qpos - self.start.qpos) / ROAM**2,
            shared_slope=flat.T @ residual.ravel() + point.theta / self.width**2,
        )

    def _by_position(self, point: _Point, residual: Floats) -> Floats:
        """Return derivatives (k, c + nv, nq); a moment depends on its own positions only."""
        columns = []
        for axis in np.eye(point.qpos.shape[1]):
            moved = self.residual(point._replace(qpos=point.qpos + NUDGE * axis))
            columns.append((moved - residual) / NUDGE)
        return np.stack(columns, axis=2)

    def _by_theta(self, point: _Point, residual: Floats) -> Floats:
        """Return derivatives (k, c + nv, p)."""
        columns = []
        for axis, high, value in zip(np.eye(len(self.high)), self.high, point.theta, strict=True):
            step = STEP if value + STEP <= high else -STEP
            moved = self.residual(point._replace(theta=point.theta + step * axis))
            columns.append((moved - residual) / step)
        return np.stack(columns, axis=2)


@dataclass(frozen=True)
class _Normal:
    """Normal equations, with positions and parameters apart.

    Attributes:
        own, cross, shared: second derivatives of half the cost by positions (k, nq, nq), by
            positions and parameters (k, nq, p), and by parameters (p, p).
        own_slope, shared_slope: its first derivatives by positions (k, nq), and by parameters (p,).
    """

    own: Floats
    cross: Floats
    shared: Floats
    own_slope: Floats
    shared_slope: Floats

    def reduced(self, damping: float) -> tuple[Floats, Floats, Floats]:
        """Eliminate the positions.

        Args:
            damping: relative increase of the diagonal (Levenberg-Marquardt).

        Returns:
            Matrix (p, p) and right-hand side (p,) of the equations of the parameters, and the
            matrix (k, nq, p + 1) by which the change of the positions follows.
        """
        own = self.own.copy()
        diagonal = np.arange(self.own.shape[1])
        own[:, diagonal, diagonal] *= 1 + damping
        right = np.concatenate([self.cross, self.own_slope[:, :, None]], axis=2)
        solved = np.linalg.solve(own, right)
        p = len(self.shared_slope)
        flat = self.cross.reshape(-1, p)
        matrix = self.shared + damping * np.eye(p) / PRIOR**2
        matrix -= flat.T @ solved[:, :, :-1].reshape(-1, p)
        return matrix, self.shared_slope - flat.T @ solved[:, :, -1].ravel(), solved


def fit_at_rest(
    system: System,
    statics: Statics,
    start: Hypothesis,
    qpos: Floats,
    noise: Noise,
    rounds: int = ROUNDS,
    tick: Callable[[int], None] = lambda number: None,
) -> StaticFit:
    """Fit the parameters of several candidates jointly.

    Args:
        system: the study's model and its elements; all joints are hinges or slides.
        statics: evaluates the moments of rest.
        start: candidates with initial values.
        qpos: initial positions of the joints, such as those of the nominal replay, shape (k, nq).
        noise: standard deviations of readings and forces.
        rounds: largest number of steps.
        tick: called with the number of each step, from 1.
    """
    objective = _Objective(system, statics, start, qpos, noise)
    point, damping, costs = objective.start, FIRST_DAMPING, list[float]()
    normal = None
    for number in range(1, rounds + 1):
        objective.whiten_at(point)
        residual = objective.residual(point)
        costs.append(objective.cost(point, residual))
        normal = objective.linearise(point, residual)
        tick(number)
        moved = _step(objective, normal, point, costs[-1], damping)
        if moved is None:
            break
        point, after, damping = moved
        if costs[-1] - after < ENOUGH * costs[-1]:
            break
    costs.append(objective.cost(point, objective.residual(point)))
    assert normal is not None
    covariance = np.asarray(np.linalg.inv(normal.reduced(0.0)[0]), dtype=np.float64)
    spread = np.sqrt(np.diag(covariance))
    deviation: list[dict[str, float]] = [{} for _ in start]
    for (i, p), size in zip(free_parameters(start), spread, strict=True):
        deviation[i][p.name] = float(size * abs(p.scale))
    found = objective.parts(point.theta)
    return StaticFit(found, deviation, covariance, point.qpos, tuple(costs))


def _step(
    objective: _Objective, normal: _Normal, point: _Point, before: float, damping: float
) -> tuple[_Point, float, float] | None:
    """Return point, cost and damping after one step; None if no step decreases the cost."""
    while damping < MOST_DAMPING:
        matrix, right, solved = normal.reduced(damping)
        low, high = objective.low - point.theta, objective.high - point.theta
        change = _bounded_minimum(matrix, right, low, high)
        # Rounding may move theta slightly beyond its bounds.
        theta = np.clip(point.theta + change, objective.low, objective.high)
        turn = -solved[:, :, -1] - solved[:, :, :-1] @ change
        moved = _Point(theta, point.qpos + np.clip(turn, -LEAP, LEAP))
        after = objective.cost(moved, objective.residual(moved))
        if after < before:
            return moved, after, damping / 8
        damping = max(8 * damping, 1e-2)
    return None


def _bounded_minimum(matrix: Floats, right: Floats, low: Floats, high: Floats) -> Floats:
    """Return the x (p,) between bounds that minimises x' matrix x / 2 + right' x."""
    root = np.linalg.cholesky(matrix).T
    ends = (low - ROUNDING, high + ROUNDING)
    return np.asarray(lsq_linear(root, -np.linalg.solve(root.T, right), ends).x)
