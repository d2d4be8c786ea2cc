"""The joint fit of many parameters at moments of rest, with the joints' positions unknown.

A model that is wrong everywhere by a little replays far from what was measured: its joints stand
elsewhere, wires saturate, and the way back is not linear. So positions at each moment of rest are
unknowns of their own, as camera poses are in bundle adjustment (Triggs et al. 2000). What holds
them together: readings, and that forces balance. They are eliminated from each Gauss-Newton step
by a Schur complement, which leaves a system as small as the number of parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.gauss_newton import at, free_parameters, to_theta
from reality_gap.simulation.hypothesis import build
from reality_gap.simulation.replayer import Hypothesis, Part
from reality_gap.simulation.statics import Balance, Statics
from reality_gap.study.system import System
from reality_gap.types import Floats

WIDTHS = {"attachment_shift": 2.0, "length_offset": 2.0}
"""Prior deviations in scales, by cause; `PRIOR` for the others. Where every wire may be displaced,
each is by little."""
ROUNDS = 12
ENOUGH = 2e-3
"""A step that takes away less than this share of the cost is the last."""
ROAM = 0.5
"""How far joints may stand from where the model's replay has them [rad or m]."""
NUDGE = 1e-5
"""Finite difference of positions [rad or m]."""
STEP = 3e-3
"""Finite difference of parameters, in scales."""
LEAP = 0.5
"""Farthest that a joint goes in a step [rad or m]."""
ROUNDING = 1e-12
"""How far beyond its bounds a step may end, so that there is room for one [scales]."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations at rest, with what no parameter of the fit accounts for.

    Attributes:
        reading: (c,) of the mean reading of each channel, in SI units.
        force: of the force of an actuator [N or N m].
        torque: of the balance itself, at every joint [N m or N].
    """

    reading: Floats
    force: float
    torque: float


@dataclass(frozen=True)
class Settled:
    """What the fit found.

    Attributes:
        hypothesis: suspects with their values.
        deviation: standard deviation of each parameter in SI units, by suspect.
        qpos: (k, nq) positions at the moments.
        cost: before each step and after the last.
    """

    hypothesis: list[Part]
    deviation: list[dict[str, float]]
    qpos: Floats
    cost: tuple[float, ...]


class _Problem:
    """Residuals of theta (p,), in scales from the null, and positions (k, nq), whitened."""

    def __init__(
        self, system: System, statics: Statics, start: Hypothesis, qpos: Floats, noise: Noise
    ) -> None:
        self._system, self._statics, self._start = system, statics, start
        self.qpos, self._noise = qpos, noise
        ends = [
            sorted(((p.low - p.null) / p.scale, (p.high - p.null) / p.scale))
            for _, p in free_parameters(start)
        ]
        self.low, self.high = np.array(ends).T
        self.width = np.array(
            [WIDTHS.get(start[i][0].cause.id, PRIOR) for i, _ in free_parameters(start)]
        )
        self._used = np.isfinite(statics.moments.value) & statics.positions
        self.reweigh(to_theta(start), qpos)

    def parts(self, theta: Floats) -> list[Part]:
        return list(at(self._start, theta))

    def _look(self, theta: Floats, qpos: Floats) -> Balance:
        return self._statics.look(build(self._system, self.parts(theta)), qpos)

    def reweigh(self, theta: Floats, qpos: Floats) -> None:
        """Whiten the balance (k, nv, nv): each actuator's force is known so well only."""
        arms = self._look(theta, qpos).arms
        spread = self._noise.force**2 * np.einsum("kuv,kuw->kvw", arms, arms)
        spread += self._noise.torque**2 * np.eye(arms.shape[2])
        self._whiten = np.linalg.inv(np.linalg.cholesky(spread))

    def residual(self, theta: Floats, qpos: Floats) -> Floats:
        """(k, c + nv)."""
        found = self._look(theta, qpos)
        gap = (found.reading - self._statics.moments.value) / self._noise.reading
        torque = np.einsum("kij,kj->ki", self._whiten, found.torque)
        return np.hstack([np.where(self._used, gap, 0.0), torque])

    def cost(self, residual: Floats, theta: Floats, qpos: Floats) -> float:
        roamed = np.sum(((qpos - self.qpos) / ROAM) ** 2)
        return float(np.sum(residual**2) + np.sum((theta / self.width) ** 2) + roamed)

    def by_position(self, residual: Floats, theta: Floats, qpos: Floats) -> Floats:
        """(k, c + nv, nq): a moment's residuals change with its own positions only."""
        columns = []
        for axis in np.eye(qpos.shape[1]):
            columns.append((self.residual(theta, qpos + NUDGE * axis) - residual) / NUDGE)
        return np.stack(columns, axis=2)

    def by_theta(self, residual: Floats, theta: Floats, qpos: Floats) -> Floats:
        """(k, c + nv, p)."""
        columns = []
        for axis, top, value in zip(np.eye(len(theta)), self.high, theta, strict=True):
            step = STEP if value + STEP <= top else -STEP
            columns.append((self.residual(theta + step * axis, qpos) - residual) / step)
        return np.stack(columns, axis=2)


