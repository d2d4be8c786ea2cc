"""Search for the wiring that explains the responses, one fault after the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.commissioning.candidates import ARMS, EXCHANGED, Candidate, candidates
from jmm_agent.commissioning.findings import SWAPPED
from jmm_agent.commissioning.likelihood import Likelihood
from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.commissioning.wiring import Wiring

TEMPER = 0.5
"""Share of a difference of evidence that counts, because errors of responses are alike [1]."""

COMMON = 6.0
"""How much likelier other moment arms are than a fault [nat]."""
CLOSE = 10.0
"""Difference of evidence within which another exchange is an alternative [nat]."""
SEARCHES = 3
"""Number of searches, each with the scales that derive from the one before."""
ALIKE = 0.8
"""Scales that are smaller by no more than this factor are alike [1]."""


class Step(NamedTuple):
    """One fault that was found.

    Attributes:
        candidate: what is wrong, and the wiring with it and all before.
        evidence: beyond the wiring before it [nat].
        confidence: beside other candidates with the same channels [1].
    """

    candidate: Candidate
    evidence: float
    confidence: float


def search(likelihood: Likelihood, options: CommissionOptions) -> tuple[Wiring, list[Step]]:
    """Wiring of a robot, and the steps that lead there from one without faults.

    The scales of errors are estimated before, and again with the result; where that changes them,
    the search is repeated.

    Args:
        likelihood: of wirings.
        options: least evidence, and least factor of a scale.
    """
    count = len(likelihood.lengths)
    likelihood.rescale(Wiring.healthy(count))
    for _ in range(SEARCHES):
        wiring, steps = _greedy(likelihood, options, count)
        before = likelihood.scale * likelihood.friction
        likelihood.rescale(wiring)
        if likelihood.scale * likelihood.friction > ALIKE * before:
            break
    return wiring, steps


def _greedy(
    likelihood: Likelihood, options: CommissionOptions, count: int
) -> tuple[Wiring, list[Step]]:
    wiring, steps = Wiring.healthy(count), list[Step]()
    for _ in range(2 * count):
        base = likelihood.of(wiring)
        found = list(candidates(likelihood, wiring, options.factor))
        gains = np.array([likelihood.of(each.wiring) for each in found]) - base
        usual = np.array([each.kind == ARMS for each in found])
        best = int((gains + COMMON * usual).argmax())
        if gains[best] + COMMON * usual[best] < options.named:
            break
        shared = np.array([bool(set(each.channels) & set(found[best].channels)) for each in found])
        for number in np.flatnonzero(~shared & (gains > gains[best] - CLOSE)):
            shared[number] = _explains_same(likelihood, found[best], found[number])
        others = TEMPER * (np.append(gains[shared], 0.0) - gains[best])
        confidence = 1.0 / float(np.exp(others).sum())
        wiring = found[best].wiring
        if not usual[best]:
            steps.append(Step(found[best], float(gains[best]), confidence))
    return wiring, steps


def _explains_same(likelihood: Likelihood, best: Candidate, other: Candidate) -> bool:
    """Whether an exchange of other channels explains the same, so that both are worse than one."""
    if not best.kind == other.kind == SWAPPED:
        return False
    first, second = other.channels
    both = best.wiring.swapped(first, second, EXCHANGED[other.part])
    return likelihood.of(both) < likelihood.of(best.wiring)
