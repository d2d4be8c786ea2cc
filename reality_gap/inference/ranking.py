"""Ranking of candidates by their linear evidence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from reality_gap.inference.evidence import fit_normal, occam
from reality_gap.inference.gauss_newton import Fit, start_penalty
from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.types import Floats

CHUNK = 128
"""Number of sensitivities that are whitened at once, which is faster than one by one."""
TINY = 1e-12
"""Power of a direction of parameters that has no effect, over that of the largest."""
REWEIGHTINGS = 3
"""How often least squares are repeated with the variance of what they left."""


class Ranked(NamedTuple):
    """A candidate with its linear fit.

    Attributes:
        evidence: what it adds to the evidence of the base [nats].
        sensitivity: its sensitivity.
        theta: its parameters in scales from their null values, shape (p,).
    """

    evidence: float
    sensitivity: Sensitivity
    theta: Floats


def rank(problem: Problem, sensitivities: Sequence[Sensitivity], base: Fit) -> list[Ranked]:
    """Rank the candidates that are not in ``base`` by the evidence that they add to it.

    Args:
        problem: what is to be explained.
        sensitivities: of all candidates; one with several starts has several.
        base: the causes so far.

    Returns:
        The candidates, best first.
    """
    whiten = problem.noise_model.whiten
    residual, known = whiten(base.residual), whiten(base.jacobian)
    k = known.shape[1]
    free, unpriced = np.full(k, np.inf), np.full(k, -1)
    known_gram, known_right = known.T @ known, known.T @ residual
    # The base is fitted already: adding its penalty again leaves the evidence of the candidate.
    paid = occam(known_gram)
    others = [s for s in sensitivities if not _is_in(base, s.candidate)]
    ranked = []
    for sensitivity, own in _whitened(problem.noise_model, others):
        cross = known.T @ own
        low, high = sensitivity.bounds()
        linear = fit_normal(
            np.block([[known_gram, cross], [cross.T, own.T @ own]]),
            np.concatenate([known_right, own.T @ residual]),
            np.concatenate([-free, low]),
            np.concatenate([free, high]),
            np.concatenate([unpriced, np.zeros(len(low), dtype=int)]),
        )
        evidence = linear.evidence + paid - start_penalty(sensitivity.candidate)
        ranked.append(Ranked(evidence, sensitivity, linear.theta[k:]))
    return sorted(ranked, key=lambda one: -one.evidence)


def rank_by_remainder(
    problem: Problem, sensitivities: Sequence[Sensitivity], base: Fit
) -> list[Ranked]:
    """Rank candidates by what least squares leave, where a model is wrong by many noises.

    The variance of what a candidate leaves is not known there, see `settle`. With that of the base,
    what a prior allows of a candidate is the less, the more it would explain: one that explains all
    of a channel would never be tried.

    Args:
        problem: what is to be explained.
        sensitivities: of all candidates; one with several starts has several.
        base: the causes so far.

    Returns:
        The candidates with their least-squares fits, best first, with the profile likelihood that
        each adds [nats].
    """
    use, channel = problem.noise_model.whiten.use, problem.measured.channel
    rows = [np.flatnonzero(use & (channel == one)) for one in np.unique(channel[use])]
    counts = np.array([np.sum(1.0 / problem.noise_model.correlation[r]) for r in rows])
    sizes = np.array([len(r) for r in rows])
    ranked = []
    for one in sensitivities:
        if _is_in(base, one.candidate):
            continue
        both = np.column_stack([one.columns, base.residual])
        squares = np.array([both[r].T @ both[r] for r in rows])
        first = variance = np.maximum(1.0, squares[:, -1, -1] / sizes)
        theta = np.zeros(one.columns.shape[1])
        for _ in range(REWEIGHTINGS):
            theta = _least_squares(np.tensordot(1.0 / variance, squares, 1), *one.bounds())
            change = np.append(-theta, 1.0)
            variance = np.maximum(1.0, np.einsum("i,cij,j->c", change, squares, change) / sizes)
        ranked.append(Ranked(0.5 * float(counts @ np.log(first / variance)), one, theta))
    return sorted(ranked, key=lambda one: -one.evidence)


def _is_in(base: Fit, candidate: Candidate) -> bool:
    """Return whether a fit has a candidate, or the same cause at all joints."""
    return any(candidate.matches(one) or one.covers(candidate) for one in base.candidates)


def _least_squares(squares: Floats, low: Floats, high: Floats) -> Floats:
    """Return the parameters (p,) within bounds that explain most of a residual.

    Args:
        squares: products of p columns and the residual, shape (p + 1, p + 1).
        low, high: bounds, shape (p,).
    """
    gram, right = squares[:-1, :-1], squares[:-1, -1]
    theta = np.linalg.lstsq(gram, right)[0]
    if np.any(theta < low) or np.any(theta > high):
        power, axes = np.linalg.eigh(gram)
        kept = power > TINY * power[-1]
        root = (axes * np.sqrt(np.where(kept, power, 1.0)) * kept).T
        aim = np.where(kept, (axes.T @ right) / np.sqrt(np.where(kept, power, 1.0)), 0.0)
        theta = lsq_linear(root, aim, bounds=(low, high)).x
    return np.asarray(theta)


def _whitened(
    noise_model: NoiseModel, sensitivities: Sequence[Sensitivity]
) -> Iterator[tuple[Sensitivity, Floats]]:
    """Yield each sensitivity with its whitened columns."""
    for i in range(0, len(sensitivities), CHUNK):
        part = sensitivities[i : i + CHUNK]
        ends = np.cumsum([s.columns.shape[1] for s in part])
        white = noise_model.whiten(np.hstack([s.columns for s in part]))
        yield from zip(part, np.split(white, ends[:-1], axis=1), strict=True)


def select_diverse(ranked: Sequence[Ranked], count: int, most: int = 3) -> list[Ranked]:
    """Select the best candidates, but few of the same cause.

    Args:
        ranked: candidates, best first.
        count: how many to select.
        most: how many locations of one cause to select; each of them once.
    """
    chosen: list[Ranked] = []
    used: dict[str, list[object]] = {}
    for one in ranked:
        candidate = one.sensitivity.candidate
        locations = used.setdefault(candidate.cause.id, [])
        if candidate.location in locations or len(locations) >= most:
            continue
        locations.append(candidate.location)
        chosen.append(one)
        if len(chosen) == count:
            break
    return chosen
