"""Pipeline: from a study to a diagnosis.

The candidates are screened, a search adds causes one by one, and what they leave is evaluated. A
machine whose model is slightly wrong everywhere is explained by groups of causes instead.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause
from reality_gap.diagnosis import Diagnosis, Verdict
from reality_gap.errors import TimeLimitError
from reality_gap.inference.calibration import calibrate
from reality_gap.inference.checkpoint import Checkpoint, digest
from reality_gap.inference.deferral import Deferred, split_deferred
from reality_gap.inference.effort_times import (
    diagnosis_of_earlier,
    half_sample_late,
    with_efforts_earlier,
)
from reality_gap.inference.expansion import Expanded, expand, handicaps, is_noise, is_small
from reality_gap.inference.flat_directions import flat_directions
from reality_gap.inference.forward_selection import Search
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.group_fit import BETTER, GroupFit, fit_groups, power
from reality_gap.inference.likelihood import FAR
from reality_gap.inference.log_candidates import in_each_log
from reality_gap.inference.outcome import Outcome, groups_outcome
from reality_gap.inference.own_step import settle_step
from reality_gap.inference.paying import Paying
from reality_gap.inference.posteriors import tolerance_branch
from reality_gap.inference.remainder import Remainder
from reality_gap.inference.rough_search import search_roughly
from reality_gap.inference.screening import NO_CHECKPOINT, Sensitivity, list_candidates, screen
from reality_gap.inference.search_outcome import search_outcome
from reality_gap.inference.support import keep_supported
from reality_gap.inference.tolerances import (
    Tolerance,
    list_tolerances,
    tolerance_columns,
)
from reality_gap.inference.traces import traces
from reality_gap.inference.verdict import Options, revise_and_evaluate
from reality_gap.posterior import Posterior
from reality_gap.report.sentence import sentence
from reality_gap.simulation.hypothesis import Candidate, build, has_effects
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.study.splits import SELECT, split
from reality_gap.types import Floats

Progress = Callable[[float, str], None]
"""Called with the completed share, 0 to 1, and with what is being done."""
Watch = Callable[[Replayer, Floats, Sequence[Sensitivity]], None]
"""Called with the replayer, the residual of the nominal model (n,), and all sensitivities."""

MOST_BESIDE = 2
"""Largest number of causes beside which readings are linearised."""
FEW_TENDONS = 20
"""Number of tendons up to which single causes are searched for, too, if groups explain the log."""
INVISIBLE = "neither typical nor large faults would change the readings by more than their noise"
ABSENT = "neither the model nor the log has elements on which it acts"


def diagnose(
    study: Study,
    jobs: int = 1,
    progress: Progress = lambda share, text: None,
    causes: Sequence[Cause] | None = None,
    options: Options | None = None,
    watch: Watch = lambda replayer, null_residual, sensitivities: None,
    work: Path | None = None,
) -> Diagnosis:
    """Find out what a study's model gets wrong.

    Args:
        study: model and measurements; see `reality_gap.load_study`.
        jobs: number of processes.
        progress: called with the completed share, 0 to 1, and with what is being done.
        causes: causes to consider; the catalogue by default.
        options: thresholds.
        watch: called after screening, for comparison with other methods.
        work: folder of checkpoints, with which an interrupted diagnosis continues; remove it by
            `reality_gap.inference.checkpoint.forget`.

    Returns:
        The verdict, the causes, their evidence and the extended model.

    Raises:
        TimeLimitError: there is no verdict within the limit of time.
    """
    options = options or Options()
    options = replace(options, search=options.search.for_log(study.duration))
    begin, chosen = time.monotonic(), list(causes or CATALOGUE.values())
    task = _Task(jobs, progress, chosen, options, watch, work, begin)
    found = task.diagnose(study)
    late = half_sample_late(study, found)
    if late:
        progress(0.0, "comparing the efforts with the motion half a sample away")
        # The checkpoints of the first search stay, so that it is resumed.
        again = replace(task, work=None).diagnose(with_efforts_earlier(study, late))
        found = diagnosis_of_earlier(again, late)
    progress(1.0, "done")
    return found


@dataclass
class _Task:
    """How studies are diagnosed; the attributes are those of `diagnose`, and when it began [s]."""

    jobs: int
    progress: Progress
    causes: Sequence[Cause]
    options: Options
    watch: Watch
    work: Path | None
    begin: float

    def diagnose(self, study: Study) -> Diagnosis:
        """Find out what a study's model gets wrong."""
        doing = "preparing the study"

        def show(share: float, text: str) -> None:
            nonlocal doing
            doing = text
            self.progress(share, text)

        def tick() -> None:
            if time.monotonic() - self.begin > self.options.time_limit:
                raise TimeLimitError(self.options.time_limit, doing)

        with Replayer(study, self.jobs, tick) as replayer:
            show(0.0, "replaying the nominal model")
            null = replayer.residual([])
            run = _Run(replayer, null, self.causes, self.options, show)
            groups = run.fit_groups(null, self.options.many, 0.01)
            if groups is None or run.searches_too():
                outcome = run.search(groups, self.watch, self.work)
            else:
                outcome = groups_outcome(replayer, null, groups, self.options.left)
            return _build(replayer, run.null_residual, outcome, self.begin)


