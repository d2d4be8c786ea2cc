"""The diagnosis: look at every suspect, search for the causes, weigh what remains, and say so."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause
from reality_gap.diagnosis import Diagnosis, NamedCause, Rival, Verdict, sentence
from reality_gap.inference.checkpoint import Shelf, digest
from reality_gap.inference.confidence import nameless
from reality_gap.inference.deferral import Waiting, parted
from reality_gap.inference.equivalence import Alternatives, alternatives
from reality_gap.inference.forward_selection import Search, search
from reality_gap.inference.group_fit import BETTER, explain, of_groups, power
from reality_gap.inference.held_out import score
from reality_gap.inference.intervals import intervals
from reality_gap.inference.likelihood import predictive
from reality_gap.inference.next_experiment import next_experiment
from reality_gap.inference.remainder import Remainder
from reality_gap.inference.screening import NO_SHELF, Sensitivity, screen, suspects, tolerances
from reality_gap.inference.traces import traces
from reality_gap.inference.verdict import Options, decide, weighed
from reality_gap.simulation.hypothesis import Suspect, acts_beside, build, same
from reality_gap.simulation.replayer import Workbench
from reality_gap.study.data import Study
from reality_gap.study.splits import REPORT, split

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]
Watch = Callable[[Workbench, Array, Sequence[Sensitivity]], None]
"""Sees the replays, the residual of the study's model (n,), and all sensitivities."""


FEW_WIRES = 20
"""With more, the search for single causes takes hours."""


