"""Held-out scores: how well an extended model predicts readings that it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reality_gap.diagnosis import Gain
from reality_gap.inference.gauss_newton import Fit
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import prior_weights
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, rough_noise
from reality_gap.study.splits import REPORT, blocks, split
from reality_gap.types import Bools, Floats, Ints

SAMPLES = 1000
"""Number of bootstrap samples of an interval."""
SHOWN = 0.01
"""Share of the power of a change that lies in the report split, a quarter of the log, below which
the report split does not show it."""
LEAST_WEIGHT = 0.1
"""Least prior weight of a parameter in a refit to one split, which may not show it at all."""


@dataclass(frozen=True)
class Score:
    """Comparison of two models by the RMS of their residuals on the report split.

    Attributes:
        before, after: RMS without and with the extension, in units of noise.
        floor: RMS of the readings' own noise.
        gain: (before - after) / (before - floor); None if ``before`` is not surely above the floor.
        unexplained: share of the power above the floor that remains, 0 to 1.
        improvement: ``before - after``.
    """

    before: float
    after: float
    floor: float
    gain: Gain | None
    unexplained: float
    improvement: Gain


def is_shown(measured: Measured, change: Floats) -> bool:
    """Return whether the report split shows a change of a residual (n,).

    A short event may lie between two of its blocks.
    """
    report = split(measured) == REPORT
    return not float(np.sum(change[report] ** 2)) < SHOWN * float(np.sum(change**2))


def score(
    study: Study, measured: Measured, before: Floats, after: Floats, use: Bools | None = None
) -> Score:
    """Compare two residuals on the report split; intervals are those of a bootstrap over blocks.

    Args:
        study: the study.
        measured: its readings.
        before, after: residuals without and with an extension in units of noise, shape (n,).
        use: by which readings to compare, shape (n,), in place of the report split.
    """
    use = split(measured) == REPORT if use is None else use
    floor = np.minimum(1.0, rough_noise(study)[measured.channel] / measured.noise)[use]
    block = np.unique(blocks(measured)[use], return_inverse=True)[1]
    sums: Floats = np.column_stack(
        [
            np.bincount(block, weights)
            for weights in (before[use] ** 2, after[use] ** 2, floor**2, np.ones(int(use.sum())))
        ]
    )
    samples = np.array([_rms(sums[rows]) for rows in _resamples(len(sums))], dtype=np.float64)
    first, last, low = _rms(sums)
    excess = samples[:, 0] - samples[:, 2]
    gain = None
    if np.quantile(excess, 0.025) > 0.0:
        shares = (samples[:, 0] - samples[:, 1]) / excess
        ends = np.quantile(shares, [0.025, 0.975])
        gain = Gain(float((first - last) / (first - low)), float(ends[0]), float(ends[1]))
    unexplained = share_left(first, last, low)
    improvement = _with_interval(first - last, samples[:, 0] - samples[:, 1])
    return Score(first, last, low, gain, unexplained, improvement)


def share_left(before: float, after: float, floor: float) -> float:
    """Return the share of the power above the floor that is left, 0 to 1.

    Args:
        before, after: RMS before and after [noise].
        floor: RMS of the noise alone [noise].
    """
    power = before**2 - floor**2
    return float(np.clip((after**2 - floor**2) / power, 0.0, 1.0)) if power > 0.0 else 0.0


def selection_score(problem: Problem, fitted: Fit) -> float:
    """Return the gain in log likelihood of the selection split by a fit to the fit split [nats].

    One linear step moves the parameters from their fit to both splits to that to the fit split.

    Args:
        problem: what is to be explained.
        fitted: a fit to both splits.
    """
    noise_model = problem.noise_model
    weights = np.maximum(prior_weights(fitted.hypothesis), LEAST_WEIGHT)
    columns, left = noise_model.whiten_fit(fitted.jacobian), noise_model.whiten_fit(fitted.residual)
    matrix = np.vstack([columns, np.diag(weights)])
    right = np.concatenate([left, -weights * fitted.theta])
    step = np.linalg.lstsq(matrix, right, rcond=None)[0]

    def power(residual: Floats) -> float:
        both = np.sum(noise_model.whiten(residual) ** 2)
        return float(both - np.sum(noise_model.whiten_fit(residual) ** 2))

    return 0.5 * (power(problem.null_residual) - power(fitted.residual - fitted.jacobian @ step))


def _resamples(count: int) -> Ints:
    """Return bootstrap samples of ``count`` blocks, shape (`SAMPLES`, count)."""
    return np.random.default_rng(0).integers(0, count, (SAMPLES, count))


def _with_interval(value: float, samples: Floats) -> Gain:
    low, high = np.quantile(samples, [0.025, 0.975])
    return Gain(float(value), float(low), float(high))


def _rms(sums: Floats) -> tuple[float, float, float]:
    before, after, floor, count = sums.sum(axis=0)
    return (
        float(np.sqrt(before / count)),
        float(np.sqrt(after / count)),
        float(np.sqrt(floor / count)),
    )
