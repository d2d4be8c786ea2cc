"""What an extended model gains on readings that served neither to fit nor to choose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reality_gap.diagnosis import Gain
from reality_gap.inference.likelihood import NoiseModel
from reality_gap.inference.whitening import tolerated
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, rough_noise
from reality_gap.study.splits import BLOCK, REPORT, split
from reality_gap.types import Floats

DRAWS = 1000


@dataclass(frozen=True)
class Score:
    """RMS of whitened residuals on the report split, and what an extension gains.

    Attributes:
        before, after, floor: RMS without and with the extension, and of the readings' own noise.
        gain: None where ``before`` is not surely above the floor.
        unexplained: share of the power above the floor that is left, 0 to 1.
        improvement: ``before - after``.
    """

    before: float
    after: float
    floor: float
    gain: Gain | None
    unexplained: float
    improvement: Gain


def score(study: Study, measured: Measured, before: Floats, after: Floats) -> Score:
    """Compare two residuals (n,) in units of noise; intervals by a bootstrap over time blocks."""
    use = split(measured) == REPORT
    floor = np.minimum(1.0, rough_noise(study) / _noise(study, measured))[measured.channel[use]]
    block = _blocks(measured, use)
    sums: Floats = np.column_stack(
        [
            np.bincount(block, weights)
            for weights in (before[use] ** 2, after[use] ** 2, floor**2, np.ones(int(use.sum())))
        ]
    )
    draws = np.array([_rms(sums[rows]) for rows in _resamples(len(sums))], dtype=np.float64)
    first, last, low = _rms(sums)
    room = draws[:, 0] - draws[:, 2]
    gain = None
    if np.quantile(room, 0.025) > 0.0:
        shares = (draws[:, 0] - draws[:, 1]) / room
        ends = np.quantile(shares, [0.025, 0.975])
        gain = Gain(float((first - last) / (first - low)), float(ends[0]), float(ends[1]))
    power = first**2 - low**2
    unexplained = float(np.clip((last**2 - low**2) / power, 0.0, 1.0)) if power > 0 else 0.0
    improvement = _with_interval(first - last, draws[:, 0] - draws[:, 1])
    return Score(first, last, low, gain, unexplained, improvement)


def likelihood_gain(noise_model: NoiseModel, after: Floats) -> Gain:
    """How much likelier an extension makes the report split, given the other splits [nats].

    Both residuals are compared after subtracting what the tolerances of the nominal model explain,
    as inferred from the other splits: the RMS of a faint fault is often below that of tolerances.

    Args:
        noise_model: tolerances, and how many readings count as one.
        after: (n,) residual with the extension, in units of sensor noise.
    """
    measured, spread = noise_model.measured, noise_model.spread
    use = split(measured) == REPORT

    def remaining(residual: Floats) -> Floats:
        return residual - tolerated(noise_model.tolerances, spread, ~use, residual)

    gain = 0.5 * (remaining(noise_model.null) ** 2 - remaining(after) ** 2) / spread
    sums = np.bincount(_blocks(measured, use), gain[use])
    return _with_interval(float(sums.sum()), sums[_resamples(len(sums))].sum(axis=1))


def pays(improvement: Gain, likelihood: Gain | None = None) -> bool:
    """Whether an extension surely predicts held-out readings better than the study's model.

    The interval of the RMS or of the likelihood must lie above zero, and the RMS must not surely be
    worse.
    """
    better = improvement.low > 0.0 or (likelihood is not None and likelihood.low > 0.0)
    return better and improvement.high > 0.0


def _blocks(measured: Measured, use: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number of the time block of each reading in use."""
    block = np.column_stack([measured.episode[use], np.floor(measured.time[use] / BLOCK)])
    return np.unique(block, axis=0, return_inverse=True)[1].ravel()


def _resamples(count: int) -> NDArray[np.int64]:
    """Bootstrap samples of ``count`` blocks, (`DRAWS`, count)."""
    return np.random.default_rng(0).integers(0, count, (DRAWS, count))


def _with_interval(value: float, draws: Floats) -> Gain:
    low, high = np.quantile(draws, [0.025, 0.975])
    return Gain(float(value), float(low), float(high))


def _rms(sums: Floats) -> tuple[float, float, float]:
    before, after, floor, count = sums.sum(axis=0)
    return (
        float(np.sqrt(before / count)),
        float(np.sqrt(after / count)),
        float(np.sqrt(floor / count)),
    )


def _noise(study: Study, measured: Measured) -> Floats:
    noise = np.ones(len(study.channels))
    for c in range(len(study.channels)):
        at = measured.channel == c
        if at.any():
            noise[c] = measured.noise[at][0]
    return noise
