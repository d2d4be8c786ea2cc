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
from reality_gap.types import Bools, Floats, Ints

CHUNK = 128
"""Number of sensitivities that are whitened at once, which is faster than one by one."""


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
    others = [s for s in sensitivities if not any(s.candidate.matches(c) for c in base.candidates)]
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
    noise = problem.noise_model
    use, channel = noise.whiten.use, problem.measured.channel
    ranked = []
    for one in sensitivities:
        if any(one.candidate.matches(c) for c in base.candidates):
            continue
        theta, variance = np.zeros(one.columns.shape[1]), _power(base.residual, use, channel)
        first = variance
        for _ in range(REWEIGHTINGS):
            weight = 1.0 / np.sqrt(variance[channel[use]])
            columns = one.columns[use] * weight[:, None]
            theta = lsq_linear(columns, base.residual[use] * weight, bounds=one.bounds()).x
            variance = _power(base.residual - one.columns @ theta, use, channel)
        counts = np.bincount(channel[use], 1.0 / noise.correlation[use], len(variance))
        gain = 0.5 * float(counts @ np.log(first / variance))
        ranked.append(Ranked(gain, one, np.asarray(theta)))
    return sorted(ranked, key=lambda one: -one.evidence)


def _power(residual: Floats, use: Bools, channel: Ints) -> Floats:
    """Return the variance of each channel, at least that of its noise [noise^2]."""
    square = np.bincount(channel[use], residual[use] ** 2, channel.max() + 1)
    return np.maximum(1.0, square / np.maximum(np.bincount(channel[use]), 1))


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
