"""Equivalence: alternatives to each cause of a hypothesis that the data cannot exclude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.inference.confidence import probabilities
from reality_gap.inference.forward_selection import Search, Settings
from reality_gap.inference.gauss_newton import Fit, fit, null_fit, rescore
from reality_gap.inference.problem import Problem
from reality_gap.inference.refinement import fit_next
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.types import Floats

CHANCE = 0.05
"""Probability from which on an alternative may be equivalent."""
NEAR = 1.0
"""Mean square of the difference of two residuals below which they are equivalent [noise^2]."""


@dataclass(frozen=True)
class Alternatives:
    """A cause of the best hypothesis, and the candidates that were tried in its place.

    Attributes:
        candidate: the cause.
        without: the best hypothesis without it, fitted again.
        tried: fits of ``without`` with the cause or another candidate, best first.
        confidence: probability of each of ``tried``, shape (k,).
        evidence: what each of ``tried`` adds to the evidence of ``without``, shape (k,) [nats].
        own: what the cause itself adds [nats].
        equivalent: candidates that predict the same to within the noise and are not unlikely.
    """

    candidate: Candidate
    without: Fit
    tried: tuple[Fit, ...]
    confidence: Floats
    evidence: Floats
    own: float
    equivalent: tuple[Candidate, ...]


def alternatives(
    result: Search,
    settings: Settings,
    retry: bool = True,
    refused: Sequence[Candidate] = (),
) -> tuple[Alternatives, ...]:
    """Try other candidates in the place of each cause of the best hypothesis.

    Args:
        result: the result of the search.
        settings: thresholds of the search.
        retry: whether to fit candidates beside causes beside which the search tried none.
        refused: candidates that are no alternatives, for they were dropped.
    """
    problem, best = result.problem, result.best
    found = []
    for i, candidate in enumerate(best.candidates):
        rest = [part for j, part in enumerate(best.hypothesis) if j != i]
        step = result.step_beside(rest)
        if step is not None:
            without, tried = step.base, step.tried
        elif retry:
            without = fit(problem, rest) if rest else null_fit(problem)
            tried = fit_next(problem, result.sensitivities, without, settings.refits)
        else:
            without, tried = null_fit(problem), ()
        fits = _with_best(problem, tried, best, [candidate, *refused])
        floor = rescore(problem, without).evidence
        chances = probabilities(floor, fits)
        found.append(
            Alternatives(
                candidate=candidate,
                without=without,
                tried=fits,
                confidence=chances,
                evidence=np.array([f.evidence for f in fits]) - floor,
                own=rescore(problem, best).evidence - floor,
                equivalent=_equivalent(best, fits, chances),
            )
        )
    return tuple(found)


def first_attempt(result: Search) -> tuple[Alternatives, ...]:
    """Return the candidates of the first step of a search, none of which was accepted."""
    problem = result.problem
    tried = tuple(rescore(problem, fit) for fit in result.steps[0].tried) if result.steps else ()
    if not tried:
        return ()
    tried = tuple(sorted(tried, key=lambda f: -f.evidence))
    evidence = np.array([f.evidence for f in tried])
    first = tried[0].candidates[-1]
    confidence = probabilities(0.0, tried)
    own = float(evidence[0])
    return (Alternatives(first, null_fit(problem), tried, confidence, evidence, own, ()),)


def _with_best(
    problem: Problem, tried: Sequence[Fit], best: Fit, excluded: Sequence[Candidate]
) -> tuple[Fit, ...]:
    """Return the best hypothesis and the fits of other candidates, each once, best first.

    Args:
        problem: what is to be explained.
        tried: fits with one candidate more each.
        best: the best hypothesis.
        excluded: its own candidate, of which there may be an earlier fit, and others to leave out.
    """
    others = list[Fit]()
    for one in sorted((rescore(problem, f) for f in tried), key=lambda f: -f.evidence):
        last, known = one.candidates[-1], [other.candidates[-1] for other in others]
        if not any(last.matches(other) for other in (*excluded, *known)):
            others.append(one)
    return tuple(sorted([rescore(problem, best), *others], key=lambda f: -f.evidence))


def _equivalent(best: Fit, fits: Sequence[Fit], chances: Floats) -> tuple[Candidate, ...]:
    """Return the last candidates of fits that predict the same as the best hypothesis."""
    found = []
    for other, chance in zip(fits, chances, strict=True):
        if other.hypothesis is best.hypothesis or chance < CHANCE:
            continue
        if float(np.mean((other.residual - best.residual) ** 2)) < NEAR:
            found.append(other.candidates[-1])
    return tuple(found)
