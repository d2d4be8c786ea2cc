"""The diagnosis: look at every suspect, search for the causes, weigh what remains, and say so."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause
from reality_gap.diagnosis import Diagnosis, FittedCandidate, NamedCause, Verdict, sentence
from reality_gap.inference.checkpoint import Checkpoint, digest
from reality_gap.inference.confidence import unmodelled
from reality_gap.inference.deferral import Waiting, parted
from reality_gap.inference.equivalence import Alternatives, alternatives
from reality_gap.inference.forward_selection import Search, search
from reality_gap.inference.group_fit import BETTER, explain, of_groups, power
from reality_gap.inference.held_out import likelihood_gain, pays, score
from reality_gap.inference.intervals import intervals
from reality_gap.inference.likelihood import predictive
from reality_gap.inference.next_experiment import next_experiment
from reality_gap.inference.remainder import Remainder
from reality_gap.inference.screening import (
    NO_CHECKPOINT,
    Sensitivity,
    candidates,
    screen,
    tolerances,
)
from reality_gap.inference.traces import traces
from reality_gap.inference.verdict import Options, decide, weighed
from reality_gap.simulation.hypothesis import Candidate, acts_beside, build, same
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.study.splits import REPORT, split
from reality_gap.types import Floats

Progress = Callable[[float, str], None]
Watch = Callable[[Replayer, Floats, Sequence[Sensitivity]], None]
"""Sees the replays, the residual of the study's model (n,), and all sensitivities."""


FEW_TENDONS = 20
"""With more, the search for single causes takes hours."""


def diagnose(
    study: Study,
    jobs: int = 1,
    progress: Progress = lambda share, what: None,
    causes: Sequence[Cause] | None = None,
    options: Options | None = None,
    watch: Watch = lambda replayer, null, found: None,
    work: Path | None = None,
) -> Diagnosis:
    """Find out what a study's model gets wrong.

    Args:
        study: model and measurements; see `reality_gap.load_study`.
        jobs: number of processes.
        progress: called with the share done, 0 to 1, and what is being done.
        causes: the catalogue by default.
        options: thresholds.
        watch: called once all suspects were looked at; for whoever compares.
        work: a folder of its own, in which an interrupted diagnosis finds what it had done; to be
            removed by `reality_gap.inference.checkpoint.forget`.

    Returns:
        Diagnosis: verdict, causes, evidence and the extended model.
    """
    begin = time.monotonic()
    options = Options() if options is None else options
    with Replayer(study, jobs) as replayer:
        progress(0.0, "replaying the model")
        null = replayer.residual([])
        catalogue = list(causes or CATALOGUE.values())
        whole = explain(replayer, catalogue, null, options.many, lambda what: progress(0.01, what))
        if whole is not None and not _search_too(replayer, options):
            return of_groups(replayer, whole, null, begin)
        chosen = candidates(replayer.system, catalogue)
        first, later = parted(replayer.system, chosen)
        what = f"looking at {len(first)} suspects"
        progress(0.02, what)
        checkpoint = (
            NO_CHECKPOINT
            if work is None
            else Checkpoint(work, digest(replayer.system.study, first))
        )
        found = screen(
            replayer, first, [], null, checkpoint, lambda share: progress(0.02 + 0.58 * share, what)
        )
        watch(replayer, null, found)
        judged, not_judged = _judge(chosen, first, found, options)
        progress(0.6, "fitting the likeliest")
        allowed = options.tolerance * tolerances(replayer, found, null)
        waiting = Waiting(replayer, null, later, options.visible)
        settings = options.search.for_log(study.duration)
        result = search(replayer, judged, null, allowed, settings, waiting)
        progress(0.8, "weighing what remains")
        result, left = weighed(replayer, result, null, settings, options)
        best = result.best
        after = null if best is None else best.residual
        if power(replayer.measured, null) < options.many**2:
            whole = explain(
                replayer, catalogue, after, options.large, lambda what: progress(0.9, what)
            )
        rest = power(replayer.measured, after)
        if whole is not None and rest > max(options.large**2, whole.power / BETTER):
            return of_groups(replayer, whole, null, begin)
        tried = score(replayer.system.study, replayer.measured, null, after)
        likelihood = likelihood_gain(result.noise_model, after)
        verdict = decide(result, left, pays(tried.improvement, likelihood), options)
        certain = verdict is Verdict.NAMED
        # What has no name is not built into a model.
        built = after if certain else null
        scored = tried if certain else score(replayer.system.study, replayer.measured, null, null)
        fitted_candidates = alternatives(replayer, result, settings, certain)
        doubt = None if best is None else unmodelled(best.evidence, left.instead.evidence)
        if doubt is not None:
            fitted_candidates = tuple(
                replace(r, confidence=(1.0 - doubt) * r.confidence) for r in fitted_candidates
            )
        named = _name(replayer, result, fitted_candidates) if certain else ()
        progress(0.95, "choosing the next experiment")
        advice = None
        if certain and options.suggest:  # where no name holds, there is nobody to tell apart
            advice = next_experiment(replayer, fitted_candidates, result.found, null, doubt or 0.0)
        parts = best.hypothesis if best is not None and certain else ()
        plant = replayer.machine(parts) if parts else build(replayer.system, [])
        beside = tuple(part for part in parts if acts_beside(replayer.system, *part))
        diagnosis = Diagnosis(
            study=study.name,
            verdict=verdict,
            sentence="",
            causes=named,
            fitted_candidates=_fitted_candidates(result, fitted_candidates, null),
            unmodelled=doubt,
            likelihood_gain=likelihood if certain else None,
            rms_before=scored.before,
            rms_after=scored.after,
            noise_floor=scored.floor,
            gain=scored.gain if tried.improvement.low > 0.0 or not certain else None,
            unexplained_fraction=tried.unexplained,
            explainable_fraction=_explainable(null, after, left, replayer),
            depends_on=left.depends_on,
            next_experiment=advice,
            not_judged=not_judged,
            traces=traces(replayer, null, built),
            effects=beside,
            extended_xml=plant.spec.to_xml(),
            seconds=time.monotonic() - begin,
            measures={
                "evidence": 0.0 if best is None else best.evidence,
                "causes": float(len(best.hypothesis)) if best else 0.0,
                "first": result.steps[0].tried[0].evidence if result.steps else 0.0,
                "refused": _refused(result),
                "learned": left.learned.evidence,
                "instead": left.instead.evidence,
            },
        )
    progress(1.0, "done")
    return replace(diagnosis, sentence=sentence(diagnosis))


