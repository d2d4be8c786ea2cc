"""The search for causes: one after the other, each the one that makes the data most likely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reality_gap.fitting import Asking, Fit, fit, fitting, log_evidence, resizing, together
from reality_gap.plant import Suspect, same
from reality_gap.ranking import diverse, rank
from reality_gap.ruler import Ruler, ruler
from reality_gap.screening import Sensitivity
from reality_gap.waiting import Waiting
from reality_gap.workbench import Hypothesis, Workbench

Array = NDArray[np.float64]


PROMISE = 3.0
"""Linear evidence that makes a further cause worth a fit [nats]."""

KEPT = 0.5
"""Share of what a line through small faults promises that a start must keep."""
TWICE = 2.0
"""The size that is tried beside it: what sticks may be far larger than its slope tells."""
OTHER_SIZES = (4.0, 0.5, 0.2, 0.05)
"""Sizes that are tried if it keeps less, or if twice is better."""
WORTH = 0.4
"""Share of the best evidence from which on other sizes of a suspect are tried."""
MORE_STICKY = 5
"""How many more of what sticks are fitted where one of it explains much."""
SWAP = 1.0
"""Evidence by which another must be better to take the place of an earlier cause [nats]."""


@dataclass(frozen=True)
class Settings:
    """How a search decides; the defaults are calibrated, see docs/reality_gap.md.

    Attributes:
        refits, more_refits: how many suspects are fitted fully in the first step, in later ones.
        threshold: evidence that the first cause needs [nats].
        further: evidence that each further cause needs [nats].
        root: of the evidence so far; so many of it each further cause must add. What the right name
            leaves over, as its form is not quite right, grows with it.
        most: number of causes at most.
        seconds: length of the logs that ``threshold`` and ``further`` were calibrated on [s].
    """

    refits: int = 8
    more_refits: int = 5
    threshold: float = 5.0
    further: float = 12.0
    root: float = 0.5
    most: int = 3
    seconds: float = 20.0

    def for_log(self, seconds: float) -> Settings:
        """The same for a log of ``seconds``: what a cause needs grows with the root of its length.

        A tolerance changes the readings in almost a straight line. What is not straight in it looks
        like a cause, and is said again by every reading.
        """
        longer = max(1.0, seconds / self.seconds) ** 0.5
        return replace(self, threshold=self.threshold * longer, further=self.further * longer)


@dataclass(frozen=True)
class Step:
    """One step of a search: what was in already, and who was tried beside it, best first."""

    base: Fit | None
    tried: tuple[Fit, ...]
    accepted: bool


@dataclass(frozen=True)
class Search:
    """What a search found.

    Attributes:
        steps: one more than causes were accepted, unless there were the most.
        best: the hypothesis that stands; None for the null.
        ruler: what evidence was measured in, at the end.
        found: sensitivities of all who were looked at.
        revised: who was tried in the place of earlier causes, beside the later ones.
    """

    steps: tuple[Step, ...]
    best: Fit | None
    ruler: Ruler
    found: tuple[Sensitivity, ...]
    revised: tuple[Step, ...]


def search(
    bench: Workbench,
    found: Sequence[Sensitivity],
    null: Array,
    tolerances: Array,
    settings: Settings,
    waiting: Waiting | None = None,
) -> Search:
    """Search for the causes of a residual.

    Args:
        bench: replays.
        found: sensitivities at the null of all suspects but those who wait.
        null: (n,) residual of the study's model.
        tolerances: (n, p) what every honest drawing is off by.
        settings: thresholds.
        waiting: who is looked at where the others promise something.
    """
    rule = ruler(bench.measured, null, tolerances, None)
    best: Fit | None = None
    steps: list[Step] = []
    while len(steps) < settings.most:
        if waiting:
            found = [*found, *waiting.call(rank(found, rule, best))]
        refits = settings.refits if best is None else settings.more_refits
        tried = try_next(bench, found, rule, best, refits)
        if not tried:
            break
        rule = ruler(bench.measured, null, tolerances, tried[0].residual)
        tried = tuple(sorted((again(rule, f) for f in tried), key=lambda f: -f.evidence))
        base = None if best is None else again(rule, best)
        best = tried[0]
        if _accept(base, best, settings):
            # Slopes where it stands may price it higher than those that it was found with.
            best = fit(bench, best.hypothesis, rule.learn, null, best.jacobian)
        accepted = _accept(base, best, settings)
        steps.append(Step(base, tried, accepted))
        if not accepted:
            best = base
            break
    revised: tuple[Step, ...] = ()
    if best is not None and len(best.hypothesis) > 1:
        best, revised = _revise(bench, found, rule, best, steps, settings)
    return Search(tuple(steps), best, rule, tuple(found), revised)


def _accept(base: Fit | None, best: Fit, settings: Settings) -> bool:
    if base is None:
        return best.evidence > settings.threshold
    more = best.evidence - base.evidence
    return more > max(settings.further, settings.root * base.evidence**0.5)


def again(rule: Ruler, old: Fit) -> Fit:
    """The same fit, its evidence measured by another ruler."""
    found = log_evidence(
        rule.learn, rule.null, old.residual, old.jacobian, old.theta, old.hypothesis
    )
    return replace(old, evidence=found)


def try_next(
    bench: Workbench, found: Sequence[Sensitivity], rule: Ruler, base: Fit | None, refits: int
) -> tuple[Fit, ...]:
    """Fit the most promising suspects beside ``base``, best first."""
    ranked = rank(found, rule, base)
    worth = ranked if base is None else [item for item in ranked if item[0] > PROMISE]
    chosen = diverse(worth, refits)
    fits = together(bench, [_attempt(*one, rule, base) for one in chosen])
    floor = 0.0 if base is None else again(rule, base).evidence
    if _sticks(fits, floor):
        tried = [sensitivity.suspect for sensitivity, _ in chosen]
        rest = [item for item in ranked if _untried(item[1].suspect, tried)]
        more = diverse(rest, MORE_STICKY, most=MORE_STICKY)
        fits += together(bench, [_attempt(*one, rule, base) for one in more])
    best = max((f.evidence for f, _ in fits), default=floor)
    close = floor + WORTH * max(best - floor, 0.0)
    first = 0 if base is None else len(base.hypothesis)
    done = together(bench, [_finish(*one, rule, close, first) for one in fits])
    return tuple(sorted(done, key=lambda f: -f.evidence))


def _sticks(fits: Sequence[tuple[Fit, bool]], floor: float) -> bool:
    """Whether a newcomer that sticks explains much, beside the best."""
    best = max((f.evidence - floor for f, _ in fits), default=0.0)
    enough = max(PROMISE, WORTH * best)
    return any(f.suspects[-1].cause.sticky and f.evidence - floor > enough for f, _ in fits)


def _untried(suspect: Suspect, tried: Sequence[Suspect]) -> bool:
    return suspect.cause.sticky and not any(same(suspect, one) for one in tried)


def _attempt(
    sensitivity: Sensitivity, theta: Array, rule: Ruler, base: Fit | None
) -> Asking[tuple[Fit, bool]]:
    """A quick fit with known slopes, and whether these are slopes in all parameters."""
    start = yield from _start(sensitivity, theta, rule, base)
    known = _slopes(sensitivity)
    if base is not None:
        known = np.hstack([base.jacobian, known])
    fitted = yield from fitting(start, rule.learn, rule.null, known, polish=False)
    return fitted, len(sensitivity.names) == len(sensitivity.suspect.parameters)


def _finish(fitted: Fit, whole: bool, rule: Ruler, close: float, first: int) -> Asking[Fit]:
    """The full fit of whoever is ``close`` to the best."""
    if fitted.evidence < close:
        return fitted
    if whole:
        return (yield from resizing(fitted, rule.learn, rule.null, first))
    return (yield from fitting(fitted.hypothesis, rule.learn, rule.null))


def _start(
    sensitivity: Sensitivity, theta: Array, rule: Ruler, base: Fit | None
) -> Asking[Hypothesis]:
    """A suspect beside ``base`` at ``theta``, or of another size where lines promise too much."""
    known = tuple(base.hypothesis) if base else ()
    residual = base.residual if base else rule.null

    def cost(there: Array) -> float:
        diverged = not np.all(np.isfinite(there))
        return np.inf if diverged else 0.5 * float(np.sum(rule.learn(there) ** 2))

    def of_size(size: float) -> Hypothesis:
        return [*known, (sensitivity.suspect, sensitivity.values(size * theta))]

    before = cost(residual)
    promise = before - cost(residual - sensitivity.columns @ theta)
    first, least = [of_size(1.0), of_size(TWICE)], before - KEPT * promise
    costs = [cost(r) for r in (yield first)]
    if costs[0] < min(least, costs[1]):
        return first[0]
    trials = [of_size(size) for size in OTHER_SIZES]
    if len(sensitivity.suspect.parameters) == 1:
        lone = sensitivity.suspect.parameters[0]
        others = (*lone.starts, *lone.secants)
        trials += [[*known, (sensitivity.suspect, {lone.name: x})] for x in others]
    costs += [cost(r) for r in (yield trials)]
    return [*first, *trials][int(np.argmin(costs))]


def _slopes(sensitivity: Sensitivity) -> Array:
    """The columns in the order of the suspect's parameters; 0 where none was looked at."""
    slopes = np.zeros((len(sensitivity.columns), len(sensitivity.suspect.parameters)))
    for i, p in enumerate(sensitivity.suspect.parameters):
        if p.name in sensitivity.names:
            slopes[:, i] = sensitivity.columns[:, sensitivity.names.index(p.name)]
    return slopes


