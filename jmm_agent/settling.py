"""Detects when the muscle lengths have settled (paper, sec. III-B)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np

from jmm_agent.types import Floats

ROUNDING = 1e-3
"""Share of the window by which rounded time stamps may fall short of it."""
NOISES = 6.0
"""Standard deviations of the encoder noise by which a length at rest may change."""
SAMPLES = 200
"""Newest samples from which the encoder noise is estimated."""
FEWEST = 50
"""Least number of samples for that estimate."""
ORDER = 8
"""Order of the differences between successive samples that show the noise.

Motion has almost no differences of this order: 3 % of the amplitude of a swing with five samples in
a period, 0.02 % with ten."""
MEDIAN = 0.6745
"""Median of the absolute value of a normal variable, in standard deviations."""


@dataclass(frozen=True)
class SettlingOptions:
    """Thresholds of settling.

    Attributes:
        window: time for which the lengths must have been still [s].
        change: largest change over the window [m]; encoders with more noise may change by `NOISES`
            standard deviations of it, but by less than half of ``release``.
        release: change that ends a rest [m].
    """

    window: float = 0.4
    change: float = 0.0008
    release: float = 0.004


class Unrest(NamedTuple):
    """The muscle that kept the lengths from settling most.

    Attributes:
        muscle: its index.
        change: its change over the window [m].
        allowed: the largest change that counts as settled [m].
        window: duration of the window [s].
    """

    muscle: int
    change: float
    allowed: float
    window: float

    @property
    def sentence(self) -> str:
        """What was measured, and what would have been settled."""
        return (
            f"changed by {1e3 * self.change:.2g} mm within {self.window:g} s, but only "
            f"{1e3 * self.allowed:.2g} mm count as settled"
        )


class SettlingDetector:
    """Detects once per rest that the lengths have settled.

    Samples may arrive at any rate, regularly or not. A sample that is not newer than the one before
    is skipped; after a gap longer than the window, the samples before it are dropped.

    Args:
        options: thresholds.

    Attributes:
        since: time from which the lengths have been at rest [s]; infinite while they move.
    """

    def __init__(self, options: SettlingOptions) -> None:
        self._options = options
        self._history: deque[tuple[float, Floats]] = deque()
        self._recent: deque[Floats] = deque(maxlen=SAMPLES)
        self._rest: Floats | None = None
        self.since = np.inf

    def reset(self) -> None:
        """Forget the lengths, as at the start of an episode, but not their noise."""
        self._history.clear()
        self._rest = None
        self.since = np.inf

    def update(self, time: float, lengths: Floats) -> bool:
        """Add one sample.

        Args:
            time: of the sample [s].
            lengths: measured muscle lengths (m,) [m].

        Returns:
            True once per rest, when the lengths have settled.
        """
        options = self._options
        if self._history and time <= self._history[-1][0]:
            return False
        if self._history and time - self._history[-1][0] > options.window:
            self._history.clear()
        lengths = np.array(lengths, dtype=float)
        self._history.append((time, lengths))
        self._recent.append(lengths)
        if self._rest is not None:
            if np.abs(lengths - self._rest).max() > options.release:
                self._rest, self.since = None, np.inf
            self._trim(time)
            return False
        if not self._trim(time) or not self._still(lengths):
            return False
        self._rest, self.since = lengths, time - options.window
        return True

    def _trim(self, time: float) -> bool:
        """Drop samples from before the window; whether the others cover it."""
        begin = time - self._options.window * (1.0 - ROUNDING)
        while len(self._history) > 1 and self._history[1][0] <= begin:
            self._history.popleft()
        return self._history[0][0] <= begin

    def _still(self, lengths: Floats) -> bool:
        """Whether all lengths in the window equal these, within the noise of the encoders."""
        still, most = self._options.change, self._options.release / 2.0
        if np.abs(lengths - self._history[0][1]).max() >= most:
            return False
        change = self._change(lengths)
        if np.all(change <= still):
            return True
        if np.any(change >= most):
            return False
        worst = change.argmax()  # decides almost always, and costs a tenth of all muscles
        if change[worst] > NOISES * self._noise(worst):
            return False
        return bool(np.all(change <= np.maximum(still, NOISES * self._noise())))

    def _change(self, lengths: Floats) -> Floats:
        """Largest difference (m,) [m] of each length in the window from these."""
        past = np.array([earlier for _, earlier in self._history])
        return np.asarray(np.abs(lengths - past).max(axis=0))

    @property
    def unrest(self) -> Unrest | None:
        """The muscle that moved most in the window, by what is allowed; None without samples."""
        if not self._history:
            return None
        options = self._options
        change = self._change(self._history[-1][1])
        most = options.release / 2.0
        allowed = np.clip(NOISES * self._noise(), options.change, max(most, options.change))
        muscle = int(np.argmax(change / allowed))
        return Unrest(muscle, float(change[muscle]), float(allowed[muscle]), options.window)

    def _noise(self, muscles: slice | np.intp = slice(None)) -> Floats:
        """Standard deviation [m] of the encoders of some muscles, from differences of readings.

        A median, so that jerks of a motion do not matter.
        """
        readings = np.array(self._recent)[:, muscles]
        if len(readings) < FEWEST:
            return np.zeros(readings.shape[1:])
        differences = np.abs(np.diff(readings, ORDER, axis=0))
        return np.asarray(np.median(differences, axis=0) / (MEDIAN * comb(2 * ORDER, ORDER) ** 0.5))