def _search_too(replayer: Replayer, options: Options) -> bool:
    """Whether single causes are searched for, too, in a machine that groups explain."""
    few = len(replayer.system.tendons) <= FEW_TENDONS
    return few if options.search_after_groups is None else options.search_after_groups


def _judge(
    chosen: Sequence[Candidate],
    first: Sequence[Candidate],
    found: Sequence[Sensitivity],
    options: Options,
) -> tuple[list[Sensitivity], tuple[tuple[str, str], ...]]:
    """Leave out whom this motion cannot show, and say why."""
    judged, size = list[Sensitivity](), dict[str, float]()
    for sensitivity in found:
        name = sensitivity.candidate.cause.id
        size[name] = max(size.get(name, 0.0), sensitivity.change)
        if sensitivity.change > options.visible:
            judged.append(sensitivity)
    reasons = []
    for name in dict.fromkeys(candidate.cause.id for candidate in first):
        if size.get(name, 0.0) <= options.visible:
            reasons.append(
                (name, "three typical faults would change the readings by less than their noise")
            )
    absent = [c for c in CATALOGUE if c not in {s.cause.id for s in chosen}]
    reasons += [(name, "the model or the log has nothing that it could act on") for name in absent]
    return judged, tuple(reasons)


def _name(
    replayer: Replayer, result: Search, fitted_candidates: Sequence[Alternatives]
) -> tuple[NamedCause, ...]:
    """Causes of the best hypothesis with intervals, the one that explains most first."""
    assert result.best is not None
    estimates = intervals(replayer, result.best, result.noise_model.learn)
    named = list[tuple[float, NamedCause]]()
    for location, numbers in zip(fitted_candidates, estimates, strict=True):
        # The best hypothesis keeps its causes' order; others have the newcomer last.
        right = [
            f.candidates[-1].cause.id == location.candidate.cause.id
            or any(same(s, location.candidate) for s in f.candidates)
            for f in location.tried
        ]
        confidence = float(location.confidence[np.array(right)].sum())
        name = location.candidate.cause.id
        ids = dict.fromkeys(s.cause.id for s in location.equivalent if s.cause.id != name)
        elsewhere = tuple(s.location for s in location.equivalent if s.cause.id == name)
        cause = NamedCause(location.candidate, numbers, confidence, tuple(ids), elsewhere)
        named.append((location.own, cause))
    return tuple(cause for _, cause in sorted(named, key=lambda item: -item[0]))


def _fitted_candidates(
    result: Search, locations: Sequence[Alternatives], null: Floats
) -> tuple[FittedCandidate, ...]:
    """Everybody who was fitted, by the cause whose place they were tried in."""
    listed = []
    for step, location in enumerate(locations):
        for i, fitted in enumerate(location.tried):
            own = [j for j, s in enumerate(fitted.candidates) if same(s, location.candidate)]
            candidate, values = fitted.hypothesis[own[0] if own else -1]
            listed.append(
                FittedCandidate(
                    candidate=candidate,
                    values=dict(values),
                    score=predictive(result.noise_model, null, fitted),
                    confidence=float(location.confidence[i]),
                    step=step,
                    chosen=bool(own),
                    evidence=float(location.evidence[i]),
                )
            )
    return tuple(listed)


def _refused(result: Search) -> float:
    """What the best of those who were not accepted would have added [nats]."""
    last = result.steps[-1] if result.steps else None
    if last is None or last.accepted:
        return 0.0
    return last.tried[0].evidence - (0.0 if last.base is None else last.base.evidence)


def _explainable(null: Floats, after: Floats, left: Remainder, replayer: Replayer) -> float:
    """Share of the null's power above the noise that causes and the learned residual explain."""
    report = split(replayer.measured) == REPORT
    learned = left.learned.prediction
    power = float(np.sum(null[report] ** 2)) - report.sum()
    rest = float(np.sum((after - learned)[report] ** 2)) - report.sum()
    return float(np.clip(1.0 - rest / power, 0.0, 1.0)) if power > 0 else 0.0