@dataclass(frozen=True)
class _Screened:
    """Result of screening.

    Attributes:
        sensitivities: of all candidates that are not deferred.
        judged: those that this motion shows.
        deferred: the deferred candidates.
        not_judged: ids of causes that this study does not show, each with the reason.
    """

    sensitivities: tuple[Sensitivity, ...]
    judged: tuple[Sensitivity, ...]
    deferred: tuple[Candidate, ...]
    not_judged: tuple[tuple[str, str], ...]


@dataclass
class _Run:
    """One diagnosis.

    Attributes:
        replayer: replays of the study.
        null_residual: residual of the nominal model in units of sensor noise, shape (n,); it
            changes if the log turns out to have the model's own time step.
        causes: causes to consider.
        options: thresholds, for a log of this length.
        progress: called with the completed share and with what is being done.
    """

    replayer: Replayer
    null_residual: Floats
    causes: Sequence[Cause]
    options: Options
    progress: Progress

    def searches_too(self) -> bool:
        """Return whether single causes are searched for, too, if groups explain the log."""
        too = self.options.search_after_groups
        return len(self.replayer.system.tendons) <= FEW_TENDONS if too is None else too

    def fit_groups(self, best: Floats, large: float, share: float) -> GroupFit | None:
        """Fit groups of causes if the RMS of the residual ``best`` (n,) is at least ``large``."""
        return fit_groups(self.replayer, self.causes, best, large, partial(self.progress, share))

    def search(self, groups: GroupFit | None, watch: Watch, work: Path | None) -> Outcome:
        """Search for single causes; return the outcome of groups where these are much better."""
        replayer, options = self.replayer, self.options
        screened = self._screen(work)
        watch(replayer, self.null_residual, screened.sensitivities)
        paying, remainder, tolerances = self._search(screened)
        null = self.null_residual
        after = paying.attempt.residual
        if power(replayer.measured, null) < options.many**2:
            groups = self.fit_groups(after, options.large, 0.9)
        rest = power(replayer.measured, after)
        if groups is not None and rest > max(options.large**2, groups.power / BETTER):
            return groups_outcome(replayer, null, groups, options.left)
        self.progress(0.92, "comparing alternatives and choosing the next experiment")
        supported = keep_supported(paying, remainder, options)
        outcome = search_outcome(supported, screened.not_judged, options)
        if outcome.verdict is Verdict.NOTHING_WRONG:
            outcome = replace(outcome, branches=(tolerance_branch(tolerances),))
        else:
            found = supported.paying.result
            calibration = calibrate(found.problem, outcome.hypothesis, tolerances, found.joint)
            outcome = replace(outcome, calibration=calibration)
        if not options.suggest:
            return outcome
        named = [one for one, _ in outcome.hypothesis]
        problem, screens = paying.result.problem, screened.sensitivities
        flat = flat_directions(problem, screens, options.visible, named)
        return replace(outcome, flat=flat)

    def _screen(self, work: Path | None) -> _Screened:
        """Screen all candidates that are not deferred."""
        system = self.replayer.system
        candidates = list_candidates(system, self.causes)
        first, deferred = split_deferred(system, candidates)
        text = f"screening {len(first)} candidates"
        checkpoint = NO_CHECKPOINT
        if work is not None:
            checkpoint = Checkpoint(work, digest(system.study, first))

        def tick(share: float) -> None:
            self.progress(0.02 + 0.58 * share, text)

        tick(0.0)
        found = screen(self.replayer, first, self.null_residual, checkpoint, tick)
        found += in_each_log(system.study, self.replayer.measured, found)
        judged = tuple(one for one in found if one.largest_change > self.options.visible)
        return _Screened(found, judged, deferred, _not_judged(candidates, first, judged))

    def _search(self, screened: _Screened) -> tuple[Paying, Remainder, list[Tolerance]]:
        """Search for single causes, and evaluate what they leave, beside which tolerances."""
        replayer, null, options = self.replayer, self.null_residual, self.options
        self.progress(0.6, "fitting the likeliest candidates")
        tolerances = list(list_tolerances(screened.sensitivities, options.tolerance))
        columns = tolerance_columns(replayer, tolerances, null)
        result = self._search_with(tolerances, columns, null, screened)
        if result.stop is None and settle_step(result):
            self.null_residual = null = replayer.residual([])
            columns = tolerance_columns(replayer, tolerances, null)
            result = self._search_with(tolerances, columns, null, screened, result.singles)
        if not result.relinearised and not is_small(replayer, columns, result.best.residual):
            self.progress(0.7, "linearising about the likeliest deviations")
            own, likeliest, suits = self._expand(tolerances, columns, result)
            if likeliest.expansion.parts and suits:
                replayer.expansion = likeliest.expansion
                null = replayer.residual([])
                more = handicaps(result.problem, own, likeliest, null)
                result = self._search_with(
                    tolerances, likeliest.columns, null, screened, result.singles, more
                )
        self.progress(0.8, "evaluating what remains")
        return *revise_and_evaluate(result, options), tolerances

    def _search_with(
        self,
        tolerances: Sequence[Tolerance],
        columns: Floats,
        null: Floats,
        screened: _Screened,
        known: Sequence[Fit] = (),
        more: tuple[float, float] = (0.0, 0.0),
    ) -> Search:
        """Search for causes of the nominal residual (n,), with columns of tolerances (n, p).

        The first cause needs ``more`` evidence than usual; see `handicaps`.
        """
        replayer, options = self.replayer, self.options
        deferred = Deferred(replayer, null, screened.deferred, options.visible)
        return search_roughly(
            replayer,
            null,
            tolerances,
            columns,
            screened.judged,
            options.search,
            deferred,
            known,
            more,
        )

    def _expand(
        self, tolerances: Sequence[Tolerance], columns: Floats, result: Search
    ) -> tuple[Expanded, Expanded, bool]:
        """Linearise about the likeliest deviations, with as many of the causes as are needed.

        Returns:
            The linearisation without causes, the likeliest one, and whether to search again there.
            Where the search ended with a stop, this is so if noise is left: what is not linear in
            deviations looked like a stop.
        """
        replayer, best = self.replayer, result.best
        own = found = expand(replayer, tolerances, columns, [], self.null_residual)
        count = np.count_nonzero(split(replayer.measured) <= SELECT)
        for i in range(1, min(len(best.hypothesis), MOST_BESIDE) + 1):
            first = best.hypothesis[:i]
            residual = replayer.residual(first)
            beside = expand(replayer, tolerances, columns, first, residual)
            if 0.5 * count * (found.power - beside.power) > self.options.search.threshold:
                found = beside
        if result.stop is not None:
            return own, found, is_noise(replayer, found.power)
        return own, found, found.power < FAR


