"""Outcome of a search for single causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reality_gap.diagnosis import (
    Criterion,
    Doubt,
    Experiment,
    FittedCandidate,
    NamedCause,
    Rejected,
    Share,
    Verdict,
)
from reality_gap.inference.confidence import doubt_of_partial, unmodelled
from reality_gap.inference.doubts import UNKNOWN, all_doubts, doubts_of_partial, lowered
from reality_gap.inference.equivalence import Alternatives
from reality_gap.inference.forward_selection import Search
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.held_out import Score, score, selection_score, share_left
from reality_gap.inference.intervals import intervals
from reality_gap.inference.log_values import compare_logs
from reality_gap.inference.next_experiment import next_experiment
from reality_gap.inference.outcome import Outcome
from reality_gap.inference.paying import NO_GAIN, Paying, beside_dropped, held_out_criteria
from reality_gap.inference.posteriors import search_branches
from reality_gap.inference.problem import Problem
from reality_gap.inference.remainder import Remainder
from reality_gap.inference.support import Supported
from reality_gap.inference.verdict import Options, decide, judge
from reality_gap.inference.waterfall import waterfall
from reality_gap.study.splits import REPORT, split
from reality_gap.study.system import measures_forces
from reality_gap.types import Bools, Floats


def search_outcome(
    supported: Supported, not_judged: tuple[tuple[str, str], ...], options: Options
) -> Outcome:
    """Decide on the verdict of a search, and collect what supports it.

    Causes that are not named are not built into a model.

    Args:
        supported: the causes that are named, unless what they leave refutes them.
        not_judged: ids of causes that were not judged, each with the reason.
        options: thresholds.
    """
    paying, remainder, found, support = supported
    judged = judge(paying, remainder, options)
    verdict = decide(paying, judged)
    named = verdict.has_names
    result = paying.result if named else replace(paying.result, best=paying.attempt)
    problem, best = result.problem, result.best
    study, measured = problem.system.study, problem.measured
    without = problem.replayer.without_expansion
    null, after = without([], problem.null_residual), without(best.hypothesis, best.residual)
    tried = score(study, measured, null, after)
    shown = best.is_null or (paying.tested if named else paying.attempted).total.is_shown
    doubt = None if best.is_null else _doubt(best, remainder, verdict)
    doubts: list[tuple[Doubt, ...]] = [(Doubt(UNKNOWN, doubt or 0.0),)] * len(found)
    if verdict is Verdict.PARTLY_NAMED:
        doubts = doubts_of_partial(paying, doubt or 0.0, judged)
    fitted = tuple(lowered(one, own) for one, own in zip(found, doubts, strict=True))
    scored = tried if named else score(study, measured, null, null)
    use = (split(measured) == REPORT) | (not shown)
    unexplained = (tried if shown else score(study, measured, null, after, use)).unexplained
    if verdict is Verdict.NOTHING_WRONG:
        unexplained = _left_by_tolerances(scored, remainder)
    explainable = _explainable(problem, best.residual, remainder, use)
    causes = _named_causes(paying, fitted, doubts) if named else ()
    # The report split says nothing of an event between two of its blocks.
    steps = _waterfall(paying, causes, scored) if named and shown else ()
    return Outcome(
        verdict=verdict,
        hypothesis=best.hypothesis if named else [],
        residual=after if named else null,
        score=scored,
        causes=_with_shares(causes, steps),
        fitted_candidates=_fitted_candidates(problem, fitted),
        gain=scored.gain if tried.improvement.low > 0.0 or not named else None,
        unexplained_fraction=unexplained,
        explainable_fraction=max(explainable, 1.0 - unexplained),
        depends_on=remainder.depends_on,
        not_judged=not_judged,
        measures=_measures(paying, remainder),
        unmodelled=doubt,
        objection=next((one.objection for one in judged if not one.met), None),
        likelihood_gain=paying.tested.total.folds if named else None,
        next_experiment=_advice(result, fitted, doubt) if named and options.suggest else None,
        criteria=(*_search_criteria(result), *held_out_criteria(paying), *support, *judged),
        waterfall=steps,
        rejected=_rejected(paying, judged, named),
        branches=search_branches(problem, best, found) if named else (),
    )


def _waterfall(paying: Paying, causes: Sequence[NamedCause], scored: Score) -> tuple[Share, ...]:
    order = [cause.candidate for cause in causes]
    return waterfall(paying.result, paying.tested, order, scored.before, scored.floor)


def _with_shares(causes: Sequence[NamedCause], steps: Sequence[Share]) -> tuple[NamedCause, ...]:
    """Return causes with their steps of the waterfall, if there is one; the first is no cause's."""
    if not steps:
        return tuple(causes)
    return tuple(replace(one, share=step) for one, step in zip(causes, steps[1:], strict=True))


