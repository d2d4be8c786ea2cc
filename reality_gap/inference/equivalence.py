"""Equivalence: alternatives to each cause of a hypothesis that the data cannot exclude."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.inference.confidence import probabilities
from reality_gap.inference.forward_selection import Search, Settings
from reality_gap.inference.gauss_newton import (
    Fit,
    evidence_without,
    fit,
    fit_stepwise,
    null_fit,
    rescore,
    run_together,
)
from reality_gap.inference.problem import Problem
from reality_gap.inference.refinement import fit_next
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.types import Floats

CHANCE = 0.05
"""Probability from which on an alternative may be equivalent."""
CLOSE = 50.0
"""Evidence up to which an alternative that lacks it is fitted again [nats]."""
POLISHED = 4
"""Largest number of such alternatives to a cause."""
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
        evidence: what each of ``tried`` adds to the evidence of ``without``, or to that of a
            deviation that is no fault in its place, shape (k,) [nats].
        own: what the cause itself adds [nats].
        alike: which of ``tried`` predict the same as the best hypothesis to within the noise.
        equivalent: candidates that do and are not unlikely.
    """

    candidate: Candidate
    without: Fit
    tried: tuple[Fit, ...]
    confidence: Floats
    evidence: Floats
    own: float
    alike: tuple[bool, ...]
    equivalent: tuple[Candidate, ...]

    @property
    def right(self) -> float:
        """Probability of the cause, wherever it acts."""
        return self._chance(self._same())

    @property
    def support(self) -> float:
        """Probability of the cause, wherever it acts, and of all that predict the same."""
        return self._chance([a or b for a, b in zip(self._same(), self.alike, strict=True)])

    def _same(self) -> list[bool]:
        """Return which of ``tried`` have this cause, or one of which it is a special case."""
        # The best hypothesis keeps the order of its causes; other fits have the new one last.
        return [
            fitted.candidates[-1].cause.id == self.candidate.cause.id
            or fitted.candidates[-1].includes(self.candidate)
            or any(candidate.matches(self.candidate) for candidate in fitted.candidates)
            for fitted in self.tried
        ]

    def _chance(self, chosen: Sequence[bool]) -> float:
        return float(self.confidence[np.array(chosen)].sum())


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
        fits = _polished(problem, best, rest, fits)
        floor = _floor(problem, rescore(problem, without).evidence, fits)
        chances, alike = probabilities(floor, fits), _alike(best, fits)
        found.append(
            Alternatives(
                candidate=candidate,
                without=without,
                tried=fits,
                confidence=chances,
                evidence=np.array([f.evidence for f in fits]) - floor,
                own=rescore(problem, best).evidence - floor,
                alike=alike,
                equivalent=_equivalent(best, fits, chances, alike),
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
    confidence = probabilities(_floor(problem, 0.0, tried), tried)
    own, alike = float(evidence[0]), _alike(tried[0], tried)
    return (Alternatives(first, null_fit(problem), tried, confidence, evidence, own, alike, ()),)


def _floor(problem: Problem, without: float, fits: Sequence[Fit]) -> float:
    """Return the evidence without a cause in the place of the last one of fits [nats].

    Where a model is wrong by many noises, tolerances have no part in it.
    """
    return without if problem.noise_model.is_far else evidence_without(without, fits)


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


def _polished(
    problem: Problem, best: Fit, rest: Hypothesis, fits: Sequence[Fit]
) -> tuple[Fit, ...]:
    """Return fits, best first; those which are nearly as likely as the best one are fitted again.

    They begin with the other causes as these are in the best hypothesis. What the other causes are
    alone may be far from it: without damping, a delay is another one.
    """
    most = max(one.evidence for one in fits)
    behind = [i for i, one in enumerate(fits) if 1.0 < most - one.evidence < CLOSE]
    chosen = [i for i in behind if fits[i].hypothesis is not best.hypothesis][:POLISHED]
    starts = [[*rest, fits[i].hypothesis[-1]] for i in chosen]
    found = list(fits)
    again = run_together(problem.replayer, [fit_stepwise(problem, one) for one in starts])
    for i, one in zip(chosen, again, strict=True):
        found[i] = max(found[i], one, key=lambda each: each.evidence)
    return tuple(sorted(found, key=lambda one: -one.evidence))


def _alike(best: Fit, fits: Sequence[Fit]) -> tuple[bool, ...]:
    """Return which fits predict the same as the best hypothesis to within the noise."""
    return tuple(float(np.mean((fit.residual - best.residual) ** 2)) < NEAR for fit in fits)


def _equivalent(
    best: Fit, fits: Sequence[Fit], chances: Floats, alike: Sequence[bool]
) -> tuple[Candidate, ...]:
    """Return the last candidates of other fits that are alike and not unlikely."""
    return tuple(
        other.candidates[-1]
        for other, chance, same in zip(fits, chances, alike, strict=True)
        if same and chance >= CHANCE and other.hypothesis is not best.hypothesis
    )
