"""When the muscle lengths have come to rest: the moment at which a pair is worth learning."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import comb

import numpy as np

from jmm_agent.types import Floats

ROUNDING = 1e-3
"""Share of the window by which time stamps may fall short of it: they are rounded."""
NOISES = 6.0
"""Standard deviations of the encoder noise by which a length at rest may change."""
SAMPLES = 200
"""Newest samples from which the encoder noise is estimated."""
FEWEST = 50
"""Samples without which it is not."""
ORDER = 8
"""Of the differences between successive samples that show the noise. Motion has next to none of
this order; of a swing, five samples a period leave 3 % of the amplitude, ten leave 0.02 %."""
MEDIAN = 0.6745
"""Median of the absolute value of a normal variable, in standard deviations."""


@dataclass(frozen=True)
class SettlingOptions:
    """When lengths count as settled.

    Attributes:
        window: how long the lengths must have been still [s].
        change: how little they may change over the window [m]; noisier encoders are allowed
            `NOISES` standard deviations of their own noise, half of ``release`` at most.
        release: how far they must move before they can settle anew [m].
    """

    window: float = 0.4
    change: float = 0.0008
    release: float = 0.004


class SettlingDetector:
    """Says once per settling that the lengths have come to rest (paper, sec. III-B).

    Samples may come at any rate up to one per window, evenly or not. A sample that is not newer
    than the one before is skipped, and after a gap longer than the window observation begins anew.
    """

    def __init__(self, options: SettlingOptions) -> None:
        self._options = options
        self._history: deque[tuple[float, Floats]] = deque()
        self._recent: deque[Floats] = deque(maxlen=SAMPLES)
        self._rest: Floats | None = None
        self.since = np.inf
        """Time from which the lengths have been at rest [s]; infinite while they move."""

    def reset(self) -> None:
        """Forget where the lengths were, as at the start of an episode, but not their noise."""
        self._history.clear()
        self._rest = None
        self.since = np.inf

    def update(self, time: float, lengths: Floats) -> bool:
        """Take lengths (m,) [m] at ``time`` [s]; True at the moment when they have settled."""
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
        """Drop samples that the window does not need; whether the others cover it."""
        begin = time - self._options.window * (1.0 - ROUNDING)
        while len(self._history) > 1 and self._history[1][0] <= begin:
            self._history.popleft()
        return self._history[0][0] <= begin

    def _still(self, lengths: Floats) -> bool:
        """Whether the window holds no other lengths than these, within the noise of encoders."""
        still, most = self._options.change, self._options.release / 2.0
        if np.abs(lengths - self._history[0][1]).max() >= most:
            return False
        change = np.max([np.abs(lengths - past) for _, past in self._history], axis=0)
        if np.all(change <= still):
            return True
        if np.any(change >= most):
            return False
        return bool(np.all(change <= np.maximum(still, NOISES * self._noise())))

    def _noise(self) -> Floats:
        """Standard deviation (m,) [m] of each encoder, from high differences of its readings.

        The median is not moved by the jerks of a motion.
        """
        if len(self._recent) < FEWEST:
            return np.zeros(len(self._recent[0]))
        differences = np.abs(np.diff(np.array(self._recent), ORDER, axis=0))
        return np.asarray(np.median(differences, axis=0) / (MEDIAN * comb(2 * ORDER, ORDER) ** 0.5))
