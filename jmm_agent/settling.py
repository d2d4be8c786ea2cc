"""When the wires have come to rest: the moment at which a pair is worth learning."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from jmm_agent.drawing import Floats


@dataclass(frozen=True)
class SettlingOptions:
    """When lengths count as settled.

    Attributes:
        window: how long the lengths must have been still [s].
        change: how little they may change over the window [m].
        release: how far they must move before they can settle anew [m].
    """

    window: float = 0.4
    change: float = 0.0008
    release: float = 0.004


class SettlingDetector:
    """Says once per settling that the lengths have come to rest (paper, sec. III-B)."""

    def __init__(self, options: SettlingOptions) -> None:
        self._options = options
        self._history: deque[tuple[float, Floats]] = deque()
        self._rest: Floats | None = None
        self.since = np.inf
        """Time from which the lengths have been at rest [s]; infinite while they move."""

    def reset(self) -> None:
        """Forget everything, as at the start of an episode."""
        self._history.clear()
        self._rest = None
        self.since = np.inf

    def update(self, time: float, lengths: Floats) -> bool:
        """Take lengths (m,) [m] at ``time`` [s]; True at the moment when they have settled."""
        options = self._options
        lengths = np.array(lengths, dtype=float)
        self._history.append((time, lengths))
        while time - self._history[0][0] > options.window + 1e-9:
            self._history.popleft()
        if self._rest is not None:
            if np.abs(lengths - self._rest).max() > options.release:
                self._rest, self.since = None, np.inf
            return False
        if time - self._history[0][0] < options.window - 1e-9:
            return False
        if any(np.abs(lengths - past).max() > options.change for _, past in self._history):
            return False
        self._rest, self.since = lengths, time - options.window
        return True
