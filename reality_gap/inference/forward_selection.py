"""Forward selection: adds causes one by one, each the one that makes the data most likely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np

from reality_gap.causes.support.shared_amounts import FACTOR
from reality_gap.inference.deferral import Deferred
from reality_gap.inference.end_stops import Stop, refuting_stop
from reality_gap.inference.event_times import search_times, times_of
from reality_gap.inference.gauss_newton import (
    Fit,
    Stepwise,
    evidence_without,
    fit,
    fit_stepwise,
    null_fit,
    profile,
    rescore,
    run_together,
)
from reality_gap.inference.likelihood import FAR
from reality_gap.inference.problem import Problem
from reality_gap.inference.ranking import rank, rank_by_remainder
from reality_gap.inference.refinement import fit_next
from reality_gap.inference.relinearisation import relinearised
from reality_gap.inference.screening import Sensitivity, screen
from reality_gap.inference.settling import Settled, settle, whitened_power
from reality_gap.simulation.hypothesis import Hypothesis
from reality_gap.types import Floats

LONG = 20.0
"""Length of a log from which on the errors of nearly right causes add up [s]."""
CLOSE = 1.0
"""Candidates whose evidence is lower than the best by at most so many times its square root are
fitted fully [nats]."""
CLOSEST = 2
"""How many candidates that were nearly the likeliest are tried in the place of two causes."""
SWAP = 1.0
"""Evidence by which another candidate must be better to replace an earlier cause [nats]."""

PROBABLE = 5.0
"""Evidence from which on a single candidate is tried again in later searches [nats]."""
SCREENED = 30
"""Number of candidates that are screened again beside causes."""


@dataclass(frozen=True)
class Settings:
    """Thresholds of a search; the defaults are calibrated, see docs/tuning.md.

    Attributes:
        refits, more_refits: how many candidates are fitted in the first step and in later steps.
        threshold: evidence that the first cause needs [nats].
        further: evidence that each further cause must add [nats].
        root: multiple of the square root of the evidence so far that each further cause must add:
            what a right cause leaves, because its form is not exactly right, grows with it.
        weak: evidence that each further cause must add where a model is wrong by many noises. The
            errors are so correlated there that a log counts as few readings, and held-out readings
            decide [nats].
        most: largest number of causes.
        nonlinear: share of what tolerances explain that may be wrong, because large deviations are
            not linear; a cause must explain more.
    """

    refits: int = 8
    more_refits: int = 5
    threshold: float = 7.0
    further: float = 8.0
    root: float = 0.5
    weak: float = 3.0
    most: int = 10
    nonlinear: float = 0.005

    def for_log(self, seconds: float) -> Settings:
        """Return the settings for a log of this length [s].

        The form of the first cause is not exactly right, and the evidence of that grows with the
        length of the log. So does the evidence that a further cause needs.
        """
        return replace(self, further=self.further * max(1.0, seconds / LONG))

    def needed(self, base: Fit, far: bool) -> float:
        """Return the evidence that a cause must add to others [nats].

        Args:
            base: the other causes.
            far: whether the model is wrong by many noises.
        """
        if base.is_null:
            return self.threshold
        if far:
            return self.weak
        return max(self.further, self.root * max(base.evidence, 0.0) ** 0.5)


@dataclass(frozen=True)
class Step:
    """One step of a search.

    Attributes:
        base: the causes so far.
        tried: fits of ``base`` with one candidate more each, best first: by their evidence, or by
            their profile likelihood where the model is wrong by many noises. There a candidate that
            makes the only cause of ``base`` needless is fitted alone.
        gain: what the best of them adds to the evidence of ``base``, or of a deviation that is no
            fault beside it; of a first cause that pays with the second one only, what both add
            without what the second one needs [nats].
        needed: what it must add to be accepted [nats].
    """

    base: Fit
    tried: tuple[Fit, ...]
    gain: float
    needed: float

    @property
    def accepted(self) -> bool:
        """Whether the best candidate was accepted."""
        return self.gain > self.needed


@dataclass(frozen=True)
class Search:
    """Result of a search.

    Attributes:
        problem: the problem with the noise model by which evidence was measured at the end.
        steps: all steps; the last one was not accepted unless there are the most causes.
        best: the accepted causes; the nominal model if there are none.
        sensitivities: of all candidates that were screened.
        revised: steps in which earlier causes were replaced; see `revise`.
        stop: a stop that explains more than the last cause, with which the search ended.
        relinearised: whether the slopes of tolerances are those beside the causes.
        joint: a joint fit, if the model is wrong by many noises beside a first cause and the search
            begins with it, or beside all causes; see `joint_fit`.
        together: whether the causes are those of a joint fit at the end, beside which no others
            were tried.
    """

    problem: Problem
    steps: tuple[Step, ...]
    best: Fit
    sensitivities: tuple[Sensitivity, ...]
    revised: tuple[Step, ...] = ()
    stop: Stop | None = None
    relinearised: bool = False
    joint: Hypothesis = ()
    together: bool = False

    @property
    def singles(self) -> tuple[Fit, ...]:
        """Fits of single candidates that have enough evidence to be causes."""
        return tuple(f for s in self.steps[:1] for f in s.tried if f.evidence > PROBABLE)

    def step_beside(self, others: Hypothesis) -> Step | None:
        """Return the step that tried candidates beside exactly these others, if there is one.

        A step of a joint fit tried no other than its own cause.
        """
        candidates = [other for other, _ in others]
        for step in (*self.steps, *self.revised):
            base = step.base.candidates
            same = all(any(s.matches(b) for b in base) for s in candidates)
            if len(base) == len(candidates) and same and self._tried_others(step):
                return step
        return None

    def _tried_others(self, step: Step) -> bool:
        """Return whether any fit of a step has other causes than the best ones."""
        best = self.best.candidates
        return any(
            len(one.candidates) != len(best)
            or not all(any(c.matches(b) for b in best) for c in one.candidates)
            for one in step.tried
        )


class Advance(NamedTuple):
    """By what a search advances.

    Attributes:
        problem: the problem, inflated by what the causes leave.
        steps: one for each cause that is added, or one that was not accepted.
        best: the causes.
    """

    problem: Problem
    steps: tuple[Step, ...]
    best: Fit


class FindTogether(Protocol):
    """Finds causes together where a model is wrong by many noises beside any first cause.

    None if there are none.
    """

    def __call__(
        self, plain: Problem, sensitivities: Sequence[Sensitivity], step: Step, /
    ) -> Advance | None: ...


def search(
    problem: Problem,
    sensitivities: Sequence[Sensitivity],
    settings: Settings,
    deferred: Deferred | None = None,
    known: Sequence[Fit] = (),
    find_together: FindTogether = lambda plain, sensitivities, step: None,
    relinearise: bool = True,
) -> Search:
    """Search for the causes of a residual.

    Args:
        problem: what is to be explained, with a noise model without inflation.
        sensitivities: of all candidates that are not deferred.
        settings: thresholds.
        deferred: candidates that are screened where others have evidence.
        known: fits of single candidates by an earlier search, which are tried, too.
        find_together: called with the problem without inflation, all sensitivities and the first
            step; the search goes on beside the causes that it returns.
        relinearise: whether slopes of tolerances may become those beside the causes.
    """
    nominal, plain, best, near = problem, problem, null_fit(problem), sensitivities
    steps, stop, is_bent = list[Step](), None, False
    while len(steps) < settings.most:
        beside = _anticipate(plain, problem, near, best)
        if deferred:
            released = deferred.release(rank(beside, near, best))
            sensitivities, near = [*sensitivities, *released], [*near, *released]
        widely = best.is_null or problem.noise_model.is_far
        refits = settings.refits if widely else settings.more_refits
        tried = fit_next(beside, near, best, refits)
        if best.is_null:
            tried = _with_known(beside, tried, known)
        if not tried:
            break
        settled = settle(plain, tried, best)
        problem, added, best = _advance(plain, settled, sensitivities, settings, find_together)
        steps += added
        step = added[-1]
        if step.accepted or (best.is_null and problem.noise_model.is_far):
            stop = refuting_stop(plain, step.base, best if step.accepted else None)
        if stop is not None or not step.accepted:
            break
        beside_best = relinearised(nominal, best) if relinearise else None
        if beside_best is not None:
            plain, is_bent = beside_best, True
            problem = plain.inflated(best.residual)
            best = rescore(problem, best)
        if (is_bent or problem.noise_model.is_far) and len(steps) < settings.most:
            near = _screen_beside(problem, sensitivities, best)
    found = tuple(sensitivities)
    return Search(problem, tuple(steps), best, found, stop=stop, relinearised=is_bent)


def _advance(
    plain: Problem,
    settled: Settled,
    sensitivities: Sequence[Sensitivity],
    settings: Settings,
    find_together: FindTogether,
) -> Advance:
    """Add the best cause of a step if it is accepted; of a first step, also several causes."""
    problem, step = settled.problem, _judge(settled, settings)
    if step.base.is_null and problem.noise_model.is_far:
        together = find_together(plain, sensitivities, step)
        if together is None and not step.accepted:
            together = _pair(plain, problem, sensitivities, step, settings)
        if together is not None:
            return together
    best = without_covered(problem, step.tried[0]) if step.accepted else step.base
    return Advance(problem, (step,), best)


def without_covered(problem: Problem, fitted: Fit) -> Fit:
    """Return a fit without causes at joints where the last one acts on all, each by its own."""
    last, values = fitted.hypothesis[-1]
    covered = [part for part in fitted.hypothesis if last.covers(part[0])]
    if not covered:
        return fitted
    rest = [part for part in fitted.hypothesis[:-1] if not last.covers(part[0])]
    start = dict(values)
    for one, amount in covered:
        if one.location.note != FACTOR:
            for joint in one.location.elements:
                start[joint] += amount[one.parameters[0].name]
    return fit(problem, [*rest, (last, start)])


def _pair(
    plain: Problem,
    problem: Problem,
    sensitivities: Sequence[Sensitivity],
    step: Step,
    settings: Settings,
) -> Advance | None:
    """Return the first two steps if their causes pay together, though the first alone does not.

    Where a model is wrong by many noises in two ways, what either of them leaves is so large and so
    correlated that the other one has hardly any evidence without it.

    Args:
        plain: the problem without inflation.
        problem: inflated by what the best cause of the first step leaves.
        sensitivities: of all candidates.
        step: the first step, whose best cause has too little evidence.
        settings: thresholds.
    """
    first = step.tried[0]
    near = _screen_beside(problem, sensitivities, first)
    tried = fit_next(_anticipate(plain, problem, near, first), near, first, settings.more_refits)
    if not tried:
        return None
    settled = settle(plain, tried, first)
    second = _judge(settled, settings)
    if not settled.profiled or not second.accepted:
        return None
    null = profile(settled.problem.without_tolerances(), step.base)
    together = second.tried[0].evidence - null.evidence - second.needed
    if together <= step.needed:
        return None
    steps = (replace(step, gain=together), second)
    return Advance(settled.problem, steps, without_covered(settled.problem, second.tried[0]))


def _judge(settled: Settled, settings: Settings) -> Step:
    """Return the step of a search, whose best candidates are fitted fully."""
    problem, tried, base, profiled = settled
    error = settings.nonlinear**2 * problem.noise_model.evidence_of_explained(tried[0].residual)
    needed = settings.needed(base, profiled) + error
    if base.is_null:
        needed += problem.handicaps[profiled]
    if profiled:
        tolerant = {id(f): rescore(problem, f) for f in tried}
        evidence = [one.evidence for one in tolerant.values()]
        tried = special_cases_first(tried, settings, profiled, evidence)
        alike = tuple(tolerant[id(f)] for f in tried)
        return Step(rescore(problem, base), alike, tried[0].evidence - base.evidence, needed)
    tried = special_cases_first(tried, settings, profiled)
    without = evidence_without(base.evidence, tried)
    if tried[0].evidence - without > needed:
        tried = special_cases_first(polish(problem, tried, base), settings, profiled)
        without = evidence_without(base.evidence, tried)
    return Step(base, tried, tried[0].evidence - without, needed)


def special_cases_first(
    tried: Sequence[Fit],
    settings: Settings,
    far: bool,
    tolerant: Sequence[float] = (),
) -> tuple[Fit, ...]:
    """Return fits with a special case of the first one before it, if that does not add enough.

    It must add to the special case what a further cause must add: where the form of both is not
    exactly right, the more general one is always a little better. Without tolerances the general
    one also explains what they would, as masses of all links do where one link is too heavy; the
    special case comes first, too, if it is likelier with them.

    Args:
        tried: fits with one candidate more each, best first.
        settings: thresholds.
        far: whether the model is wrong by many noises.
        tolerant: evidence of each with tolerances, if ``tried`` has it without them [nats].
    """
    evidence = tolerant or [f.evidence for f in tried]
    for one, likely in zip(tried[1:], evidence[1:], strict=True):
        first, other = tried[0], one.candidates[-1]
        if not first.candidates[-1].includes(other):
            continue
        little = first.evidence - one.evidence < settings.needed(one, far)
        if little or likely > evidence[0]:
            return (one, *(f for f in tried if f is not one))
    return tuple(tried)


def _with_known(problem: Problem, tried: Sequence[Fit], known: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return the fits of a first step and those known ones that it lacks, best first.

    Slopes at the null do not lead to them.
    """
    found = [one.candidates[0] for one in tried]
    lacking = [k for k in known if not any(k.candidates[0].matches(f) for f in found)]
    fits = [fit_stepwise(problem, k.hypothesis, k.jacobian, polish=False) for k in lacking]
    added = run_together(problem.replayer, fits)
    return tuple(sorted([*tried, *added], key=lambda f: -f.evidence))


