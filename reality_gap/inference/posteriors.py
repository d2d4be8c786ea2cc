"""Posteriors: the hypotheses that the data leave, with weights and covariances.

Near an estimate the fit is linear, so that theta has a Gaussian whose information is A = J'J + P'P,
with whitened slopes J and prior weights P. Where the form of the causes is not exactly right, what
they leave pulls theta another way in each part of a log, by more than noise would. With the
whitened remainder e, the scores of the blocks b of a log are g_b = J_b' e_b, and the covariance is
that of the sandwich, A^-1 (sum of g_b g_b') A^-1 (White 1980, Liang and Zeger 1986), where it is
larger. A cause that the data cannot distinguish from others is
replaced by each of them; the weights are the tempered probabilities of `Alternatives`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from reality_gap.inference.equivalence import Alternatives
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import GOOD, free_parameters, prior_weights, to_theta
from reality_gap.inference.tolerances import Tolerance
from reality_gap.posterior import Branch, normalised
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.splits import blocks
from reality_gap.types import Floats

MOST = 64
"""Number of branches of a posterior, the likeliest ones."""


def joint_covariance(problem: Problem, fitted: Fit) -> Floats:
    """Return the covariance of theta, shape (p, p), by noise or by what blocks of the log show.

    It is the larger one in each direction. Of few blocks, it is too large: by a quarter for four
    parameters and twelve blocks of a right model.
    """
    root, noise_model = _root(problem, fitted), problem.noise_model
    columns, left = noise_model.whiten(fitted.jacobian), noise_model.whiten(fitted.residual)
    block = blocks(problem.measured)[noise_model.whiten.use]
    scores = np.zeros((int(block.max()) + 1, columns.shape[1]))
    np.add.at(scores, block, columns * left[:, None])
    scores = scores[np.unique(block)]
    scores -= scores.mean(axis=0)  # at a bound, their sum is not zero
    # In units of the noise's deviations; no direction becomes more certain.
    size, directions = np.linalg.eigh(root.T @ (scores.T @ scores) @ root)
    wider = root @ directions * np.sqrt(np.maximum(1.0, size))
    return np.asarray(wider @ wider.T, dtype=np.float64)


def covariance_by_noise(problem: Problem, fitted: Fit) -> Floats:
    """Return the covariance of theta in the linearised fit of a right model, shape (p, p)."""
    root = _root(problem, fitted)
    return np.asarray(root @ root.T, dtype=np.float64)


def _root(problem: Problem, fitted: Fit) -> Floats:
    """Return R, with the covariance R R' of theta by noise, shape (p, p).

    The information is not formed, in which directions of little effect would be lost.
    """
    weights = prior_weights(fitted.hypothesis)
    columns = problem.noise_model.whiten(fitted.jacobian)
    least = 1e-6 * np.eye(len(weights))
    triangle = np.linalg.qr(np.vstack([columns, np.diag(weights), least]), mode="r")
    return np.asarray(np.linalg.inv(triangle), dtype=np.float64)


def search_branches(
    problem: Problem, best: Fit, found: Sequence[Alternatives]
) -> tuple[Branch, ...]:
    """Return the named causes, and the same with equivalent causes in their place.

    Where several causes are replaced at once, each has the value and the slopes of the fit in which
    it alone was replaced, because equivalent causes change the readings alike.

    Args:
        problem: what is explained.
        best: the named causes.
        found: the alternatives to each of them, in their order.
    """
    combinations: list[tuple[float, list[Fit]]] = [(1.0, [])]
    for one in found:
        longer = [
            (weight * chance, [*chosen, fitted])
            for weight, chosen in combinations
            for fitted, chance in _choices(best, one)
        ]
        combinations = sorted(longer, key=lambda pair: -pair[0])[:MOST]
    branches = []
    for weight, chosen in combinations:
        combined = _combined(best, chosen)
        if combined is not None:
            branches.append(
                Branch(combined.hypothesis, joint_covariance(problem, combined), weight)
            )
    return normalised(branches)


def tolerance_branch(tolerances: Sequence[Tolerance]) -> Branch:
    """Return the model within its tolerances, each parameter by itself.

    Deviations are Gaussian, with the tolerances as their standard deviations, and at most `GOOD`
    tolerances, up to which a model is good.
    """
    grouped: dict[tuple[str, object], list[Tolerance]] = {}
    for one in tolerances:
        key = (one.candidate.cause.id, one.candidate.location)
        grouped.setdefault(key, []).append(one)
    candidates = [_tolerable(some) for some in grouped.values()]
    hypothesis = [(candidate, candidate.null_values()) for candidate in candidates]
    sizes = {
        (one.candidate.cause.id, one.candidate.location, one.parameter.name): abs(
            one.size / one.parameter.scale
        )
        for one in tolerances
    }
    variance = [
        sizes.get((candidates[i].cause.id, candidates[i].location, p.name), 0.0) ** 2
        for i, p in free_parameters(hypothesis)
    ]
    return Branch(hypothesis, np.diag(variance))


def _choices(best: Fit, one: Alternatives) -> Iterator[tuple[Fit, float]]:
    """Yield the fits with a cause and with its equivalents, and their probabilities."""
    for fitted, chance in zip(one.tried, one.confidence, strict=True):
        own = fitted.hypothesis is best.hypothesis
        if own:
            yield best, float(chance)
        elif any(fitted.candidates[-1].matches(other) for other in one.equivalent):
            yield fitted, float(chance)


def _combined(best: Fit, chosen: Sequence[Fit]) -> Fit | None:
    """Return the best fit with the chosen replacements; None if a candidate is in it twice."""
    replaced = [fitted for fitted in chosen if fitted is not best]
    if not replaced:
        return best
    if len(replaced) == 1:
        return replaced[0]
    owner = np.array([i for i, _ in free_parameters(best.hypothesis)])
    parts, columns = [], []
    for i, fitted in enumerate(chosen):
        if fitted is best:
            parts.append(best.hypothesis[i])
            columns.append(best.jacobian[:, owner == i])
        else:
            parts.append(fitted.hypothesis[-1])
            columns.append(fitted.jacobian[:, -len(fitted.candidates[-1].parameters) :])
    for i, (candidate, _) in enumerate(parts):
        if any(candidate.matches(other) for other, _ in parts[:i]):
            return None
    return replace(best, hypothesis=parts, jacobian=np.hstack(columns), theta=to_theta(parts))


def _tolerable(tolerances: Sequence[Tolerance]) -> Candidate:
    """Return the candidate of tolerances with bounds of `GOOD` tolerances."""
    candidate, limits = tolerances[0].candidate, {t.parameter.name: t.size for t in tolerances}
    parameters = []
    for p in candidate.parameters:
        most = GOOD * abs(limits.get(p.name, 0.0))
        low, high = max(p.low, p.null - most), min(p.high, p.null + most)
        parameters.append(replace(p, low=low, high=high))
    return replace(candidate, parameters=tuple(parameters))
