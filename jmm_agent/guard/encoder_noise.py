"""Noise of encoders: which readings must change even at rest, and so show an encoder that sticks.

An encoder can only be found stuck if its own noise changes its reading. Motion changes it, too, but
smoothly. White noise of variance s^2 has second differences of variance 6 s^2, and two successive
differences have opposite signs in two of three cases. The noise is measured over short stretches
at rest, with an unchanged command. Its variance is the second least of many stretches: other
causes of changes, such as a swing that fades, are not present in all of them. An encoder whose
reading stayed the same for a stretch, and then moved on, has no noise.

A resolution q hides noise. Within the step of a reading the same value appears with a probability
of at most 0.4 q / s each time, the peak of the normal density. A reading that stays the same is
suspicious only if it does so more often than that makes likely.
"""

from __future__ import annotations

from math import log

import numpy as np

from jmm_agent.types import Bools, Floats

UNLIKELY = 1e-10
"""Probability of equal readings of an encoder that works, below which it is stuck."""
PEAK = 0.4
"""Peak of the density of a normal variable, times its standard deviation."""
COARSE = 0.7
"""Least noise of an encoder that can be found stuck, in steps of its resolution."""
CHANGED, TURNED = 0.5, 0.4
"""Least shares of readings that differ from those before, and of differences that change sign."""
STRETCH, READINGS = 0.18, 9
"""Least duration of a stretch [s], and its least number of readings."""
STRETCHES, REMEMBERED = 6, 40
"""Least number of stretches that show noise, and how many are remembered."""
LEAST = 2.0
"""By what the second least variance of many stretches is smaller than that of the noise [1]."""


class EncoderNoise:
    """Learns the noise of m encoders from their readings at rest.

    Args:
        count: number of encoders, m.
    """

    def __init__(self, count: int) -> None:
        self._resolution = np.full(count, np.inf)
        self._variances = np.full((REMEMBERED, count), np.inf)
        self._stretches = np.zeros(count, dtype=int)
        self.jump()

    def jump(self) -> None:
        """Forget the newest readings, with which the next ones cannot be compared."""
        count = len(self._resolution)
        self._moved = np.zeros(count)
        self._same = np.zeros(count, dtype=int)
        self._constant = np.zeros(count, dtype=bool)
        # Of the stretch: duration, readings, those that changed, pairs of these, pairs of opposite
        # sign, squares.
        self._sums = np.zeros((6, count))

    def update(self, dt: float, moved: Floats, at_rest: Bools) -> None:
        """Add one reading of each encoder.

        Args:
            dt: time since the reading before [s].
            moved: change since then (m,) [m].
            at_rest: muscles at rest, whose encoders are not known to fail (m,).
        """
        fresh = moved != 0.0
        if self._constant.any():  # a stretch of equal readings, and the encoder was not stuck
            self._store(self._constant & fresh, np.zeros(len(moved)))
            self._constant &= ~fresh
        np.minimum(self._resolution, np.abs(moved), out=self._resolution, where=fresh)
        self._same += 1
        self._same[fresh] = 0
        if at_rest.any():
            self._add(dt, moved, fresh, at_rest)
        else:
            self._sums[:] = 0.0
        self._moved = moved

    def _add(self, dt: float, moved: Floats, fresh: Bools, at_rest: Bools) -> None:
        """Add one reading of each encoder to its stretch; those that are not at rest begin anew."""
        duration, count, changed, pairs, turned, squares = self._sums
        opposite = moved * self._moved
        duration += dt
        count += 1.0
        changed += fresh
        pairs += opposite != 0.0
        turned += opposite < 0.0
        squares += (moved - self._moved) ** 2 / 6.0
        self._sums *= at_rest
        ended = (duration >= STRETCH) & (count >= READINGS)
        if ended.any():
            self._end(ended)

    def forgive(self, muscles: Bools) -> None:
        """Take no constant readings of some encoders (m,) as those of an encoder without noise."""
        self._constant &= ~muscles

    def are_stuck(self) -> Bools:
        """Whether each reading (m,) has been the same too often for the noise of its encoder."""
        variance = LEAST * np.partition(self._variances, 1, axis=0)[1]
        noisy = (
            (self._stretches >= STRETCHES)
            & np.isfinite(variance)
            & (variance > (COARSE * self._resolution) ** 2)
        )
        often = (
            PEAK * np.where(noisy, self._resolution, 1.0) / np.sqrt(np.where(noisy, variance, 1.0))
        )
        return noisy & (self._same >= log(UNLIKELY) / np.log(often))

    def _end(self, ended: Bools) -> None:
        """End the stretches of some encoders (m,)."""
        _, count, changed, pairs, turned, squares = self._sums
        most, to_and_fro = changed > CHANGED * count, turned > TURNED * pairs
        variance = squares / np.maximum(count, 1.0)
        same = self._same > READINGS // 2
        self._constant |= ended & same
        self._store(ended & ~same & (to_and_fro | ~most), variance)  # the others only move
        self._sums[:, ended] = 0.0

    def _store(self, muscles: Bools, variance: Floats) -> None:
        """Remember the variance (m,) [m^2] of a stretch of some encoders (m,)."""
        (at,) = np.nonzero(muscles)
        self._variances[self._stretches[at] % REMEMBERED, at] = variance[at]
        self._stretches[at] += 1
