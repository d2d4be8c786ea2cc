"""Looks that are not learned from: they tell whether an update made the map worse.

Of the looks that are believed, one in five is held back. An update with which the map explains
these looks much worse than before was learned from something wrong, such as a marker that is not
where it seems, and is undone. Where one update after the other does so, the robot is not what it
was when the looks were held back: then they are forgotten, and the update stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs


@dataclass(frozen=True)
class HoldOutOptions:
    """Which looks are held back, and when an update counts as harmful.

    Attributes:
        every: of so many looks that are believed, the last is held back.
        memory: so many are remembered.
        least: fewer tell nothing.
        factor: a harmful update raises their error by more than this factor ...
        noise: ... and this much [m].
        patience: after so many harmful updates in a row the looks are forgotten instead.
    """

    every: int = 5
    memory: int = 10
    least: int = 2
    factor: float = 1.5
    noise: float = 0.0005
    patience: int = 2

    def __post_init__(self) -> None:
        if min(self.every - 1, self.memory, self.least, self.patience) < 1:
            raise AgentError(
                "Looks held back: every must be 2 or more, memory, least and patience 1 or more."
            )


class HoldOut:
    """Pairs of the looks that are held back, and what they say about updates.

    They stay when the updater's ``memory`` is set to what it was before: one wrong pair among
    them does not move their median.

    Args:
        options: see there.

    Attributes:
        pairs: newest last; none of them was learned.
    """

    def __init__(self, options: HoldOutOptions, joints: int, muscles: int) -> None:
        self._options = options
        self._believed = self._in_a_row = 0
        self.pairs = Pairs.none(joints, muscles)

    def keeps(self, pair: Pairs) -> bool:
        """Whether the pair of a look that is believed is held back, and must not be learned."""
        self._believed += 1
        if self._believed % self._options.every:
            return False
        self.pairs = self.pairs.joined(pair).last(self._options.memory)
        return True

    def harmed(self, before: JointMuscleMap, after: JointMuscleMap) -> bool:
        """Whether an update is to be undone, since it made the map worse."""
        options = self._options
        if len(self.pairs.noise) < options.least:
            return False
        if self._error(after) <= options.factor * self._error(before) + options.noise:
            self._in_a_row = 0
            return False
        if self._in_a_row == options.patience:
            self._in_a_row, self.pairs = 0, self.pairs.last(0)
            return False
        self._in_a_row += 1
        return True

    def _error(self, jmm: JointMuscleMap) -> float:
        """Median over pairs of the RMS over wires [m]: a wrong pair changes little."""
        errors = jmm.lengths(self.pairs.postures) - self.pairs.lengths
        return float(np.median(np.sqrt(np.mean(errors**2, axis=1))))