def diagnose(
    study: Study,
    jobs: int = 1,
    progress: Progress = lambda share, what: None,
    causes: Sequence[Cause] | None = None,
    options: Options | None = None,
    watch: Watch = lambda bench, null, found: None,
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
    with Workbench(study, jobs) as bench:
        progress(0.0, "replaying the model")
        null = bench.residual([])
        catalogue = list(causes or CATALOGUE.values())
        whole = explain(bench, catalogue, null, options.many, lambda what: progress(0.01, what))
        if whole is not None and not _search_too(bench, options):
            return of_groups(bench, whole, null, begin)
        chosen = suspects(bench.system, catalogue)
        first, later = parted(bench.system, chosen)
        what = f"looking at {len(first)} suspects"
        progress(0.02, what)
        shelf = NO_SHELF if work is None else Shelf(work, digest(bench.system.study, first))
        found = screen(
            bench, first, [], null, shelf, lambda share: progress(0.02 + 0.58 * share, what)
        )
        watch(bench, null, found)
        judged, not_judged = _judge(chosen, first, found, options)
        progress(0.6, "fitting the likeliest")
        allowed = options.tolerance * tolerances(bench, found, null)
        waiting = Waiting(bench, null, later, options.visible)
        settings = options.search.for_log(study.duration)
        result = search(bench, judged, null, allowed, settings, waiting)
        progress(0.8, "weighing what remains")
        result, left = weighed(bench, result, null, settings, options)
        best = result.best
        after = null if best is None else best.residual
        if power(bench.measured, null) < options.many**2:
            whole = explain(
                bench, catalogue, after, options.large, lambda what: progress(0.9, what)
            )
        rest = power(bench.measured, after)
        if whole is not None and rest > max(options.large**2, whole.power / BETTER):
            return of_groups(bench, whole, null, begin)
        tried = score(bench.system.study, bench.measured, null, after)
        verdict = decide(result, left, tried.pays, options)
        certain = verdict is Verdict.NAMED
        # What has no name is not built into a model.
        built = after if certain else null
        scored = tried if certain else score(bench.system.study, bench.measured, null, null)
        rivals = alternatives(bench, result, settings, certain)
        doubt = None if best is None else nameless(best.evidence, left.instead.evidence)
        if doubt is not None:
            rivals = tuple(replace(r, confidence=(1.0 - doubt) * r.confidence) for r in rivals)
        named = _name(bench, result, rivals) if certain else ()
        progress(0.95, "choosing the next experiment")
        advice = None
        if certain and options.suggest:  # where no name holds, there is nobody to tell apart
            advice = next_experiment(bench, rivals, result.found, null, doubt or 0.0)
        parts = best.hypothesis if best is not None and certain else ()
        plant = bench.machine(parts) if parts else build(bench.system, [])
        beside = tuple(part for part in parts if acts_beside(bench.system, *part))
        diagnosis = Diagnosis(
            study=study.name,
            verdict=verdict,
            sentence="",
            causes=named,
            rivals=_rivals(result, rivals, null),
            nameless=doubt,
            rms_before=scored.before,
            rms_after=scored.after,
            noise_floor=scored.floor,
            gain=scored.gain,
            unexplained_fraction=tried.unexplained,
            explainable_fraction=_explainable(null, after, left, bench),
            depends_on=left.depends_on,
            next_experiment=advice,
            not_judged=not_judged,
            traces=traces(bench, null, built),
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


def _search_too(bench: Workbench, options: Options) -> bool:
    """Whether single causes are searched for, too, in a machine that groups explain."""
    few = len(bench.system.wires) <= FEW_WIRES
    return few if options.search_after_groups is None else options.search_after_groups


def _judge(
    chosen: Sequence[Suspect],
    first: Sequence[Suspect],
    found: Sequence[Sensitivity],
    options: Options,
) -> tuple[list[Sensitivity], tuple[tuple[str, str], ...]]:
    """Leave out whom this motion cannot show, and say why."""
    judged, size = list[Sensitivity](), dict[str, float]()
    for sensitivity in found:
        name = sensitivity.suspect.cause.id
        size[name] = max(size.get(name, 0.0), sensitivity.change)
        if sensitivity.change > options.visible:
            judged.append(sensitivity)
    reasons = []
    for name in dict.fromkeys(suspect.cause.id for suspect in first):
        if size.get(name, 0.0) <= options.visible:
            reasons.append(
                (name, "three typical faults would change the readings by less than their noise")
            )
    absent = [c for c in CATALOGUE if c not in {s.cause.id for s in chosen}]
    reasons += [(name, "the model or the log has nothing that it could act on") for name in absent]
    return judged, tuple(reasons)


def _name(
    bench: Workbench, result: Search, rivals: Sequence[Alternatives]
) -> tuple[NamedCause, ...]:
    """Causes of the best hypothesis with intervals, the one that explains most first."""
    assert result.best is not None
    estimates = intervals(bench, result.best, result.ruler.learn)
    named = list[tuple[float, NamedCause]]()
    for place, numbers in zip(rivals, estimates, strict=True):
        # The best hypothesis keeps its causes' order; others have the newcomer last.
        right = [
            f.suspects[-1].cause.id == place.suspect.cause.id
            or any(same(s, place.suspect) for s in f.suspects)
            for f in place.tried
        ]
        confidence = float(place.confidence[np.array(right)].sum())
        name = place.suspect.cause.id
        ids = dict.fromkeys(s.cause.id for s in place.equivalent if s.cause.id != name)
        elsewhere = tuple(s.place for s in place.equivalent if s.cause.id == name)
        cause = NamedCause(place.suspect, numbers, confidence, tuple(ids), elsewhere)
        named.append((place.own, cause))
    return tuple(cause for _, cause in sorted(named, key=lambda item: -item[0]))


def _rivals(result: Search, places: Sequence[Alternatives], null: Array) -> tuple[Rival, ...]:
    """Everybody who was fitted, by the cause whose place they were tried in."""
    listed = []
    for step, place in enumerate(places):
        for i, fitted in enumerate(place.tried):
            own = [j for j, s in enumerate(fitted.suspects) if same(s, place.suspect)]
            suspect, values = fitted.hypothesis[own[0] if own else -1]
            listed.append(
                Rival(
                    suspect=suspect,
                    values=dict(values),
                    score=predictive(result.ruler, null, fitted),
                    confidence=float(place.confidence[i]),
                    step=step,
                    chosen=bool(own),
                    evidence=float(place.evidence[i]),
                )
            )
    return tuple(listed)


def _refused(result: Search) -> float:
    """What the best of those who were not accepted would have added [nats]."""
    last = result.steps[-1] if result.steps else None
    if last is None or last.accepted:
        return 0.0
    return last.tried[0].evidence - (0.0 if last.base is None else last.base.evidence)


def _explainable(null: Array, after: Array, left: Remainder, bench: Workbench) -> float:
    """Share of the null's power above the noise that causes and the learned residual explain."""
    report = split(bench.measured) == REPORT
    learned = left.learned.prediction
    power = float(np.sum(null[report] ** 2)) - report.sum()
    rest = float(np.sum((after - learned)[report] ** 2)) - report.sum()
    return float(np.clip(1.0 - rest / power, 0.0, 1.0)) if power > 0 else 0.0
