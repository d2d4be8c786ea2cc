"""Expansion: about which deviations within the tolerances the readings are linearised.

Where small deviations of a model change the readings by many noises, as in a machine that is moved
without feedback, the changes are not linear in the deviations, and what linear columns leave looks
like a fault. With the residual r(s) of a replay with deviations s in units of their tolerances, and
the changes N(s) of the readings by one more tolerance each, the residual

    r(s) + N(s) s

is that of the nominal model apart from what is not linear up to s. Replays of hypotheses are
corrected alike, so that the deviations still have a normal prior with the mean 0. A hypothesis is
replayed without the deviations of its own candidates, whose values it has. The most probable
s is found by Gauss-Newton steps, each as long as it makes s more probable, with other tolerances
integrated out: first from the begin of each episode, where little has grown yet, then from more of
it, as one fits trajectories that diverge. N is replayed again where steps with an older one do not
lead there quickly: it costs a replay for each deviation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.inference.problem import Problem
from reality_gap.inference.tolerances import Tolerance
from reality_gap.inference.whitening import (
    Whitening,
    explained_by_tolerances,
    likeliest_sizes,
    whitening,
)
from reality_gap.simulation.hypothesis import Hypothesis, Part, build
from reality_gap.simulation.replayer import Expansion, Replayer
from reality_gap.study.splits import SELECT, split
from reality_gap.study.system import System
from reality_gap.types import Floats

SMALL = 1.0
"""RMS of what tolerances explain up to which it is taken for linear [noise]."""
LARGE = 5.0
"""RMS up to which deviations are inferred from whole episodes at once [noise]."""
CHANCE = 3.0
"""Deviations of the mean square of noise above 1 up to which a whitened residual is noise."""
HORIZONS = (0.25, 0.5, 1.0)
"""Shares of each episode from which deviations are inferred, one after the other."""
STEPS = 6
"""Largest number of steps with each of these."""
SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)
"""Shares of a step that are tried."""
BETTER = 0.02
"""Share of minus the log probability beyond that of noise, by which a step must reduce it."""
QUICK = 0.5
"""The same share, by which a step with older slopes must reduce it."""
LEAST = 3.0
"""Smallest gain of log probability that counts [nats]."""
BENT = 0.5
"""RMS of what is not linear up to the deviations, from which on slopes are replayed there
[noise]."""
MOST = 3.0
"""Largest deviation of a parameter in the expansion, in tolerances."""
COUNT = 80
"""Largest number of parameters in the expansion: those that explain most."""
DIFFERENCE = 0.25
"""Finite difference, in tolerances."""


class Expanded(NamedTuple):
    """Linearisation about deviations within the tolerances.

    Attributes:
        expansion: the deviations, and their linear effect.
        columns: changes of the readings by all tolerances, shape (n, p).
        residual: residual in it of the hypothesis beside which it was found, shape (n,).
        power: mean square of this residual, whitened.
    """

    expansion: Expansion
    columns: Floats
    residual: Floats
    power: float


def is_small(replayer: Replayer, columns: Floats, residual: Floats) -> bool:
    """Return whether what tolerances explain of a residual is so small that it is linear.

    Args:
        replayer: has the readings.
        columns: changes by all tolerances, shape (n, p).
        residual: residual of the causes that were found, shape (n,).
    """
    return _Whitened(replayer).explained(columns, residual) < SMALL


def is_noise(replayer: Replayer, power: float) -> bool:
    """Return whether a mean square of a whitened residual is that of noise."""
    count = np.count_nonzero(split(replayer.measured) <= SELECT)
    return power < 1.0 + CHANCE * float(np.sqrt(2.0 / count))


def handicaps(
    problem: Problem, own: Expanded, frame: Expanded, residual: Floats
) -> tuple[float, float]:
    """Return how much less likely the model is in a linearisation than in its own [nats].

    Args:
        problem: has the readings, and says how many of them count as one.
        own: the linearisation about the deviations that are likeliest without causes.
        frame: another linearisation.
        residual: residual of the model without causes in that one, shape (n,).

    Returns:
        The difference of the likelihoods with the noise of the sensors, and of the profile
        likelihoods, by which causes are compared where a model is wrong by many noises. Both are at
        least 0; 0 if the model diverges there.
    """
    if frame is own or not np.isfinite(residual).all():
        return 0.0, 0.0
    more = _Whitened(problem.replayer).power(frame.columns, residual) - own.power
    inflation = problem.noise_model.inflation[split(problem.measured) <= SELECT]
    bare = problem.without_tolerances()

    def likelihood(left: Floats) -> float:
        return bare.widened(left).noise_model.log_likelihood(left)

    profiled = likelihood(own.residual) - likelihood(residual)
    return max(0.0, 0.5 * float(np.sum(1.0 / inflation)) * more), max(0.0, profiled)


def expand(
    replayer: Replayer,
    tolerances: Sequence[Tolerance],
    columns: Floats,
    hypothesis: Hypothesis,
    residual: Floats,
) -> Expanded:
    """Linearise the residual of a hypothesis about its most probable deviations.

    Args:
        replayer: replays hypotheses, without an expansion.
        tolerances: the tolerances.
        columns: changes by these, in their order, and by others, shape (n, p).
        hypothesis: causes with their values; none for the nominal model.
        residual: its residual, shape (n,).

    Returns:
        The linearisation; that about no deviations unless another is surely more probable.
    """
    whole = _Whitened(replayer)
    plain = found = Expanded(Expansion(), columns, residual, whole.power(columns, residual))
    chosen = _choose(replayer, tolerances, whole, columns, residual, hypothesis)
    if not chosen:
        return plain
    parts = _Deviations([tolerances[i] for i in chosen], hypothesis, replayer)
    walk = _Walk(parts, chosen, columns, residual)
    at_once = whole.explained(columns, residual) < LARGE
    for share in HORIZONS[-1:] if at_once else HORIZONS:
        for _ in walk.approach(_Whitened(replayer, share)):
            here = walk.expanded(whole)
            found = here if here.power < found.power else found
    if walk.is_bent and walk.replay_slopes():
        here = walk.expanded(whole)
        found = here if here.power < found.power or is_noise(replayer, here.power) else found
    gain = 0.5 * whole.count * (plain.power - found.power)
    return found if gain > LEAST else plain


class _Walk:
    """A way to the most probable deviations.

    Args:
        parts: replays of p deviations.
        chosen: their indices among the columns.
        columns: changes by all tolerances, shape (n, q).
        residual: residual without deviations, shape (n,).
    """

    def __init__(
        self, parts: _Deviations, chosen: Sequence[int], columns: Floats, residual: Floats
    ) -> None:
        self._parts, self._chosen = parts, chosen
        self._others = np.delete(columns, chosen, axis=1)
        self._first = self._residual = residual
        self._columns, self._sizes = columns, np.zeros(len(chosen))
        self._fresh = True

    @property
    def _shift(self) -> Floats:
        return self._columns[:, self._chosen] @ self._sizes

    @property
    def is_bent(self) -> bool:
        """Whether older slopes are in use, and what is not linear up to here is large."""
        bend = self._residual + self._shift - self._first
        return not self._fresh and float(np.sqrt(np.mean(bend**2))) > BENT

    def expanded(self, whitened: _Whitened) -> Expanded:
        """Return the linearisation about these deviations."""
        effects = (self._columns[:, self._chosen] * self._sizes).T
        residual = self._residual + self._shift
        power = whitened.power(self._columns, residual)
        expansion = Expansion(self._parts.at(self._sizes), effects)
        return Expanded(expansion, self._columns, residual, power)

    def approach(self, whitened: _Whitened) -> Iterator[None]:
        """Step towards the most probable deviations given some readings; yield after each step."""
        cost = whitened.cost_beside(self._others)
        least = cost(self._residual, self._sizes)
        for _ in range(STEPS):
            residual = self._residual + self._shift
            aim = whitened.sizes(self._columns, residual)[self._chosen]
            aim = np.clip(aim, self._parts.low, self._parts.high)
            trials = [self._sizes + share * (aim - self._sizes) for share in SHARES]
            pairs = list(zip(self._parts.residuals(trials), trials, strict=True))
            costs = [cost(*pair) for pair in pairs]
            gain, excess = least - min(costs), least - 1.0
            better = gain > max(BETTER * excess, 2.0 * LEAST / whitened.count)
            if better:
                least, self._fresh = min(costs), False
                self._residual, self._sizes = pairs[int(np.argmin(costs))]
            elif self._fresh:
                return
            if not (better and gain > QUICK * excess) and not self.replay_slopes():
                return
            yield

    def replay_slopes(self) -> bool:
        """Replay the slopes at these deviations; return whether they are finite."""
        slopes = self._parts.slopes(self._sizes, self._residual)
        if not np.isfinite(slopes).all():
            return False
        self._columns = self._columns.copy()
        self._columns[:, self._chosen] = slopes
        self._fresh = True
        return True


class _Whitened:
    """Whitens residuals of the readings from which causes are inferred.

    Args:
        replayer: has the readings.
        horizon: share of each episode, from its begin on, that is used.
    """

    def __init__(self, replayer: Replayer, horizon: float = 1.0) -> None:
        measured = replayer.measured
        near = np.zeros(len(measured.time), dtype=bool)
        for e in np.unique(measured.episode):
            own = measured.episode == e
            since = measured.time - measured.time[own].min()
            near |= own & (since <= horizon * since[own].max())
        self._use = (split(measured) <= SELECT) & near
        self._ones = np.ones(len(self._use))
        self.count = int(np.count_nonzero(self._use))

    def cost_beside(self, columns: Floats) -> Callable[[Floats, Floats], float]:
        """Return a function of a residual (n,) with deviations, and of these in tolerances (p,).

        It is minus twice the log probability of the deviations, per reading, with the other
        tolerances, whose changes are the columns (n, q), integrated out.
        """
        whiten, count = whitening(columns, self._ones, self._use), self.count

        def cost(residual: Floats, sizes: Floats) -> float:
            return _mean_square(whiten, residual) + float(sizes @ sizes) / count

        return cost

    def power(self, columns: Floats, residual: Floats) -> float:
        """Return the mean square of a whitened residual (n,); infinite if it is not finite."""
        return _mean_square(whitening(columns, self._ones, self._use), residual)

    def explained(self, columns: Floats, residual: Floats) -> float:
        """Return the RMS of what columns (n, p) explain of a residual (n,)."""
        found = explained_by_tolerances(columns, self._ones, self._use, residual)
        return float(np.sqrt(np.mean(found**2)))

    def sizes(self, columns: Floats, residual: Floats) -> Floats:
        """Return the most probable weights of columns (n, p), shape (p,)."""
        return likeliest_sizes(columns, self._ones, self._use, residual)


def _mean_square(whiten: Whitening, residual: Floats) -> float:
    """Return the mean square of a whitened residual (n,); infinite if it is not finite."""
    return float(np.mean(whiten(residual) ** 2)) if np.isfinite(residual).all() else float("inf")


class _Deviations:
    """Replays of a hypothesis with deviations of p parameters, in tolerances."""

    def __init__(
        self, chosen: Sequence[Tolerance], hypothesis: Hypothesis, replayer: Replayer
    ) -> None:
        self._chosen, self._hypothesis, self._replayer = chosen, hypothesis, replayer
        self.low, self.high = np.array([_bounds(one) for one in chosen]).T

    def at(self, sizes: Floats) -> tuple[Part, ...]:
        """Return the deviations of these sizes (p,)."""
        return tuple(o.deviation(float(x)) for o, x in zip(self._chosen, sizes, strict=True))

    def residuals(self, sizes: Sequence[Floats]) -> list[Floats]:
        """Return the residual with deviations of each of these sizes (p,)."""
        return self._replayer.residuals([[*self.at(one), *self._hypothesis] for one in sizes])

    def slopes(self, sizes: Floats, residual: Floats) -> Floats:
        """Return the change of the readings by one more tolerance each, shape (n, p)."""
        steps = np.where(sizes + DIFFERENCE <= self.high, DIFFERENCE, -DIFFERENCE)
        residuals = self.residuals(list(sizes + np.diag(steps)))
        return np.column_stack([(residual - r) / h for r, h in zip(residuals, steps, strict=True)])


def _choose(
    replayer: Replayer,
    tolerances: Sequence[Tolerance],
    whitened: _Whitened,
    columns: Floats,
    residual: Floats,
    hypothesis: Hypothesis,
) -> list[int]:
    """Return the indices of the tolerances that explain most of a residual."""
    faults = [candidate for candidate, _ in hypothesis]
    able = [
        i
        for i, one in enumerate(tolerances)
        if suits(replayer.system, one) and not any(one.candidate.matches(f) for f in faults)
    ]
    sizes = whitened.sizes(columns, residual)
    effects = np.abs(sizes[able]) * np.linalg.norm(columns[:, able], axis=0)
    return sorted(able[k] for k in np.argsort(-effects, kind="stable")[:COUNT])


def suits(system: System, tolerance: Tolerance) -> bool:
    """Return whether a deviation is a number of the model, and of the simplest kind there.

    Dry friction deviates to one side; no other cause does that can also be a candidate. That before
    a force sensor changes the readings, too.
    """
    (candidate, values), p = tolerance.deviation(1.0), tolerance.parameter
    cause = candidate.cause
    if cause.edit is None or cause.fine or not (p.low < p.null < p.high or cause.sticky):
        return False
    effects = build(system, [(candidate, values)]).effects
    if effects.commands or effects.hooks or effects.motions or effects.efforts:
        return False
    return cause.sticky or not effects.readings


def _bounds(tolerance: Tolerance) -> tuple[float, float]:
    """Return the smallest and the largest deviation in the expansion, in tolerances."""
    p = tolerance.parameter
    ends = sorted(((p.low - p.null) / tolerance.size, (p.high - p.null) / tolerance.size))
    return max(-MOST, ends[0]), min(MOST, ends[1])
