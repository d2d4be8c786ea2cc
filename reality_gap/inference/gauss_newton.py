"""Fit of a hypothesis: nonlinear least squares over replays.

With the whitening W of the noise model, the residual r(theta) of a replay and the prior weights P
(1 / prior deviation), a fit minimises |W r(theta)|^2 / 2 + |P theta|^2 / 2 within the bounds of
theta, by Gauss-Newton steps. A replay costs far more than anything else, so that a step is taken
whole and shortened only if it fails, and a fit ends when the next step promises less than `ENOUGH`.

Fits are generators that yield hypotheses and receive their residuals. `run_together` runs several
of them at once, so that their replays can be distributed to processes.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.optimize import lsq_linear

from reality_gap.inference.evidence import complexity
from reality_gap.inference.log_candidates import PENALTY
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import (
    free_parameters,
    is_tolerable,
    prior_weights,
    theta_bounds,
    to_theta,
    with_theta,
)
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.simulation.replayer import Replayer
from reality_gap.types import Floats

T = TypeVar("T")
Stepwise = Generator[list[Hypothesis], list[Floats], T]
"""A computation that yields hypotheses, receives their residuals, and returns a result."""

STEP = 0.1
"""Finite difference of a fit, in scales of a parameter."""
ROUNDS = 3
"""Largest number of Gauss-Newton steps with known slopes, and again with finite differences."""
FACTORS = (0.5, 0.75, 1.35, 1.8)
"""Multiples of a fitted size that are tried, too."""
SHAPES = (0.5, 2.0, 4.0)
"""Multiples of the null value that are tried for a shape, which has no slope at the null."""
ENOUGH = 0.2
"""Predicted decrease of the cost below which no step is taken [nats]."""


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    Attributes:
        hypothesis: candidates with their values; empty for the nominal model.
        residual: residual of all readings in units of sensor noise, shape (n,).
        jacobian: change of the prediction per scale of a parameter, likewise, shape (n, p).
        theta: parameters in scales from their null values, shape (p,).
        evidence: log marginal likelihood relative to the nominal model, by Laplace; at most 0 if
            one of the deviations is one that every good model may have [nats].
        raw_evidence: the same without this limit [nats].
    """

    hypothesis: Hypothesis
    residual: Floats
    jacobian: Floats
    theta: Floats
    evidence: float
    raw_evidence: float = 0.0

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The candidates of the hypothesis."""
        return tuple(candidate for candidate, _ in self.hypothesis)

    @property
    def is_null(self) -> bool:
        """Whether this is the nominal model."""
        return not self.hypothesis


def null_fit(problem: Problem) -> Fit:
    """Return the nominal model as a fit without candidates."""
    null = problem.null_residual
    return Fit([], null, np.zeros((len(null), 0)), np.zeros(0), 0.0)


def run_together(replayer: Replayer, computations: Sequence[Stepwise[T]]) -> list[T]:
    """Run computations side by side; what all of them yield next is replayed at once."""
    results: dict[int, T] = {}
    requests: dict[int, list[Hypothesis]] = {}

    def advance(i: int, residuals: list[Floats] | None) -> None:
        one = computations[i]
        try:
            requests[i] = one.send(residuals) if residuals is not None else next(one)
        except StopIteration as end:
            results[i] = end.value

    for i in range(len(computations)):
        advance(i, None)
    while requests:
        current, requests = requests, {}
        found = iter(replayer.residuals([one for some in current.values() for one in some]))
        for i, some in current.items():
            advance(i, [next(found) for _ in some])
    return [results[i] for i in range(len(computations))]


def fit(problem: Problem, start: Hypothesis) -> Fit:
    """Fit one hypothesis; see `fit_stepwise`."""
    return run_together(problem.replayer, [fit_stepwise(problem, start)])[0]


def fit_stepwise(
    problem: Problem, start: Hypothesis, jacobian: Floats | None = None, polish: bool = True
) -> Stepwise[Fit]:
    """Fit a hypothesis to the readings of the fit and selection splits.

    Args:
        problem: what is to be explained.
        start: candidates with initial values.
        jacobian: slopes to begin with, change of the prediction per scale, shape (n, p); finite
            differences if None.
        polish: whether to continue with finite differences where ``jacobian`` leads no further.
    """
    objective = Objective(problem, start)
    point = yield from objective.begin()
    if point is None:
        null, zero = problem.null_residual, np.zeros(len(objective.low))
        return Fit(with_theta(start, zero), null, np.zeros((len(null), len(zero))), zero, 0.0)
    if jacobian is not None:
        for _ in range(ROUNDS):
            moved = yield from objective.advance(point, jacobian)
            if moved is None:
                break
            point = moved
    if jacobian is None or polish:
        for _ in range(ROUNDS):
            jacobian = yield from objective.differences(point)
            moved = yield from objective.advance(point, jacobian)
            if moved is None:
                break
            point = moved
    assert jacobian is not None
    hypothesis = with_theta(start, point.theta)
    return rescore(problem, Fit(hypothesis, point.residual, jacobian, point.theta, 0.0))


def resize_stepwise(problem: Problem, old: Fit, first: int) -> Stepwise[Fit]:
    """Refit a hypothesis from other sizes or shapes of its candidates, if one of them is better.

    Stick-slip has several minima, and finite differences lead to the nearest only.

    Args:
        problem: what is to be explained.
        old: the fit so far.
        first: index of the first candidate to change.
    """
    objective, parameters = Objective(problem, old.hypothesis), free_parameters(old.hypothesis)
    alone = [len(candidate.parameters) == 1 for candidate in old.candidates]
    sized = np.array([i >= first and (alone[i] or not p.hints.starts) for i, p in parameters])
    trials = [np.where(sized, factor, 1.0) * old.theta for factor in FACTORS]
    shape = [i >= first and p.hints.shape for i, p in parameters]
    if any(shape):
        usual = np.array([p.null / p.scale for _, p in parameters])
        trials += [np.where(shape, (factor - 1.0) * usual, old.theta) for factor in SHAPES]
    trials = [objective.clip(theta) for theta in trials]
    residuals = yield [with_theta(old.hypothesis, theta) for theta in trials]
    best = Point(old.theta, old.residual)
    for residual, theta in zip(residuals, trials, strict=True):
        limit = objective.cost(best) - ENOUGH
        if _is_finite(residual) and objective.cost(Point(theta, residual)) < limit:
            best = Point(theta, residual)
    if best.residual is old.residual:
        return old
    start = with_theta(old.hypothesis, best.theta)
    return (yield from fit_stepwise(problem, start, old.jacobian, polish=False))


class Point(NamedTuple):
    """Theta (p,) and the residual (n,) of its replay."""

    theta: Floats
    residual: Floats


class Objective:
    """The cost of a fit and its Gauss-Newton steps.

    Args:
        problem: what is to be explained.
        hypothesis: candidates with initial values.

    Attributes:
        low, high: bounds of theta, shape (p,).
    """

    def __init__(self, problem: Problem, hypothesis: Hypothesis) -> None:
        self._hypothesis, self._whiten = hypothesis, problem.noise_model.whiten
        self._weights = prior_weights(hypothesis)
        self.low, self.high = theta_bounds([p for _, p in free_parameters(hypothesis)])

    def clip(self, theta: Floats) -> Floats:
        """Clip theta (p,) to its bounds."""
        return np.clip(theta, self.low, self.high)

    def cost(self, point: Point) -> float:
        """Return half the squares of the whitened residual and of the weighted theta [nats]."""
        misfit = np.sum(self._whiten(point.residual) ** 2)
        return 0.5 * float(misfit + np.sum((self._weights * point.theta) ** 2))

    def begin(self) -> Stepwise[Point | None]:
        """Return the initial point, or one at a quarter of it; None if both replays diverge."""
        theta = self.clip(to_theta(self._hypothesis))
        [residual] = yield [with_theta(self._hypothesis, theta)]
        if not _is_finite(residual):
            theta = self.clip(theta / 4)
            [residual] = yield [with_theta(self._hypothesis, theta)]
        return Point(theta, residual) if _is_finite(residual) else None

    def differences(self, point: Point) -> Stepwise[Floats]:
        """Return the change of the prediction per scale (n, p), by one-sided differences."""
        steps = np.where(point.theta + STEP <= self.high, STEP, -STEP)
        trials: list[Hypothesis] = [
            with_theta(self._hypothesis, point.theta + change) for change in np.diag(steps)
        ]
        moved = yield trials
        columns = [
            (point.residual - other) / step for other, step in zip(moved, steps, strict=True)
        ]
        return np.nan_to_num(np.column_stack(columns))

    def advance(self, point: Point, jacobian: Floats) -> Stepwise[Point | None]:
        """Return the point after one step, or after a quarter of it; None if neither is better."""
        step, decrease = self._step(point, jacobian)
        if decrease < ENOUGH:
            return None
        before = self.cost(point)
        for share in (1.0, 0.25):
            theta = point.theta + share * step
            [residual] = yield [with_theta(self._hypothesis, theta)]
            moved = Point(theta, residual)
            if _is_finite(residual) and self.cost(moved) < before:
                return moved
        return None

    def _step(self, point: Point, jacobian: Floats) -> tuple[Floats, float]:
        """Return the step (p,) to the minimum of the linearised cost, and the decrease [nats]."""
        matrix = np.vstack([self._whiten(jacobian), np.diag(self._weights)])
        right = np.concatenate([self._whiten(point.residual), -self._weights * point.theta])
        low, high = self.low - point.theta - 1e-12, self.high - point.theta + 1e-12
        root = np.asarray(np.linalg.qr(np.column_stack([matrix, right]), mode="r"))
        step = lsq_linear(root[:, :-1], root[:, -1], bounds=(low, high)).x
        decrease = right @ right - np.sum((right - matrix @ step) ** 2)
        return step, 0.5 * float(decrease)


def _is_finite(residual: Floats) -> bool:
    """Return whether a replay did not diverge."""
    return bool(np.all(np.isfinite(residual)))


def start_penalty(candidate: Candidate) -> float:
    """Return the penalty of a candidate before any data [nats].

    It is that for selecting one of several starts, as the time of an event, or one of several logs,
    and the log odds against the cause.
    """
    starts = (p.hints.starts for p in candidate.parameters if p.hints.starts)
    own = PENALTY * bool(candidate.location.log) - candidate.cause.prior(candidate.location)
    return float(sum(np.log(len(s)) for s in starts) + own)


def rescore(problem: Problem, fitted: Fit) -> Fit:
    """Return the fit with the evidence that the problem's noise model gives it."""
    whiten = problem.noise_model.whiten
    before, after = whiten(problem.null_residual), whiten(fitted.residual)
    quality = 0.5 * float(before @ before - after @ after)
    return _penalised(problem, fitted, quality)