def _rejected(paying: Paying, judged: Sequence[Criterion], named: bool) -> tuple[Rejected, ...]:
    """Return the causes of the best attempt that are not named, each with the reason."""
    found = [
        Rejected(one, values, reason, gains.folds) for one, values, gains, reason in paying.dropped
    ]
    if named:
        return tuple(found)
    reason = next((one.objection for one in judged if not one.met), NO_GAIN)
    rest = zip(paying.result.best.hypothesis, paying.tested.each, strict=True)
    refuted = [Rejected(one, dict(values), reason, gains.folds) for (one, values), gains in rest]
    return (*refuted, *found)


def _search_criteria(result: Search) -> tuple[Criterion, ...]:
    """Return the criteria by which the search accepted its causes."""
    text = "explains no more than chance would"
    return tuple(
        Criterion(f"evidence_{i + 1}", step.gain, step.needed, step.accepted, text)
        for i, step in enumerate(result.steps)
    )


def _doubt(best: Fit, remainder: Remainder, verdict: Verdict) -> float:
    """Return the probability that unknown causes have the effect of the best causes."""
    named, instead = best.evidence, remainder.instead.evidence
    if verdict is Verdict.PARTLY_NAMED:
        return doubt_of_partial(named, remainder.learned.evidence, instead)
    return unmodelled(named, instead)


def _advice(
    result: Search, fitted: Sequence[Alternatives], doubt: float | None
) -> Experiment | None:
    return next_experiment(result.problem, fitted, result.sensitivities, doubt or 0.0)


def _named_causes(
    paying: Paying, fitted: Sequence[Alternatives], doubts: Sequence[Sequence[Doubt]]
) -> tuple[NamedCause, ...]:
    """Return the causes with intervals, the one that explains most first."""
    problem, best = paying.result.problem, paying.result.best
    estimates = beside_dropped(intervals(problem, best), paying)
    logs = compare_logs(problem, best)
    named = list[tuple[float, NamedCause]]()
    parts = zip(fitted, estimates, paying.tested.each, logs, doubts, strict=True)
    for one, parameters, gains, compared, own in parts:
        name = one.candidate.cause.id
        ids = dict.fromkeys(s.cause.id for s in one.equivalent if s.cause.id != name)
        others = dict.fromkeys(s.location for s in one.equivalent if s.cause.id == name)
        cause = NamedCause(
            candidate=one.candidate,
            parameters=parameters,
            confidence=one.right,
            equivalent=tuple(ids),
            elsewhere=tuple(others),
            gain=gains.folds,
            logs=compared,
            doubts=all_doubts(one, own),
        )
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


def _measures(paying: Paying, remainder: Remainder) -> dict[str, float]:
    """Return numbers of the search and of the remainder."""
    result, tested = paying.result, paying.attempted
    return {
        "evidence": result.best.evidence,
        "causes": float(len(result.best.hypothesis)),
        "own_time_step": float(result.problem.replayer.own_step),
        "time_step": result.problem.replayer.step,
        "forces_measured": float(measures_forces(result.problem.system)),
        "first": result.steps[0].tried[0].evidence if result.steps else 0.0,
        "refused": _refused(result),
        "learned": float(remainder.learned.evidence),
        "instead": float(remainder.instead.evidence),
        "left_before": remainder.before,
        "deviation": remainder.deviation,
        "left": remainder.after,
        "attempt": paying.attempt.evidence,
        "attempt_causes": float(len(paying.attempt.hypothesis)),
        "attempt_folds_gain": tested.total.folds.value,
        "attempt_folds_gain_low": tested.total.folds.low,
        "attempt_report_gain": tested.total.report.value,
        "attempt_rms_gain_high": tested.improvement.high,
    }


def _refused(result: Search) -> float:
    """Return what the best candidate that was not accepted would have added [nats]."""
    last = result.steps[-1] if result.steps else None
    if last is None or last.accepted:
        return 0.0
    return last.gain


def _left_by_tolerances(scored: Score, remainder: Remainder) -> float:
    """Return the share of the power above the noise that deviations within tolerances leave."""
    if scored.gain is None:  # the error may be noise alone
        return 0.0
    return share_left(scored.before, remainder.before, scored.floor)


def _explainable(problem: Problem, residual: Floats, remainder: Remainder, use: Bools) -> float:
    """Return the share of the power above the noise that causes and learned residual explain.

    Args:
        problem: what is explained.
        residual: what the causes leave, shape (n,).
        remainder: what is learned of that.
        use: by which readings, shape (n,).
    """
    left = residual - remainder.learned.prediction
    power = float(np.sum(problem.null_residual[use] ** 2)) - use.sum()
    rest = float(np.sum(left[use] ** 2)) - use.sum()
    return float(np.clip(1.0 - rest / power, 0.0, 1.0)) if power > 0 else 0.0
