"""Values of the named causes in each log: whether a cause is the same in all of them.

Let theta_k be the parameters in log k, and J the slopes of the residual at the fit to all logs. The
rows of J that belong to log k are the slopes of theta_k; those of other logs are zero. All logs are
fitted together, whitened by the noise model, so that a deviation within the tolerances, which is
the same in all logs, counts once. The noise model has the variance of what the causes leave,
because errors without a name scatter the values, too. With the estimates x and their covariance V,
the differences d = D x between logs are tested by the Wald statistic d' (D V D')^-1 d, which is
chi-square distributed if the parameters are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from reality_gap.causes.base import Location
from reality_gap.inference.gauss_newton import STEP, Fit
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import (
    free_parameters,
    prior_weights,
    theta_bounds,
    to_theta,
    with_theta,
)
from reality_gap.log_findings import Estimate, LogComparison, LogValue
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, Part, in_log
from reality_gap.types import Bools, Floats, Ints

ROUNDS, SHARES = 6, (1.0, 0.25, 0.06)
"""Largest number of Gauss-Newton steps, and shares of a step that are tried."""
CHANCE = 0.01
"""Probability of the differences by chance below which a cause has changed."""
SHOWS = 2.0
"""Change of the readings of a log by a typical fault from which on it shows there [noise]."""
WIDE = 1.96
"""Half of a 95 % interval, in standard deviations."""
SMALL = 0.05
"""Step below which no further one is taken, in standard deviations."""


def compare_logs(problem: Problem, best: Fit) -> tuple[LogComparison | None, ...]:
    """Compare the values of each candidate of a hypothesis between the logs of a study.

    Args:
        problem: what is explained, with the noise model that the hypothesis was fitted with.
        best: the hypothesis, fitted to all logs.

    Returns:
        One comparison for each candidate; None for all if the study has one log.
    """
    logs = problem.system.study.logs
    if len(logs) < 2 or best.is_null:
        return (None,) * len(best.hypothesis)
    fitted = _Fitted(problem, best, logs)
    fitted.advance()
    found = [fitted.comparison(i) for i in range(len(fitted.candidates))]
    own = [_everywhere(candidate) for candidate in best.candidates]
    return tuple(
        next(found[i] for i, other in enumerate(fitted.candidates) if other.matches(one))
        for one in own
    )


def _everywhere(candidate: Candidate) -> Candidate:
    """Return a candidate that acts in all logs."""
    return replace(candidate, location=replace(candidate.location, log=""))


class _Fitted:
    """Parameters of a hypothesis in each log.

    A cause in one log and the same in all logs are one candidate here.

    Attributes:
        candidates: candidates that act in all logs.
        theta: parameters in each log, shape (logs, p).
        covariance: of the free ones among them, row by row, shape (f, f).
        free: whether a parameter is fitted in a log, shape (logs, p).
    """

    def __init__(self, problem: Problem, best: Fit, logs: Sequence[str]) -> None:
        self._problem, self._logs = problem, logs
        self._log = _log_of_readings(problem, logs)
        each = [in_log(best.hypothesis, log) for log in logs]
        parts = {_key(candidate): candidate for some in each for candidate, _ in some}
        self.candidates = tuple(parts.values())
        self._start: Hypothesis = [(one, one.null_values()) for one in self.candidates]
        self._parameters = free_parameters(self._start)
        self._low, self._high = theta_bounds([p for _, p in self._parameters])
        self.theta = np.array([to_theta(_completed(self.candidates, some)) for some in each])
        [self._residual] = self._replayed([self.theta])
        self._jacobian = self._slopes()
        self.free = self._shown()
        columns = [
            np.where(self._log == k, self._jacobian[:, j], 0.0)
            for k, j in np.argwhere(self.free).tolist()
        ]
        stacked = np.column_stack([np.zeros((len(self._residual), 0)), *columns])
        self._columns = problem.noise_model.whiten(stacked)
        weights = np.broadcast_to(prior_weights(self._start), self.free.shape)[self.free]
        information = self._columns.T @ self._columns + np.diag(weights**2)
        self.covariance = np.linalg.pinv(information, hermitian=True)

    def _slopes(self) -> Floats:
        """Return the change of the prediction per scale of each parameter, shape (n, p).

        They are differences, because a cause that was fitted in one log has none in the others.
        """
        step = np.where(self.theta.max(axis=0) + STEP <= self._high, STEP, -STEP)
        moved = self._replayed([self.theta + one for one in np.diag(step)])
        return np.nan_to_num((self._residual[:, None] - np.column_stack(moved)) / step)

    def advance(self) -> None:
        """Take Gauss-Newton steps towards the values in each log."""
        for _ in range(ROUNDS):
            right = self._problem.noise_model.whiten(self._residual)
            step = self.covariance @ (self._columns.T @ right)
            if not self._move(step) or np.all(np.abs(step) < SMALL * self._deviation):
                break

    @property
    def _deviation(self) -> Floats:
        """Standard deviation of the free parameters, shape (f,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def _move(self, step: Floats) -> bool:
        """Take a step of the free parameters (f,), or a part of it; return whether it is better."""
        before = self._cost(self._residual)
        for share in SHARES:
            moved = self.theta.copy()
            moved[self.free] += share * step
            moved = np.clip(moved, self._low, self._high)
            [residual] = self._replayed([moved])
            if np.isfinite(residual).all() and self._cost(residual) < before:
                self.theta, self._residual = moved, residual
                return True
        return False

    def comparison(self, candidate: int) -> LogComparison:
        """Return the comparison of the values of one candidate between the logs."""
        own = np.array([i == candidate for i, _ in self._parameters])
        values = tuple(LogValue(name, self._estimates(k, own)) for k, name in enumerate(self._logs))
        chance = self._chance(own)
        if chance is None:
            return LogComparison(values, "unknown", None)
        if chance < CHANCE:
            return LogComparison(values, "changed", chance)
        known = self._is_known(own)
        return LogComparison(values, "same" if known else "unknown", chance)

    def _shown(self) -> Bools:
        """Return which parameters have a value in each log, shape (logs, p).

        Times of events and shapes have the same value in all logs.
        """
        common = np.array([bool(p.hints.starts) or p.hints.shape for _, p in self._parameters])
        change = np.array(
            [np.linalg.norm(self._jacobian[self._log == k], axis=0) for k in range(len(self._logs))]
        )
        return np.asarray(~common & (change > SHOWS))

    def _estimates(self, k: int, own: Bools) -> dict[str, Estimate]:
        deviation = np.full(self.free.shape, np.nan)
        deviation[self.free] = self._deviation
        found = {}
        for j in np.flatnonzero(self.free[k] & own):
            _, p = self._parameters[j]
            ends = self.theta[k, j] + WIDE * deviation[k, j] * np.array([-1.0, 0.0, 1.0])
            ends = p.null + p.scale * np.clip(ends, self._low[j], self._high[j])
            low, high = sorted((float(ends[0]), float(ends[2])))
            found[p.name] = Estimate(float(ends[1]), low, high, p.unit)
        return found

    def _chance(self, own: Bools) -> float | None:
        """Return the probability of such differences by chance; None without two values."""
        where = np.argwhere(self.free)
        rows = list[Floats]()
        for j in np.flatnonzero(own):
            at = np.flatnonzero(where[:, 1] == j)
            for other in at[1:]:
                row = np.zeros(len(where))
                row[at[0]], row[other] = 1.0, -1.0
                rows.append(row)
        if not rows:
            return None
        differ = np.array(rows)
        gap = differ @ self.theta[self.free]
        inverse = np.linalg.pinv(differ @ self.covariance @ differ.T, hermitian=True)
        return float(chi2.sf(gap @ inverse @ gap, len(rows)))

    def _is_known(self, own: Bools) -> bool:
        """Return whether the intervals are narrow enough to notice a change by the whole value."""
        deviation = np.zeros(self.free.shape)
        deviation[self.free] = self._deviation
        size = np.abs(self.theta).max(axis=0)
        foremost = int(np.argmax(np.where(own & self.free.any(axis=0), size, -1.0)))
        wide = WIDE * deviation[self.free[:, foremost], foremost]
        return bool(np.all(wide < size[foremost]))

    def _cost(self, residual: Floats) -> float:
        return float(np.sum(self._problem.noise_model.whiten(residual) ** 2))

    def _replayed(self, trials: Sequence[Floats]) -> list[Floats]:
        """Return the residuals (n,) with the values of each log, shape (logs, p) each."""
        return self._problem.replayer.residuals([self._parts(theta) for theta in trials])

    def _parts(self, theta: Floats) -> list[Part]:
        """Return each candidate in each log with its values (logs, p)."""
        parts: list[Part] = []
        for log, row in zip(self._logs, theta, strict=True):
            for candidate, values in with_theta(self._start, row):
                location = replace(candidate.location, log=log)
                parts.append((replace(candidate, location=location), values))
        return parts


def _key(candidate: Candidate) -> tuple[str, Location]:
    return candidate.cause.id, candidate.location


def _completed(candidates: Sequence[Candidate], parts: Hypothesis) -> list[Part]:
    """Return candidates with the values that they have in ``parts``, or else their null values."""
    known = {_key(candidate): values for candidate, values in parts}
    return [(one, known.get(_key(one), one.null_values())) for one in candidates]


def _log_of_readings(problem: Problem, logs: Sequence[str]) -> Ints:
    """Return the index of the log of each reading, shape (n,)."""
    episodes = problem.system.study.episodes
    index = np.array([logs.index(episode.log) for episode in episodes])
    return np.asarray(index[problem.measured.episode])