def profile(problem: Problem, fitted: Fit) -> Fit:
    """Return the fit with its evidence if the variance of what it leaves is not known.

    The fit and the nominal model have a variance of each channel each, which makes what they leave
    likeliest. Without this, a cause that explains one channel whole would excuse the others.
    """
    own = problem.widened(fitted.residual)
    quality = own.noise_model.log_likelihood(fitted.residual) - problem.null_likelihood
    return _penalised(own, fitted, quality)


def _penalised(problem: Problem, fitted: Fit, quality: float) -> Fit:
    """Return the fit with its evidence: its quality without penalties of parameters and causes."""
    columns = problem.noise_model.whiten(fitted.jacobian)
    free = free_parameters(fitted.hypothesis)
    cause = np.array([i for i, _ in free], dtype=np.int64)
    flat = np.array([bool(p.hints.starts) for _, p in free], dtype=bool)
    penalty = complexity(columns.T @ columns, fitted.theta, cause, flat)
    raw = quality - penalty - sum(start_penalty(one) for one in fitted.candidates)
    tolerable = any(is_tolerable(candidate, values) for candidate, values in fitted.hypothesis)
    return replace(fitted, evidence=min(raw, 0.0) if tolerable else raw, raw_evidence=raw)


def evidence_without(base: float, fits: Sequence[Fit]) -> float:
    """Return the largest evidence without one more cause [nats].

    What a deviation explains that every good model may have needs no cause.

    Args:
        base: evidence of the causes so far [nats].
        fits: fits of these with one candidate more each.
    """
    return max([base, *(f.raw_evidence for f in fits if _is_no_fault(f))])


def _is_no_fault(fitted: Fit) -> bool:
    """Return whether the last candidate, and no other, deviates as in every good model."""
    *rest, last = (is_tolerable(*part) for part in fitted.hypothesis)
    return last and not any(rest)
