"""The full fit of a hypothesis: least squares over replays."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.optimize import lsq_linear

from reality_gap.causes.base import Parameter
from reality_gap.inference.evidence import PRIOR, complexity
from reality_gap.inference.whitening import Whitening
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.types import Floats

T = TypeVar("T")
Asking = Generator[list[Hypothesis], list[Floats], T]
"""A computation that asks for the residuals of hypotheses, some at a time; see `together`."""

STEP = 0.1
"""Finite difference of a fit, in scales of a parameter."""
ROUNDS = 3
"""Gauss-Newton steps at most."""
FACTORS = (0.5, 0.75, 1.35, 1.8)
"""Sizes that are tried beside a fitted one."""
SHAPES = (0.5, 2.0, 4.0)
"""What is idle at the null has no slope there; so many times its usual value is tried."""
ENOUGH = 0.2
"""A step that promises less is not taken [nats]."""


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis.

    Attributes:
        hypothesis: suspects with their values.
        residual: (n,) of all readings, in units of sensor noise.
        jacobian: (n, p) change of the prediction per scale of a parameter, likewise.
        theta: (p,) in scales from the null.
        evidence: log marginal likelihood over the null model's, by Laplace [nats].
    """

    hypothesis: Hypothesis
    residual: Floats
    jacobian: Floats
    theta: Floats
    evidence: float

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Who is in it."""
        return tuple(candidate for candidate, _ in self.hypothesis)


def free_parameters(hypothesis: Hypothesis) -> list[tuple[int, Parameter]]:
    """All parameters, each with the index of its suspect."""
    return [(i, p) for i, (candidate, _) in enumerate(hypothesis) for p in candidate.parameters]


def to_theta(hypothesis: Hypothesis) -> Floats:
    """Values of a hypothesis (p,), in scales from the null."""
    found = free_parameters(hypothesis)
    return np.array([(hypothesis[i][1][p.name] - p.null) / p.scale for i, p in found])


def at(hypothesis: Hypothesis, theta: Floats) -> list[tuple[Candidate, dict[str, float]]]:
    """The hypothesis with the values of ``theta`` (p,), cut at the bounds."""
    values: list[dict[str, float]] = [{} for _ in hypothesis]
    for (i, p), x in zip(free_parameters(hypothesis), theta, strict=True):
        values[i][p.name] = float(np.clip(p.null + x * p.scale, p.low, p.high))
    return [(candidate, v) for (candidate, _), v in zip(hypothesis, values, strict=True)]


def penalty_scale(hypothesis: Hypothesis) -> Floats:
    """1 / prior deviation by parameter (p,); 0 for those with starts, whose prior is flat."""
    return np.array(
        [0.0 if p.hints.starts else 1.0 / PRIOR for _, p in free_parameters(hypothesis)]
    )


def held_price(candidate: Candidate) -> float:
    """What it costs to have chosen among starts, as when an event happened [nats]."""
    return float(sum(np.log(len(p.hints.starts)) for p in candidate.parameters if p.hints.starts))


def together(replayer: Replayer, asking: Sequence[Asking[T]]) -> list[T]:
    """Run computations side by side: what all of them ask for next is replayed at once."""
    found: dict[int, T] = {}
    asked: dict[int, list[Hypothesis]] = {}

    def go_on(i: int, answers: list[Floats] | None) -> None:
        try:
            asked[i] = asking[i].send(answers) if answers is not None else next(asking[i])
        except StopIteration as end:
            found[i] = end.value

    for i in range(len(asking)):
        go_on(i, None)
    while asked:
        now, asked = asked, {}
        answers = iter(replayer.residuals([one for some in now.values() for one in some]))
        for i, some in now.items():
            go_on(i, [next(answers) for _ in some])
    return [found[i] for i in range(len(asking))]


def fit(
    replayer: Replayer,
    start: Hypothesis,
    white: Whitening,
    null: Floats,
    jacobian: Floats | None = None,
) -> Fit:
    """Fit one hypothesis; see `fitting`."""
    return together(replayer, [fitting(start, white, null, jacobian)])[0]


def fitting(
    start: Hypothesis,
    white: Whitening,
    null: Floats,
    jacobian: Floats | None = None,
    polish: bool = True,
) -> Asking[Fit]:
    """Fit a hypothesis to the readings that ``white`` uses, by Gauss-Newton within bounds.

    A replay costs far more than anything else here, so that a step is taken whole and mended only
    if it fails, and the fit ends when the next step promises less than `ENOUGH`.

    Args:
        start: suspects with the values to start from.
        white: what residuals are measured in.
        null: (n,) residual of the model without the suspects.
        jacobian: (n, p) change of the prediction per scale, to begin with; differences if None.
        polish: whether to go on with differences where ``jacobian`` leads no further.
    """
    pull = penalty_scale(start)
    low, high = _bounds(start)
    theta = np.clip(to_theta(start), low, high)
    [residual] = yield [at(start, theta)]
    if not np.all(np.isfinite(residual)):
        theta = np.clip(theta / 4, low, high)
        [residual] = yield [at(start, theta)]
    if not np.all(np.isfinite(residual)):
        return Fit(at(start, 0 * theta), null, np.zeros((len(null), len(theta))), 0 * theta, 0.0)
    slopes = jacobian
    if slopes is not None:
        for _ in range(ROUNDS):
            moved = yield from _advance(start, theta, white, residual, slopes, pull)
            if moved is None:
                break
            theta, residual = moved
    if slopes is None or polish:
        for _ in range(ROUNDS):
            slopes = yield from _differences(start, theta, residual)
            moved = yield from _advance(start, theta, white, residual, slopes, pull)
            if moved is None:
                break
            theta, residual = moved
    assert slopes is not None
    evidence = log_evidence(white, null, residual, slopes, theta, start)
    return Fit(at(start, theta), residual, slopes, theta, evidence)


def resizing(old: Fit, white: Whitening, null: Floats, first: int) -> Asking[Fit]:
    """The fit with its causes from the ``first`` on of another size or shape, where that is better.

    What sticks and slips has several minima; differences see the nearest only.
    """
    lone = [len(candidate.parameters) == 1 for candidate in old.candidates]
    own = np.array(
        [i >= first and (lone[i] or not p.hints.starts) for i, p in free_parameters(old.hypothesis)]
    )
    pull, (low, high) = penalty_scale(old.hypothesis), _bounds(old.hypothesis)
    sizes = [np.where(own, f, 1.0) * old.theta for f in FACTORS]
    idle = [i >= first and p.hints.shape for i, p in free_parameters(old.hypothesis)]
    if any(idle):
        usual = np.array([p.null / p.scale for _, p in free_parameters(old.hypothesis)])
        sizes += [np.where(idle, (f - 1.0) * usual, old.theta) for f in SHAPES]
    sizes = [np.clip(theta, low, high) for theta in sizes]
    found = yield [at(old.hypothesis, theta) for theta in sizes]
    best, theta = old.residual, old.theta
    for residual, there in zip(found, sizes, strict=True):
        better = _cost(white, best, pull, theta) - ENOUGH
        if np.all(np.isfinite(residual)) and _cost(white, residual, pull, there) < better:
            best, theta = residual, there
    if best is old.residual:
        return old
    start = at(old.hypothesis, theta)
    return (yield from fitting(start, white, null, old.jacobian, polish=False))


def _advance(
    start: Hypothesis,
    theta: Floats,
    white: Whitening,
    residual: Floats,
    slopes: Floats,
    pull: Floats,
) -> Asking[tuple[Floats, Floats] | None]:
    """One step of Gauss-Newton: theta and residual after it; None if it is not worth it."""
    step, promise = _step(white, residual, slopes, theta, pull, _bounds(start))
    if promise < ENOUGH:
        return None
    return (yield from _try(start, theta, step, white, residual, pull))


def _step(
    white: Whitening,
    residual: Floats,
    jacobian: Floats,
    theta: Floats,
    pull: Floats,
    bounds: tuple[Floats, Floats],
) -> tuple[Floats, float]:
    """The step (p,) to the minimum of the linearised problem, and what it promises [nats]."""
    columns, left = white(jacobian), white(residual)
    matrix = np.vstack([columns, np.diag(pull)])
    right = np.concatenate([left, -pull * theta])
    low, high = bounds[0] - theta - 1e-12, bounds[1] - theta + 1e-12
    root = np.asarray(np.linalg.qr(np.column_stack([matrix, right]), mode="r"))
    step = lsq_linear(root[:, :-1], root[:, -1], bounds=(low, high)).x
    gone = right @ right - np.sum((right - matrix @ step) ** 2)
    return step, 0.5 * float(gone)


def _try(
    start: Hypothesis,
    theta: Floats,
    step: Floats,
    white: Whitening,
    residual: Floats,
    pull: Floats,
) -> Asking[tuple[Floats, Floats] | None]:
    """Theta and residual after the step, or after a quarter of it; None if neither is better."""
    before = _cost(white, residual, pull, theta)
    for share in (1.0, 0.25):
        there = theta + share * step
        [found] = yield [at(start, there)]
        if np.all(np.isfinite(found)) and _cost(white, found, pull, there) < before:
            return there, found
    return None


def _cost(white: Whitening, residual: Floats, pull: Floats, theta: Floats) -> float:
    return 0.5 * float(np.sum(white(residual) ** 2) + np.sum((pull * theta) ** 2))


def log_evidence(
    white: Whitening,
    null: Floats,
    residual: Floats,
    jacobian: Floats,
    theta: Floats,
    hypothesis: Hypothesis,
) -> float:
    """Laplace's approximation to the log marginal likelihood over the null model's [nats]."""
    before, after, columns = white(null), white(residual), white(jacobian)
    quality = 0.5 * float(before @ before - after @ after)
    free = free_parameters(hypothesis)
    cause = np.array([i for i, _ in free])
    flat = np.array([bool(p.hints.starts) for _, p in free])
    price = complexity(columns.T @ columns, theta, cause, flat)
    return quality - price - sum(held_price(candidate) for candidate, _ in hypothesis)


def _bounds(hypothesis: Hypothesis) -> tuple[Floats, Floats]:
    found = [p for _, p in free_parameters(hypothesis)]
    ends = [sorted(((p.low - p.null) / p.scale, (p.high - p.null) / p.scale)) for p in found]
    low, high = np.array(ends).T
    return low, high


def _differences(start: Hypothesis, theta: Floats, residual: Floats) -> Asking[Floats]:
    """Change of the prediction per scale (n, p), one-sided, away from the nearer bound."""
    steps = np.where(theta + STEP <= _bounds(start)[1], STEP, -STEP)
    moved = yield [at(start, theta + change) for change in np.diag(steps)]
    columns = [(residual - other) / step for other, step in zip(moved, steps, strict=True)]
    return np.nan_to_num(np.column_stack(columns))