def fit_at_rest(
    system: System,
    statics: Statics,
    start: Hypothesis,
    qpos: Floats,
    noise: Noise,
    rounds: int = ROUNDS,
    tick: Callable[[int], None] = lambda number: None,
) -> Settled:
    """Fit the parameters of several suspects jointly; priors are as wide as `WIDTHS` says.

    Args:
        system: the machine, all of whose joints are hinges or slides.
        statics: of the moments of rest.
        start: suspects with the values to start from.
        qpos: (k, nq) where joints may stand, such as in the model's replay.
        noise: how exact readings and forces are.
        rounds: steps at most.
        tick: called with the number of each step, from 1.
    """
    problem = _Problem(system, statics, start, qpos, noise)
    theta, stand, damping, costs = to_theta(start), qpos.copy(), 1e-3, []
    normal = None
    for number in range(1, rounds + 1):
        problem.reweigh(theta, stand)
        residual = problem.residual(theta, stand)
        costs.append(problem.cost(residual, theta, stand))
        normal = _linearise(problem, residual, theta, stand)
        tick(number)
        moved = _step(problem, normal, theta, stand, costs[-1], damping)
        if moved is None:
            break
        theta, stand, after, damping = moved
        if costs[-1] - after < ENOUGH * costs[-1]:
            break
    costs.append(problem.cost(problem.residual(theta, stand), theta, stand))
    assert normal is not None
    spread = np.sqrt(np.diag(np.linalg.inv(normal.reduced(0.0)[0])))
    deviation: list[dict[str, float]] = [{} for _ in start]
    for (i, p), size in zip(free_parameters(start), spread, strict=True):
        deviation[i][p.name] = float(size * abs(p.scale))
    return Settled(problem.parts(theta), deviation, stand, tuple(costs))


@dataclass(frozen=True)
class _Normal:
    """Normal equations, positions and parameters apart.

    Attributes:
        own: (k, nq, nq), cross: (k, nq, p), shared: (p, p) second derivatives of half the cost.
        pull: (k, nq), push: (p,) first ones.
    """

    own: Floats
    cross: Floats
    shared: Floats
    pull: Floats
    push: Floats

    def reduced(self, damping: float) -> tuple[Floats, Floats, Floats]:
        """Matrix (p, p) and right-hand side (p,) without positions; what they follow by
        (k, nq, p + 1)."""
        held = self.own.copy()
        diagonal = np.arange(self.own.shape[1])
        held[:, diagonal, diagonal] *= 1 + damping
        solved = np.linalg.solve(held, np.concatenate([self.cross, self.pull[:, :, None]], axis=2))
        p = len(self.push)
        flat = self.cross.reshape(-1, p)
        matrix = self.shared + damping * np.eye(p) / PRIOR**2
        matrix -= flat.T @ solved[:, :, :-1].reshape(-1, p)
        return matrix, self.push - flat.T @ solved[:, :, -1].ravel(), solved


def _linearise(problem: _Problem, residual: Floats, theta: Floats, qpos: Floats) -> _Normal:
    own = problem.by_position(residual, theta, qpos)
    shared = problem.by_theta(residual, theta, qpos)
    p = len(theta)
    flat = shared.reshape(-1, p)
    return _Normal(
        own=np.matmul(own.transpose(0, 2, 1), own) + np.eye(qpos.shape[1]) / ROAM**2,
        cross=np.matmul(own.transpose(0, 2, 1), shared),
        shared=flat.T @ flat + np.diag(problem.width**-2),
        pull=np.einsum("kri,kr->ki", own, residual) + (qpos - problem.qpos) / ROAM**2,
        push=flat.T @ residual.ravel() + theta / problem.width**2,
    )


def _step(
    problem: _Problem, normal: _Normal, theta: Floats, qpos: Floats, before: float, damping: float
) -> tuple[Floats, Floats, float, float] | None:
    """Theta, positions, cost and damping after one step; None where none is better."""
    while damping < 1e8:
        matrix, right, solved = normal.reduced(damping)
        change = _within(matrix, right, problem.low - theta, problem.high - theta)
        there = np.clip(theta + change, problem.low, problem.high)  # but for rounding it is there
        turn = -solved[:, :, -1] - solved[:, :, :-1] @ change
        stand = qpos + np.clip(turn, -LEAP, LEAP)
        after = problem.cost(problem.residual(there, stand), there, stand)
        if after < before:
            return there, stand, after, damping / 8
        damping = max(8 * damping, 1e-2)
    return None


def _within(matrix: Floats, right: Floats, low: Floats, high: Floats) -> Floats:
    """The step x (p,) from low to high with the least x' matrix x / 2 + right' x."""
    root = np.linalg.cholesky(matrix).T
    ends = (low - ROUNDING, high + ROUNDING)
    return np.asarray(lsq_linear(root, -np.linalg.solve(root.T, right), ends).x)