def _revise(
    bench: Workbench,
    found: Sequence[Sensitivity],
    rule: Ruler,
    best: Fit,
    steps: Sequence[Step],
    settings: Settings,
) -> tuple[Fit, tuple[Step, ...]]:
    """Look at each cause anew beside those that came after it: drop it, or put a likelier one.

    The first cause of two was chosen when it had to explain a part of the other, too.
    """
    revised: list[Step] = []
    for suspect in best.suspects:
        rest: Hypothesis = [part for part in best.hypothesis if not same(part[0], suspect)]
        if tried_beside([*steps, *revised], rest) is not None:
            continue
        without = fit(bench, rest, rule.learn, rule.null)
        if best.evidence - without.evidence < settings.further:
            best = without
            if len(best.hypothesis) == 1:
                break
            continue
        tried = try_next(bench, found, rule, without, settings.refits)
        better = bool(tried) and tried[0].evidence > best.evidence + SWAP
        revised.append(Step(without, tried, better))
        if better:
            best = fit(bench, tried[0].hypothesis, rule.learn, rule.null, tried[0].jacobian)
    return best, tuple(revised)


def tried_beside(steps: Sequence[Step], others: Hypothesis) -> Step | None:
    """The step that tried whom to put beside exactly these others, if one did."""
    beside = [other for other, _ in others]
    for step in steps:
        base = () if step.base is None else step.base.suspects
        if len(base) == len(beside) and all(any(same(s, b) for b in base) for s in beside):
            return step
    return None