def _not_judged(
    candidates: Sequence[Candidate], first: Sequence[Candidate], judged: Sequence[Sensitivity]
) -> tuple[tuple[str, str], ...]:
    """Return the ids of the causes that a study does not show, each with the reason."""
    visible = {one.candidate.cause.id for one in judged}
    screened = dict.fromkeys(candidate.cause.id for candidate in first)
    existing = {candidate.cause.id for candidate in candidates}
    invisible = [(name, INVISIBLE) for name in screened if name not in visible]
    return (*invisible, *((name, ABSENT) for name in CATALOGUE if name not in existing))


def _build(replayer: Replayer, null: Floats, outcome: Outcome, begin: float) -> Diagnosis:
    """Build the diagnosis that began at the time ``begin`` of `time.monotonic`."""
    hypothesis, system = outcome.hypothesis, replayer.system
    plant = replayer.plant(hypothesis) if hypothesis else build(system, [])
    return Diagnosis(
        study=system.study.name,
        verdict=outcome.verdict,
        sentence=sentence(outcome),
        causes=outcome.causes,
        fitted_candidates=outcome.fitted_candidates,
        unmodelled=outcome.unmodelled,
        likelihood_gain=outcome.likelihood_gain,
        rms_before=outcome.score.before,
        rms_after=outcome.score.after,
        noise_floor=outcome.score.floor,
        gain=outcome.gain,
        unexplained_fraction=outcome.unexplained_fraction,
        explainable_fraction=outcome.explainable_fraction,
        depends_on=outcome.depends_on,
        next_experiment=outcome.next_experiment,
        not_judged=outcome.not_judged,
        traces=traces(replayer, null, outcome.residual),
        effects=tuple(part for part in hypothesis if has_effects(system, *part)),
        extended_xml=plant.spec.to_xml(),
        seconds=time.monotonic() - begin,
        measures=outcome.measures,
        criteria=outcome.criteria,
        waterfall=outcome.waterfall,
        rejected=outcome.rejected,
        flat=outcome.flat,
        posterior=Posterior(system, replayer.usual, outcome.branches) if outcome.branches else None,
        calibration=outcome.calibration,
        restart=system.study.restart,
    )
