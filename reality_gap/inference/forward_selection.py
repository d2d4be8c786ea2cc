"""The search for causes: one after the other, each the one that makes the data most likely."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from reality_gap.inference.deferral import Waiting
from reality_gap.inference.gauss_newton import Fit, fit, fitting, together
from reality_gap.inference.likelihood import NoiseModel, noise_model
from reality_gap.inference.ranking import rank
from reality_gap.inference.refinement import again, try_next
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import same
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.types import Floats

LONG = 20.0
"""Length of a log beyond which what names are nearly right by adds up [s]."""
CLOSE = 1.0
"""How many roots of the best's evidence rivals may lie below it, to be fitted as fully [nats]."""
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
    """

    refits: int = 8
    more_refits: int = 5
    threshold: float = 5.0
    further: float = 7.0
    root: float = 0.5
    most: int = 3

    def for_log(self, seconds: float) -> Settings:
        """The same for a log of ``seconds``: what a further cause needs grows with its length.

        The form of the first is not quite right, and each further second says it again.
        """
        return replace(self, further=self.further * max(1.0, seconds / LONG))


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
        revised: who was tried in the place of earlier causes, beside the later ones; see `revise`.
    """

    steps: tuple[Step, ...]
    best: Fit | None
    noise_model: NoiseModel
    found: tuple[Sensitivity, ...]
    revised: tuple[Step, ...] = ()


def search(
    replayer: Replayer,
    found: Sequence[Sensitivity],
    null: Floats,
    tolerances: Floats,
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
    rule = plain = noise_model(replayer.measured, null, tolerances)
    best: Fit | None = None
    steps: list[Step] = []
    while len(steps) < settings.most:
        beside = rule if best is None else _foreseen(plain, found, rule, best)
        if waiting:
            found = [*found, *waiting.call(rank(found, beside, best))]
        refits = settings.refits if best is None else settings.more_refits
        tried = try_next(replayer, found, beside, best, refits)
        if not tried:
            break
        rule = plain.where_wanders(tried[0].residual)
        tried = tuple(sorted((again(rule, f) for f in tried), key=lambda f: -f.evidence))
        base = None if best is None else again(rule, best)
        best = tried[0]
        if _accept(base, best, settings):
            tried = polished(replayer, tried, rule)
            best = tried[0]
        accepted = _accept(base, best, settings)
        steps.append(Step(base, tried, accepted))
        if not accepted:
            best = base
            break
    return Search(tuple(steps), best, rule, tuple(found))


def polished(replayer: Replayer, tried: Sequence[Fit], rule: NoiseModel) -> tuple[Fit, ...]:
    """Those that are close to the best, fitted with slopes where they stand; best first.

    Quick fits go by slopes at the null. Where a wire sticks and slips these see a minimum beside
    the true one, and the rest of a full fit is worth more than what sets rivals apart.

    Args:
        bench: replays.
        tried: fits, best first.
        rule: what evidence is measured in.
    """
    done, rest = list[Fit](), list(tried)
    while True:
        best = max(f.evidence for f in (*done, *rest))
        close = [f for f in rest if f.evidence >= best - CLOSE * max(best, 0.0) ** 0.5]
        if not close:
            return tuple(sorted([*done, *rest], key=lambda f: -f.evidence))
        fits = [fitting(f.hypothesis, rule.learn, rule.null, f.jacobian) for f in close]
        done, rest = done + together(replayer, fits), rest[len(close) :]


def _foreseen(
    plain: NoiseModel, found: Sequence[Sensitivity], rule: NoiseModel, base: Fit
) -> NoiseModel:
    """The ruler by what would remain beside ``base`` and whoever promises most.

    What a further cause does wanders in the remainder without it, and would hide itself there.
    """
    ranked = rank(found, rule, base)
    if not ranked:
        return rule
    _, likely, theta = ranked[0]
    return plain.where_wanders(base.residual - likely.columns @ theta)


def _accept(base: Fit | None, best: Fit, settings: Settings) -> bool:
    if base is None:
        return best.evidence > settings.threshold
    more = best.evidence - base.evidence
    return more > max(settings.further, settings.root * base.evidence**0.5)


def revise(replayer: Replayer, result: Search, settings: Settings) -> Search:
    """Look at each cause anew beside those that came after it: drop it, or put a likelier one.

    The first cause of two was chosen when it had to explain a part of the other, too.
    """
    best, rule = result.best, result.noise_model
    if best is None or len(best.hypothesis) == 1:
        return result
    revised: list[Step] = []
    for candidate in best.candidates:
        rest: Hypothesis = [part for part in best.hypothesis if not same(part[0], candidate)]
        if tried_beside([*result.steps, *revised], rest) is not None:
            continue
        without = fit(replayer, rest, rule.learn, rule.null)
        if best.evidence - without.evidence < settings.further:
            best = without
            if len(best.hypothesis) == 1:
                break
            continue
        tried = try_next(replayer, result.found, rule, without, settings.refits)
        better = bool(tried) and tried[0].evidence > best.evidence + SWAP
        if better:
            tried = polished(replayer, tried, rule)
            best = tried[0]
        revised.append(Step(without, tried, better))
    return replace(result, best=best, revised=tuple(revised))


def tried_beside(steps: Sequence[Step], others: Hypothesis) -> Step | None:
    """The step that tried whom to put beside exactly these others, if one did."""
    beside = [other for other, _ in others]
    for step in steps:
        base = () if step.base is None else step.base.candidates
        if len(base) == len(beside) and all(any(same(s, b) for b in base) for s in beside):
            return step
    return None
