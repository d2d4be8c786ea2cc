"""Who could stand in a cause's place, and who these data cannot tell from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.inference.confidence import probabilities
from reality_gap.inference.forward_selection import Search, Settings, tried_beside
from reality_gap.inference.gauss_newton import Fit, fit
from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.refinement import again, try_next
from reality_gap.simulation.hypothesis import Candidate, same
from reality_gap.simulation.replayer import Replayer
from reality_gap.types import Floats

CHANCE = 0.05
"""Probability from which on a rival is declared equivalent."""
NEAR = 1.0
"""Mean square of the difference of two refits under which they predict the same [noise^2]."""


@dataclass(frozen=True)
class Alternatives:
    """A cause of the best hypothesis, and who was tried in its place.

    Attributes:
        suspect: the cause.
        without: the best hypothesis without it, fitted anew; None for the null.
        tried: fits with the suspect or another in its place, best first.
        confidence: probability of each of ``tried``.
        evidence: of each over the hypothesis without (k,) [nats].
        own: the same of the cause itself.
        equivalent: who predicts the same to within the noise, and may well be the one.
    """

    candidate: Candidate
    without: Fit | None
    tried: tuple[Fit, ...]
    confidence: Floats
    evidence: Floats
    own: float
    equivalent: tuple[Candidate, ...]


def alternatives(
    replayer: Replayer,
    result: Search,
    settings: Settings,
    retry: bool = True,
) -> tuple[Alternatives, ...]:
    """Put others in the place of each cause of the best hypothesis.

    Args:
        bench: replays.
        result: of the search.
        settings: of the search.
        retry: whether to try, too, whom the search never tried beside the same others.
    """
    best = result.best
    if best is None:
        return ()
    rule = result.noise_model
    everyone = []
    for i, (candidate, _) in enumerate(best.hypothesis):
        rest = [part for j, part in enumerate(best.hypothesis) if j != i]
        before = tried_beside([*result.steps, *result.revised], rest)
        if before is not None:
            base, tried = before.base, before.tried
        else:
            base = fit(replayer, rest, rule.learn, rule.null) if rest and retry else None
            tried = try_next(replayer, result.found, rule, base, settings.refits) if retry else ()
        fits = _with_best(rule, tried, best, candidate)
        floor = 0.0 if base is None else again(rule, base).evidence
        chances = probabilities(floor, fits)
        more = np.array([f.evidence for f in fits]) - floor
        alike = _equivalent(best, fits, chances)
        own = again(rule, best).evidence - floor
        everyone.append(Alternatives(candidate, base, fits, chances, more, own, alike))
    return tuple(everyone)


def _with_best(
    rule: NoiseModel, tried: Sequence[Fit], best: Fit, candidate: Candidate
) -> tuple[Fit, ...]:
    others = [again(rule, f) for f in tried if not same(f.candidates[-1], candidate)]
    return tuple(sorted([again(rule, best), *others], key=lambda f: -f.evidence))


def _equivalent(best: Fit, fits: Sequence[Fit], chances: Floats) -> tuple[Candidate, ...]:
    found = []
    for other, chance in zip(fits, chances, strict=True):
        if other.hypothesis is best.hypothesis or chance < CHANCE:
            continue
        if float(np.mean((other.residual - best.residual) ** 2)) < NEAR:
            found.append(other.candidates[-1])
    return tuple(found)
