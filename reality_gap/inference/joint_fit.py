"""Joint fit: what a person would free at a machine that is wrong by many noises, all at once.

One cause after the other does not lead far where several are large: what any of them leaves alone
is so large and so correlated that the next one has hardly any evidence, and a cause that is not
there may take the place of two. A person fits gains, friction, damping, rotor, offset and delay
together. So does this, from several starts (see `descent`), and then drops what adds too little,
the least first (backward elimination).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.inference.descent import FACTORS, descend, finite
from reality_gap.inference.gauss_newton import Fit, fit, null_fit, profile
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import Sensitivity
from reality_gap.inference.theta import free_parameters, is_tolerable
from reality_gap.simulation.hypothesis import Candidate, Hypothesis

GAIN, MASS, OFFSET = "position_gain", "link_mass", "force_offset"
USUAL = (
    *(GAIN, "velocity_gain", "coulomb_friction", "viscous_friction", "armature", OFFSET),
    *(MASS, "delay"),
)
"""Causes that are freed together; masses only where no gain is. A position servo moves the same
with all forces and masses twice as large."""
MOST = 24
"""Largest number of parameters that are fitted together."""
FIRST, MORE, REFITS = 8, 32, 8
"""Steps from each start, from the best ones, and without a cause."""
KEPT = 2
"""Number of starts that are continued."""
SETTLINGS = 3
"""How often a fit is repeated with the variance of what it leaves."""
SETTLED = 0.9
"""Share of the power that a repeated fit must leave to be the last one."""
GAINS = (50.0, 9.0, -0.7, -0.9, -0.97, -0.99)
"""Relative excess of all gains with which a fit begins, too: gains are wrong by a factor more often
than any other property, and from those of the model a fit may end far from what is likeliest."""
LITTLE = 2.0
"""Growth of the power that is left up to which a deviation that every good model may have explains
little."""
TRIED = 3
"""How many of the least significant causes are tried to be dropped."""


def joint_fit(
    problem: Problem,
    sensitivities: Sequence[Sensitivity],
    starts: Sequence[Hypothesis],
    widely: bool = True,
) -> Fit | None:
    """Fit all usual causes together.

    Args:
        problem: what is to be explained, without inflation.
        sensitivities: of all candidates.
        starts: causes with the values with which the usual ones begin, at least one set of them.
        widely: whether to begin with each of `GAINS`, too.

    Returns:
        The fit, with its profile likelihood; None if there are too many parameters.
    """
    bare, candidates = problem.without_tolerances(), _usual(sensitivities)
    if len(candidates) < 2 or sum(len(one.parameters) for one in candidates) > MOST:
        return None
    begins = [_begin(candidates, start) for start in starts]
    return _best(bare, [*begins, *(_other_gains(begins[0]) if widely else [])])


def eliminated(problem: Problem, joint: Fit, needed: float) -> list[Fit]:
    """Drop those causes of a joint fit that add too little, the least first.

    Args:
        problem: what is to be explained, without inflation.
        joint: the joint fit.
        needed: what each cause must add [nats].

    Returns:
        Fits of one cause, of two and so on to all that are left, each with one more than the one
        before, with their profile likelihood. The last one has no evidence if it has a deviation
        that every good model may have.
    """
    bare = problem.without_tolerances()
    while (fewer := _without_deviation(bare, joint)) is not None:
        joint = fewer
    chain = [joint]
    while len(chain[0].hypothesis) > 1:
        chain.insert(0, _best_without(bare, chain[0], _least(bare, chain[0])))
    worth = [one.raw_evidence - needed * len(one.hypothesis) for one in chain]
    return chain[: 1 + int(np.argmax(worth))]


def _usual(sensitivities: Sequence[Sensitivity]) -> list[Candidate]:
    """Return the usual candidates at single elements, in all logs.

    A delay is that of commands: beside it, one of readings would be free in the opposite sense.
    """
    found = list[Candidate]()
    for candidate in (one.candidate for one in sensitivities):
        location, usual = candidate.location, candidate.cause.id in USUAL
        single = len(location.elements) == 1 and not location.log and location.kind != "sensor"
        if usual and single and not any(candidate.matches(other) for other in found):
            found.append(candidate)
    servos = any(one.cause.id == GAIN for one in found)
    return [one for one in found if not (servos and one.cause.id == MASS)]


def _begin(candidates: Sequence[Candidate], start: Hypothesis) -> Hypothesis:
    """Return all candidates with the values that they have in a start, or that change nothing."""
    known = {(one.cause.id, one.location): values for one, values in start}
    return [(one, known.get((one.cause.id, one.location), one.null_values())) for one in candidates]


def _best(problem: Problem, starts: Sequence[Hypothesis]) -> Fit:
    """Return the likeliest fit from several starts with the same causes.

    An offset can take the place of gravity, which alone shows how large all forces are if a servo
    moves the machine: it is freed last.
    """
    offsets = [[part for part in one if part[0].cause.id == OFFSET] for one in starts]
    anchored = [[part for part in one if part[0].cause.id != OFFSET] for one in starts]
    if not anchored[0]:
        offsets, anchored = [[] for _ in starts], [list(one) for one in starts]
    tried = [
        (_settled(problem, one, FIRST), own) for one, own in zip(anchored, offsets, strict=True)
    ]
    tried.sort(key=lambda pair: -pair[0].raw_evidence)
    more = [_settled(problem, [*one.hypothesis, *own], MORE) for one, own in tried[:KEPT]]
    return max(more, key=lambda one: one.raw_evidence)


def _other_gains(begin: Hypothesis) -> list[Hypothesis]:
    """Return a start with all gains at each of ``GAINS``; none if nothing has a gain."""
    if not any(one.cause.id in FACTORS for one, _ in begin):
        return []

    def with_gains(excess: float) -> Hypothesis:
        return [
            (one, dict.fromkeys(values, excess) if one.cause.id in FACTORS else values)
            for one, values in begin
        ]

    return [with_gains(excess) for excess in GAINS]


def _settled(problem: Problem, start: Hypothesis, steps: int) -> Fit:
    """Fit causes with the variance of what they leave, as in a fit of unknown variance."""
    residual = finite(problem.replayer.residual(start))
    fitted = null_fit(problem)
    for _ in range(SETTLINGS):
        own, before = problem.widened(residual), np.mean(residual**2)
        fitted = fit(own, descend(own, start, steps))
        start, residual = fitted.hypothesis, fitted.residual
        if np.mean(residual**2) > SETTLED * before:
            break
    return profile(problem, fitted)


def _without_deviation(problem: Problem, fitted: Fit) -> Fit | None:
    """Return a fit without one that every good model may have; None if each explains much."""
    if len(fitted.hypothesis) < 2:
        return None
    each = [i for i, part in enumerate(fitted.hypothesis) if is_tolerable(*part)]
    best = _best_without(problem, fitted, each) if each else None
    little = best and np.mean(best.residual**2) < LITTLE * np.mean(fitted.residual**2)
    return best if little else None


def _best_without(problem: Problem, fitted: Fit, each: Sequence[int]) -> Fit:
    """Return the likeliest fit without one of the causes of these indices."""
    parts = list(fitted.hypothesis)
    rests = [parts[:i] + parts[i + 1 :] for i in each]
    fits = [_settled(problem, rest, REFITS) for rest in rests]
    return max(fits, key=lambda one: one.raw_evidence)


def _least(problem: Problem, fitted: Fit) -> list[int]:
    """Return the indices of those causes that seem to add the least."""
    own = problem.widened(fitted.residual)
    columns = own.noise_model.whiten(fitted.jacobian)
    covariance = np.linalg.pinv(columns.T @ columns)
    owner, adds = np.array([i for i, _ in free_parameters(fitted.hypothesis)]), list[float]()
    for i in range(len(fitted.hypothesis)):
        rows = np.flatnonzero(owner == i)
        theta, block = fitted.theta[rows], covariance[np.ix_(rows, rows)]
        adds.append(float(theta @ np.linalg.pinv(block) @ theta))
    return [int(i) for i in np.argsort(adds, kind="stable")[:TRIED]]