def _screen_beside(
    problem: Problem, sensitivities: Sequence[Sensitivity], base: Fit
) -> tuple[Sensitivity, ...]:
    """Return the sensitivities beside causes, which may be far from those of the nominal model.

    Those of candidates that are less likely with the old ones are left out.
    """
    orders = [order(problem, sensitivities, base) for order in (rank, rank_by_remainder)]
    likely = [one.sensitivity.candidate for pair in zip(*orders, strict=True) for one in pair]
    unique = list({(one.cause.id, one.location): one for one in likely}.values())[:SCREENED]
    return screen(problem.replayer, unique, base.residual, base=base.hypothesis)


def polish(problem: Problem, tried: Sequence[Fit], base: Fit) -> tuple[Fit, ...]:
    """Refit the candidates that are close to the best with finite differences.

    Quick fits use slopes at the null. With stick-slip these lead to a minimum beside the true one,
    and the rest of a full fit is worth more than the difference between candidates, and to a
    deviation that is no fault. Times of an event are searched again, because it was fitted with
    noise as large as what remains without it.

    Args:
        problem: what is to be explained.
        tried: fits of ``base`` with one candidate more each, best first.
        base: the fit without these.

    Returns:
        All fits, best first.
    """
    done, rest = list[Fit](), list(tried)
    while True:
        best = max(f.evidence for f in (*done, *rest))
        close = [f for f in rest if f.raw_evidence >= best - CLOSE * max(best, 0.0) ** 0.5]
        if not close:
            return tuple(sorted([*done, *rest], key=lambda f: -f.evidence))
        fits = [_polished(problem, f, base) for f in close]
        done, rest = done + run_together(problem.replayer, fits), rest[len(close) :]


