"""Joint fit: what a person would free at a machine that is wrong by many noises, all at once.

One cause after the other does not lead far where several are large: what any of them leaves alone
is so large and so correlated that the next one has hardly any evidence, and a cause that is not
there may take the place of two. A person fits gains, friction, damping, rotor, offset and delay
together. So does this, and then drops what adds too little, the least first (backward elimination).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.inference.gauss_newton import Fit, fit, null_fit, profile
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import Sensitivity
from reality_gap.inference.theta import free_parameters
from reality_gap.simulation.hypothesis import Candidate, Hypothesis

GAIN, MASS = "position_gain", "link_mass"
USUAL = (
    *(GAIN, "velocity_gain", "coulomb_friction", "viscous_friction", "armature", "force_offset"),
    *(MASS, "delay"),
)
"""Causes that are freed together; masses only where no gain is. A position servo moves the same
with all forces and masses twice as large."""
MOST = 24
"""Largest number of parameters that are fitted together."""
SETTLINGS, REFITS = 5, 2
"""How often a fit is repeated with the variance of what it leaves, at first and without a cause."""
TRIED = 3
"""How many of the least significant causes are tried to be dropped."""


def joint_fit(
    problem: Problem, sensitivities: Sequence[Sensitivity], start: Hypothesis, needed: float
) -> list[Fit]:
    """Fit all usual causes together, and drop those that add too little.

    Args:
        problem: what is to be explained, without inflation.
        sensitivities: of all candidates.
        start: causes found one by one, with the values with which the usual ones begin.
        needed: what each cause must add [nats].

    Returns:
        Fits of one cause, of two and so on to all that are left, each with one more than the one
        before, with their profile likelihood; empty if there are too many parameters.
    """
    bare, candidates = problem.without_tolerances(), _usual(sensitivities)
    if len(candidates) < 2 or sum(len(one.parameters) for one in candidates) > MOST:
        return []
    known = {(one.cause.id, one.location): values for one, values in start}
    begin = [
        (one, known.get((one.cause.id, one.location), one.null_values())) for one in candidates
    ]
    best = _settled(bare, begin, SETTLINGS)
    chain = [best]
    while len(best.hypothesis) > 1:
        fewer = [_settled(bare, rest, REFITS) for rest in _without_least(bare, best)]
        best = max(fewer, key=lambda one: one.evidence)
        chain.insert(0, best)
    worth = [one.evidence - needed * len(one.hypothesis) for one in chain]
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


def _settled(problem: Problem, start: Hypothesis, rounds: int) -> Fit:
    """Fit causes with the variance of what they leave, as in a fit of unknown variance."""
    residual = problem.replayer.residual(start)
    fitted = null_fit(problem)
    for _ in range(rounds):
        fitted = fit(problem.widened(residual), start)
        start, residual = fitted.hypothesis, fitted.residual
    return profile(problem, fitted)


def _without_least(problem: Problem, fitted: Fit) -> list[Hypothesis]:
    """Return a fit's causes without one of those that seem to add the least."""
    own = problem.widened(fitted.residual)
    columns = own.noise_model.whiten(fitted.jacobian)
    covariance = np.linalg.pinv(columns.T @ columns)
    owner, adds = np.array([i for i, _ in free_parameters(fitted.hypothesis)]), list[float]()
    for i in range(len(fitted.hypothesis)):
        rows = np.flatnonzero(owner == i)
        theta, block = fitted.theta[rows], covariance[np.ix_(rows, rows)]
        adds.append(float(theta @ np.linalg.pinv(block) @ theta))
    least = np.argsort(adds, kind="stable")[:TRIED]
    return [[part for k, part in enumerate(fitted.hypothesis) if k != i] for i in least]
