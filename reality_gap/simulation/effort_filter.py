"""Filter of measured and computed efforts, after which noise is white.

Let S_t be the power spectral density of the noise of a measured effort, and S_q that of a position.
To first order, the computed effort has the density (K^2 + D^2 w^2 + M^2 w^4) S_q at the angular
frequency w, where K, D and M are the derivatives of the inverse dynamics by position, velocity and
acceleration. It grows so fast that a common weight of all frequencies would hide whatever is slow.
Samples of measured and computed efforts, behind the same low-pass filter, are therefore multiplied
by the inverse root of the covariance of their difference, as in generalised least squares, over
that without noise of positions. A constant keeps the unit and size of the measured effort.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.linalg import eigh, toeplitz

from reality_gap.simulation.measured_motion import (
    EDGE,
    POSITION_BAND,
    Motion,
    gaps_of,
    interpolated,
    low_pass,
    passed,
)
from reality_gap.study.data import Reading
from reality_gap.types import Floats

BLOCK = 200
"""Largest number of samples that are weighted together."""
POSTURES = 50
"""Number of samples of a motion at which its inverse dynamics are differentiated."""
PRECISION = 1e-12
"""Least power of a covariance, over its largest one."""
STEP = 1e-6
"""Finite difference of these derivatives [SI units]."""


@dataclass(frozen=True)
class Weights:
    """Weights of the independent samples of an effort in one episode.

    Attributes:
        blocks: one matrix (b, b) for each b consecutive samples.
        white: mean square of the weighted samples of white noise with a deviation of 1.
    """

    blocks: tuple[Floats, ...]
    white: float

    def times(self, factor: float) -> Weights:
        """Return the weights times a factor."""
        return Weights(tuple(factor * block for block in self.blocks), factor**2 * self.white)

    def __call__(self, effort: Floats) -> Floats:
        """Return the weighted samples (n,) of a low-passed effort."""
        starts = np.cumsum([len(block) for block in self.blocks])[:-1]
        parts = np.split(effort, starts)
        if not self.blocks:
            return effort
        products = [block @ part for block, part in zip(self.blocks, parts, strict=True)]
        return np.concatenate(products)


def roll_off(
    model: mujoco.MjModel, motions: Sequence[Motion], noise: Floats, effort_noise: Floats
) -> Floats:
    """Return the coefficients a of S(w) / S(0) = 1 + a[0] w^2 + a[1] w^4 of each effort.

    Args:
        model: the nominal model.
        motions: the motion of each episode.
        noise: standard deviation of each position, shape (nv,).
        effort_noise: that of each effort at the same rate, shape (nv,).

    Returns:
        Shape (2, nv) [s^2] and [s^4].
    """
    smooth = model.__copy__()
    smooth.dof_frictionloss[:] = 0.0
    smooth.tendon_frictionloss[:] = 0.0
    smooth.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    by_position, by_velocity, by_acceleration = (
        noise**2 @ power for power in _derivative_powers(smooth, motions)
    )
    constant = np.maximum(effort_noise**2 + by_position, np.finfo(float).tiny)
    return np.stack([by_velocity / constant, by_acceleration / constant])


def _derivative_powers(model: mujoco.MjModel, motions: Sequence[Motion]) -> tuple[Floats, ...]:
    """Return mean squares of the derivatives of inverse dynamics, shape (nv, nv) each.

    A row belongs to a position, velocity or acceleration, and a column to an effort.
    """
    data, count = mujoco.MjData(model), 0
    found = [np.zeros((model.nv, model.nv)) for _ in range(3)]
    for motion in motions:
        read = np.flatnonzero(motion.is_read)
        for k in read[:: max(1, len(read) // POSTURES)]:
            data.qpos, data.qvel, data.qacc = motion.qpos[k], motion.qvel[k], motion.qacc[k]
            each = [np.zeros((model.nv, model.nv)) for _ in range(3)]
            mujoco.mjd_inverseFD(model, data, STEP, False, *each, None, None, None, None)
            found = [total + one**2 for total, one in zip(found, each, strict=True)]
            count += 1
    return tuple(total / count for total in found)


def independent_samples(motion: Motion, reading: Reading, dof: int, period: float) -> Reading:
    """Return the independent samples of a measured effort after the low-pass filter.

    Samples at which the joint stands still are left out, and those so near to a gap in the readings
    that the filter knows too little there.

    Args:
        motion: the motion along which it was measured.
        reading: the effort.
        dof: its degree of freedom.
        period: of the readings [s].
    """
    time = np.arange(motion.time[0], motion.time[-1] + 1e-9, period)
    raw = interpolated(reading, time)
    # Computed efforts are those of positions behind a filter.
    value = low_pass(low_pass(raw, POSITION_BAND * motion.cutoff, period), motion.cutoff, period)
    edge = int(np.ceil(EDGE / (motion.cutoff * motion.step)))
    kept = np.arange(edge, len(motion.time) - edge, _stride(motion))
    kept = kept[~motion.still[kept, dof]]
    for begin, end in [*motion.gaps, *gaps_of(reading, motion.cutoff)]:
        since, until = motion.time[kept] - begin, end - motion.time[kept]
        kept = kept[np.minimum(since, until) < -EDGE / motion.cutoff]
    return Reading(motion.time[kept], np.interp(motion.time[kept], time, value))


def weights(motion: Motion, time: Floats, coefficients: Floats, period: float) -> Weights:
    """Return the weights of the independent samples of an effort.

    Args:
        motion: the motion along which it was measured.
        time: times of the samples (n,) [s].
        coefficients: see `roll_off`, shape (2,).
        period: of the readings [s].
    """
    if not len(time):
        return Weights((), 0.0)
    step = _stride(motion) * motion.step
    index = np.rint((time - time[:1]) / step).astype(int)
    starts = np.flatnonzero(np.diff(index, prepend=-2) != 1)
    frequency = np.linspace(0.0, min(2.0 * motion.cutoff, 0.5 / period), 4000)
    share = passed(frequency, motion.cutoff) ** 2
    squared = (2 * np.pi * frequency) ** 2
    steep = coefficients[0] * squared + coefficients[1] * squared**2
    lags = np.cos(2 * np.pi * step * np.outer(np.arange(BLOCK), frequency))
    width = 2.0 * period * frequency[1]
    white, rest = width * lags @ share, width * lags @ (share * steep)
    blocks, total = [], 0.0
    for begin, end in zip(starts, [*starts[1:], len(time)], strict=True):
        for first in range(begin, end, BLOCK):
            count = min(BLOCK, end - first)
            of_effort = toeplitz(white[:count])
            block = _power(toeplitz((white + rest)[:count]), -0.5) @ _power(of_effort, 0.5)
            total += float(np.sum((block @ of_effort) * block))
            blocks.append(block)
    return Weights(tuple(blocks), total / len(time))


def _power(covariance: Floats, exponent: float) -> Floats:
    """Return a power of a covariance."""
    sizes, vectors = eigh(covariance)
    powers = np.maximum(sizes, PRECISION * sizes[-1]) ** exponent
    return np.asarray((vectors * powers) @ vectors.T)


def _stride(motion: Motion) -> int:
    """Return the number of samples of a motion between two independent samples."""
    return max(1, round(0.5 / (motion.cutoff * motion.step)))
