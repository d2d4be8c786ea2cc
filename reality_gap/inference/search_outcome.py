"""Outcome of a search for single causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reality_gap.diagnosis import Experiment, FittedCandidate, NamedCause, Verdict
from reality_gap.inference.confidence import unmodelled
from reality_gap.inference.equivalence import Alternatives, alternatives
from reality_gap.inference.forward_selection import Search
from reality_gap.inference.held_out import likelihood_gain, pays, score, selection_score
from reality_gap.inference.intervals import intervals
from reality_gap.inference.next_experiment import next_experiment
from reality_gap.inference.outcome import Outcome
from reality_gap.inference.problem import Problem
from reality_gap.inference.remainder import Remainder
from reality_gap.inference.verdict import Options, decide, objection
from reality_gap.study.splits import REPORT, split
from reality_gap.types import Floats


def search_outcome(
    result: Search,
    remainder: Remainder,
    not_judged: tuple[tuple[str, str], ...],
    options: Options,
) -> Outcome:
    """Decide on the verdict of a search, and collect what supports it.

    Causes that are not named are not built into a model.

    Args:
        result: the causes that were found.
        remainder: what they leave.
        not_judged: ids of causes that were not judged, each with the reason.
        options: thresholds.
    """
    problem, best = result.problem, result.best
    study, measured, null = problem.system.study, problem.measured, problem.null_residual
    tried = score(study, measured, null, best.residual)
    likelihood = likelihood_gain(problem, best.residual)
    paying = pays(tried.improvement, likelihood)
    verdict = decide(result, remainder, paying, options)
    named = verdict is Verdict.NAMED
    doubt = None if best.is_null else unmodelled(best.evidence, remainder.instead.evidence)
    fitted = tuple(
        replace(one, confidence=(1.0 - (doubt or 0.0)) * one.confidence)
        for one in alternatives(result, options.search, named)
    )
    scored = tried if named else score(study, measured, null, null)
    return Outcome(
        verdict=verdict,
        hypothesis=best.hypothesis if named else [],
        residual=best.residual if named else null,
        score=scored,
        causes=_named_causes(result, fitted) if named else (),
        fitted_candidates=_fitted_candidates(problem, fitted),
        gain=scored.gain if tried.improvement.low > 0.0 or not named else None,
        unexplained_fraction=tried.unexplained,
        explainable_fraction=_explainable_fraction(problem, best.residual, remainder),
        depends_on=remainder.depends_on,
        not_judged=not_judged,
        measures=_measures(result, remainder),
        unmodelled=doubt,
        objection=objection(result, remainder, paying, options),
        likelihood_gain=likelihood if named else None,
        next_experiment=_advice(result, fitted, doubt or 0.0)
        if named and options.suggest
        else None,
    )


def _advice(result: Search, fitted: Sequence[Alternatives], doubt: float) -> Experiment | None:
    return next_experiment(result.problem, fitted, result.sensitivities, doubt)


def _named_causes(result: Search, fitted: Sequence[Alternatives]) -> tuple[NamedCause, ...]:
    """Return the causes with intervals, the one that explains most first."""
    estimates = intervals(result.problem, result.best)
    named = list[tuple[float, NamedCause]]()
    for one, parameters in zip(fitted, estimates, strict=True):
        # The best hypothesis keeps the order of its causes; other fits have the new one last.
        right = [
            fit.candidates[-1].cause.id == one.candidate.cause.id
            or any(candidate.matches(one.candidate) for candidate in fit.candidates)
            for fit in one.tried
        ]
        confidence = float(one.confidence[np.array(right)].sum())
        name = one.candidate.cause.id
        ids = dict.fromkeys(s.cause.id for s in one.equivalent if s.cause.id != name)
        elsewhere = tuple(s.location for s in one.equivalent if s.cause.id == name)
        cause = NamedCause(one.candidate, parameters, confidence, tuple(ids), elsewhere)
        named.append((one.own, cause))
    return tuple(cause for _, cause in sorted(named, key=lambda item: -item[0]))


def _fitted_candidates(
    problem: Problem, fitted: Sequence[Alternatives]
) -> tuple[FittedCandidate, ...]:
    """Return all fitted candidates, ordered by the cause in whose place they were tried."""
    listed = []
    for step, one in enumerate(fitted):
        for i, fit in enumerate(one.tried):
            own = [j for j, s in enumerate(fit.candidates) if s.matches(one.candidate)]
            candidate, values = fit.hypothesis[own[0] if own else -1]
            listed.append(
                FittedCandidate(
                    candidate=candidate,
                    values=dict(values),
                    score=selection_score(problem, fit),
                    confidence=float(one.confidence[i]),
                    step=step,
                    chosen=bool(own),
                    evidence=float(one.evidence[i]),
                )
            )
    return tuple(listed)


def _measures(result: Search, remainder: Remainder) -> dict[str, float]:
    """Return the numbers on which the verdict was decided."""
    return {
        "evidence": result.best.evidence,
        "causes": float(len(result.best.hypothesis)),
        "first": result.steps[0].tried[0].evidence if result.steps else 0.0,
        "refused": _refused(result),
        "learned": remainder.learned.evidence,
        "instead": remainder.instead.evidence,
    }


def _refused(result: Search) -> float:
    """Return what the best candidate that was not accepted would have added [nats]."""
    last = result.steps[-1] if result.steps else None
    if last is None or last.accepted:
        return 0.0
    return last.tried[0].evidence - last.base.evidence


def _explainable_fraction(problem: Problem, residual: Floats, remainder: Remainder) -> float:
    """Return the share of the power above the noise that causes and learned residual explain."""
    report = split(problem.measured) == REPORT
    left = residual - remainder.learned.prediction
    power = float(np.sum(problem.null_residual[report] ** 2)) - report.sum()
    rest = float(np.sum(left[report] ** 2)) - report.sum()
    return float(np.clip(1.0 - rest / power, 0.0, 1.0)) if power > 0 else 0.0
