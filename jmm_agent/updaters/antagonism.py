"""Antagonism Updater: learns (theta_est, l) (paper, sec. III-B).

It relieves muscles that pull against each other or hang slack.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jmm_agent.mapping.learner import Learner, Pairs
from jmm_agent.types import Floats


@dataclass(frozen=True)
class AntagonismOptions:
    """Options of the Antagonism Updater (sec. III-B).

    Attributes:
        distance: least distance from the posture of the last update, L2 norm [rad].
        noise: standard deviation of a pair's lengths [m].
        memory: number of newest pairs that are remembered.
    """

    distance: float = 0.15
    noise: float = 0.01
    memory: int = 10


class AntagonismMemory(NamedTuple):
    """What the Antagonism Updater remembers.

    Attributes:
        last: posture (n,) [rad] of the last update; None before the first.
        pairs: the newest pairs.
    """

    last: Floats | None
    pairs: Pairs


class AntagonismUpdater:
    """Learns (theta_est, l) when the muscle lengths have settled (sec. III-B).

    Args:
        learner: holds the map.
        options: of the updater.

    Attributes:
        pairs: remembered pairs, the newest last.
        fired: number of updates.
    """

    def __init__(self, learner: Learner, options: AntagonismOptions) -> None:
        self._learner, self._options = learner, options
        self._last: Floats | None = None
        joints, muscles = len(learner.map.joints), len(learner.map.muscles)
        self.pairs = Pairs.none(joints, muscles)
        self.fired = 0

    @property
    def memory(self) -> AntagonismMemory:
        """All that is remembered; may be set to an earlier value."""
        return AntagonismMemory(self._last, self.pairs)

    @memory.setter
    def memory(self, earlier: AntagonismMemory) -> None:
        self._last, self.pairs = earlier

    def forget(self) -> None:
        """Forget all pairs, because lengths were zeroed anew."""
        self._last, self.pairs = None, self.pairs.last(0)

    def repaired(self, muscle: int) -> None:
        """Forget the lengths of a muscle that was mounted anew.

        Args:
            muscle: its number.
        """
        self.pairs = self.pairs.with_unknown(muscle)

    def settled(self, estimate: Floats, lengths: Floats, remembered: Pairs) -> bool:
        """Learn a pair if its posture is far enough from that of the last update.

        Args:
            estimate: theta_est (n,) [rad].
            lengths: measured lengths (m,) [m].
            remembered: pairs that the Vision Updater remembers.

        Returns:
            Whether the map was moved.
        """
        options = self._options
        if self._last is not None and np.linalg.norm(estimate - self._last) < options.distance:
            return False
        self._last = estimate.copy()
        new = Pairs(estimate[None], lengths[None], np.array([options.noise]))
        self._learner.learn(new, remembered.joined(self.pairs))
        self.pairs = self.pairs.joined(new).last(options.memory)
        self.fired += 1
        return True
