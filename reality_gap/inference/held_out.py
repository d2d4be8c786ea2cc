"""What an extended model gains on readings that served neither to fit nor to choose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reality_gap.diagnosis import Gain
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, rough_noise
from reality_gap.study.splits import BLOCK, REPORT, split

Array = NDArray[np.float64]

DRAWS = 1000


@dataclass(frozen=True)
class Score:
    """RMS of whitened residuals on the report split, and what an extension gains.

    Attributes:
        before, after, floor: RMS without and with the extension, and of the readings' own noise.
        gain: None where ``before`` is not surely above the floor.
        unexplained: share of the power above the floor that is left, 0 to 1.
        pays: whether the 95 % interval of ``before - after`` lies above zero.
    """

    before: float
    after: float
    floor: float
    gain: Gain | None
    unexplained: float
    pays: bool


def score(study: Study, measured: Measured, before: Array, after: Array) -> Score:
    """Compare two residuals (n,) in units of noise; intervals by a bootstrap over time blocks."""
    use = split(measured) == REPORT
    floor = np.minimum(1.0, rough_noise(study) / _noise(study, measured))[measured.channel[use]]
    block = np.unique(
        np.column_stack([measured.episode[use], np.floor(measured.time[use] / BLOCK)]),
        axis=0,
        return_inverse=True,
    )[1].ravel()
    sums: Array = np.column_stack(
        [
            np.bincount(block, weights)
            for weights in (before[use] ** 2, after[use] ** 2, floor**2, np.ones(int(use.sum())))
        ]
    )
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(sums), (DRAWS, len(sums)))
    draws = np.array([_rms(sums[rows]) for rows in drawn], dtype=np.float64)
    first, last, low = _rms(sums)
    room = draws[:, 0] - draws[:, 2]
    gain = None
    if np.quantile(room, 0.025) > 0.0:
        shares = (draws[:, 0] - draws[:, 1]) / room
        ends = np.quantile(shares, [0.025, 0.975])
        gain = Gain(float((first - last) / (first - low)), float(ends[0]), float(ends[1]))
    power = first**2 - low**2
    unexplained = float(np.clip((last**2 - low**2) / power, 0.0, 1.0)) if power > 0 else 0.0
    pays = bool(np.quantile(draws[:, 0] - draws[:, 1], 0.025) > 0.0)
    return Score(first, last, low, gain, unexplained, pays)


def _rms(sums: Array) -> tuple[float, float, float]:
    before, after, floor, count = sums.sum(axis=0)
    return (
        float(np.sqrt(before / count)),
        float(np.sqrt(after / count)),
        float(np.sqrt(floor / count)),
    )


def _noise(study: Study, measured: Measured) -> Array:
    noise = np.ones(len(study.channels))
    for c in range(len(study.channels)):
        at = measured.channel == c
        if at.any():
            noise[c] = measured.noise[at][0]
    return noise
