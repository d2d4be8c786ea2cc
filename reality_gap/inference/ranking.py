"""Who promises most: the linear evidence of every suspect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from reality_gap.inference.evidence import fit_normal, occam
from reality_gap.inference.gauss_newton import Fit, held_price
from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import same
from reality_gap.types import Floats

Ranked = list[tuple[float, Sensitivity, Floats]]
Starts = list[tuple[Sensitivity, Floats]]


def rank(found: Sequence[Sensitivity], rule: NoiseModel, base: Fit | None) -> Ranked:
    """Linear evidence of every suspect beside ``base``, with its theta; best first."""
    residual = rule.learn(rule.null if base is None else base.residual)
    known = np.zeros((len(residual), 0)) if base is None else rule.learn(base.jacobian)
    inside = () if base is None else base.candidates
    k = known.shape[1]
    free, unpriced = np.full(k, np.inf), np.full(k, -1)
    known_gram, known_right = known.T @ known, known.T @ residual
    # What is in already was fitted: all evidence here is that of the newcomer.
    paid = occam(known_gram) if k else 0.0
    others = [s for s in found if not any(same(s.candidate, one) for one in inside)]
    ranked = []
    for sensitivity, own in _whitened(rule, others):
        cross = known.T @ own
        low, high = sensitivity.bounds()
        linear = fit_normal(
            np.block([[known_gram, cross], [cross.T, own.T @ own]]),
            np.concatenate([known_right, own.T @ residual]),
            np.concatenate([-free, low]),
            np.concatenate([free, high]),
            np.concatenate([unpriced, np.zeros(len(low), dtype=int)]),
        )
        evidence = linear.evidence + paid - held_price(sensitivity.candidate)
        ranked.append((evidence, sensitivity, linear.theta[k:]))
    return sorted(ranked, key=lambda item: -item[0])


def _whitened(
    rule: NoiseModel, found: Sequence[Sensitivity], most: int = 128
) -> Iterator[tuple[Sensitivity, Floats]]:
    """Each sensitivity with its whitened columns; many columns at once are quicker."""
    for i in range(0, len(found), most):
        part = found[i : i + most]
        ends = np.cumsum([s.columns.shape[1] for s in part])
        white = rule.learn(np.hstack([s.columns for s in part]))
        yield from zip(part, np.split(white, ends[:-1], axis=1), strict=True)


def diverse(ranked: Ranked, count: int, most: int = 3) -> Starts:
    """The best, no cause more than ``most`` times and no place twice for one cause."""
    chosen: Starts = []
    used: dict[str, list[object]] = {}
    for _, sensitivity, theta in ranked:
        candidate = sensitivity.candidate
        locations = used.setdefault(candidate.cause.id, [])
        if candidate.location in locations or len(locations) >= most:
            continue
        locations.append(candidate.location)
        chosen.append((sensitivity, theta))
        if len(chosen) == count:
            break
    return chosen