def _polished(problem: Problem, quick: Fit, base: Fit) -> Stepwise[Fit]:
    """Return a fit with finite differences, and with the best times if it has an event more."""
    full = yield from fit_stepwise(problem, quick.hypothesis, quick.jacobian)
    if times_of(full.candidates[-1]):
        full = yield from search_times(problem, full, base)
    return full


def _anticipate(
    plain: Problem, problem: Problem, sensitivities: Sequence[Sensitivity], base: Fit
) -> Problem:
    """Return the problem inflated by what would remain beside ``base`` and the best candidate.

    The effect of a further cause is autocorrelated in the remainder without it, and would inflate
    the noise by so much that the cause has no evidence. The first cause is ranked without inflation
    unless the model is wrong by many noises.
    """
    if base.is_null and whitened_power(plain, base.residual) < FAR:
        return plain
    ranked = rank(problem, sensitivities, base)
    if not ranked:
        return problem
    _, likely, theta = ranked[0]
    return plain.inflated(base.residual - likely.columns @ theta)


def _one_for_two(result: Search, settings: Settings) -> Fit:
    """Return the best causes, or fewer of them that are as likely but for what a cause must add.

    In the place of a cause and of a later one comes a candidate that was nearly as likely as the
    first one when it was chosen. Where a model stays wrong by many noises, no cause is known well
    enough to do without another one.
    """
    if result.problem.noise_model.is_far:
        return result.best
    problem, best, quick = result.problem, result.best, list[Stepwise[Fit]]()
    known = list(zip(best.hypothesis, _columns(best), strict=True))
    for step in result.steps:
        chosen, *others = step.tried
        rest = [one for one in known if not chosen.candidates[-1].matches(one[0][0])]
        if len(rest) == len(known):
            continue
        earlier = [c for c in step.base.candidates if any(c.matches(one[0][0]) for one in rest)]
        least = chosen.evidence - CLOSE * max(chosen.evidence, 0.0) ** 0.5
        for other in [f for f in others if f.evidence > least][:CLOSEST]:
            last, columns = other.hypothesis[-1], _columns(other)[-1]
            if any(last[0].matches(part[0]) for part, _ in rest):
                continue
            for left in range(len(earlier), len(rest)):
                kept = [*rest[:left], *rest[left + 1 :], (last, columns)]
                slopes = np.hstack([own for _, own in kept])
                quick.append(fit_stepwise(problem, [part for part, _ in kept], slopes, False))
    if not quick:
        return best
    likeliest = max(run_together(problem.replayer, quick), key=lambda f: f.evidence)
    full = [fit_stepwise(problem, likeliest.hypothesis, likeliest.jacobian)]
    [fewer] = run_together(problem.replayer, full)
    return fewer if fewer.evidence > best.evidence - settings.further else best


