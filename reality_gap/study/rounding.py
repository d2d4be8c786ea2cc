"""Errors by rounding, which are alike in readings of the same position.

A reading is rounded to a step q after noise of the standard deviation s was added. The mean of its
error depends on where the true value x lies between two multiples of q: it is a series of waves

    (-1)^k q / (pi k) exp(-2 (pi k s / q)^2) sin(2 pi k x / q),   k = 1, 2, ...

Noise makes it small, but more readings of the same value do not. Values that move through the steps
have all of these errors, with a mean of zero. Which readings share an error therefore follows from
the motion, which a replay of the nominal model shows. Around each reading, it stays for n readings
within half a step and for m within a step: m is 2 n if the values move on evenly, and n if they
rest. So 2 n - m readings in a row share an error.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, channel_noise, rounding_steps, values_held
from reality_gap.types import Floats, Ints

NEIGHBOUR = 1.01
"""Distance up to which values are those of one position, in steps."""
WAVES = 20
"""Number of waves of the error that are summed."""


def with_shared_rounding(study: Study, readings: Measured, prediction: Floats) -> Measured:
    """Return readings (n,) whose errors by rounding count once where they are shared.

    Args:
        study: the study.
        readings: its readings.
        prediction: readings that the nominal model predicts, shape (n,) [SI units]; episodes in
            which it is not finite, and channels that are not rounded or hold their values, keep the
            noise that they have.
    """
    steps, noise = rounding_steps(study), readings.noise.copy()
    held = values_held(study, steps)
    for c, (step, own) in enumerate(zip(steps, channel_noise(study), strict=True)):
        if step == 0.0 or held[c] > 1:
            continue
        shared = _shared_variance(float(own), float(step))
        for e in np.unique(readings.episode):
            at = (readings.channel == c) & (readings.episode == e)
            if np.isfinite(prediction[at]).all():
                # What rests in the model may have moved.
                rests = _stay(readings.value[at] / step, NEIGHBOUR) - 1.0
                others = np.minimum(_others(prediction[at] / step), rests)
                noise[at] = np.sqrt(own**2 + others * shared)
    return replace(readings, noise=noise)


def _shared_variance(noise: float, step: float) -> float:
    """Return the variance over all positions of the mean error by rounding.

    Args:
        noise: standard deviation of one reading, that of rounding included.
        step: to which readings are rounded.
    """
    k = np.arange(1, WAVES + 1)
    added = max(noise**2 - step**2 / 12.0, 0.0)
    damped = np.exp(-((2.0 * np.pi * k / step) ** 2) * added)
    return float(np.sum(step**2 / (2.0 * np.pi**2 * k**2) * damped))


def _others(position: Floats) -> Floats:
    """Return how many others share the error of each reading at positions (k,) in steps, (k,)."""
    return np.maximum(2.0 * _stay(position, 0.5) - _stay(position, 1.0) - 1.0, 0.0)


def _stay(position: Floats, distance: float) -> Floats:
    """Return for how many readings in a row positions (k,) are that close to each of them, (k,)."""
    after, before = _after(position, distance), _after(position[::-1], distance)[::-1]
    return (after + before + 1).astype(np.float64)


def _after(position: Floats, distance: float) -> Ints:
    """Return how many positions (k,) in a row after each one are that close to it, shape (k,).

    Blocks of 2^i positions that are close as a whole are added, long ones first.
    """
    count = len(position)
    tops, bottoms = [position], [position]
    while 2 ** len(tops) <= count:
        half = 2 ** (len(tops) - 1)
        tops.append(np.maximum(tops[-1][:-half], tops[-1][half:]))
        bottoms.append(np.minimum(bottoms[-1][:-half], bottoms[-1][half:]))
    found = np.zeros(count, dtype=np.int64)
    for i in reversed(range(len(tops))):
        start = np.arange(count) + found + 1
        inside = start < len(tops[i])
        at = np.where(inside, start, 0)
        close = (tops[i][at] - position <= distance) & (position - bottoms[i][at] <= distance)
        found += np.where(inside & close, 2**i, 0)
    return found