def _columns(fitted: Fit) -> list[Floats]:
    """Return the columns of a fit's jacobian by candidate, shape (n, p) each."""
    ends = np.cumsum([len(candidate.parameters) for candidate in fitted.candidates])
    return np.split(fitted.jacobian, ends[:-1], axis=1)


def revise(result: Search, settings: Settings) -> Search:
    """Drop or replace causes that the later causes made unnecessary.

    The first cause of two was chosen when it had to explain a part of the effect of the other. Or
    it stands for a cause that was nearly as likely, and a later one for the difference.
    """
    if result.together or len(result.best.hypothesis) <= 1:
        return result
    problem, best = result.problem, _one_for_two(result, settings)
    for candidate in best.candidates:
        rest: Hypothesis = [part for part in best.hypothesis if not part[0].matches(candidate)]
        if result.step_beside(rest) is not None:
            continue
        without = fit(problem, rest)
        if best.evidence - without.evidence < settings.further:
            best = without
            if len(best.hypothesis) == 1:
                break
            continue
        far = problem.noise_model.is_far
        tried = fit_next(problem, result.sensitivities, without, settings.refits)
        tried = special_cases_first(tried, settings, far)
        needed = best.evidence + SWAP - without.evidence
        if tried and tried[0].evidence - without.evidence > needed:
            tried = special_cases_first(polish(problem, tried, without), settings, far)
            best = tried[0]
        gain = tried[0].evidence - without.evidence if tried else 0.0
        step = Step(without, tried, gain, needed)
        result = replace(result, revised=(*result.revised, step))
    return replace(result, best=best)
