"""Held-out marker observations, which show whether an update made the map worse.

Of the observations that are believed, one in five is not learned from. If a map fits these much
worse after an update than before, the update was learned from a wrong observation, such as a
displaced marker, and is undone. If several updates in a row do so, the robot itself has changed
since the observations were held out: then they are forgotten, and the update stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs


@dataclass(frozen=True)
class HoldOutOptions:
    """Which observations are held out, and when an update counts as harmful.

    Attributes:
        every: one in this number of believed observations is held out.
        memory: number of newest held-out observations that are remembered.
        least: least number of held-out observations by which an update is judged.
        factor: a harmful update raises their error by more than this factor [1] ...
        noise: ... plus this length [m].
        patience: after this number of harmful updates in a row, the observations are forgotten
            instead.
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
                "HoldOutOptions: every must be 2 or more, memory, least and patience 1 or more."
            )


class HoldOutMemory(NamedTuple):
    """What a `HoldOut` remembers.

    Attributes:
        believed: number of believed observations so far.
        in_a_row: number of harmful updates since the last one that was not.
        pairs: held-out pairs, the newest last.
    """

    believed: int
    in_a_row: int
    pairs: Pairs


class HoldOut:
    """Pairs of the held-out observations, and the judgement of updates by them.

    They stay when the updater's ``memory`` is set to an earlier value: one wrong pair among them
    does not move their median.

    Args:
        options: which observations are held out, and when an update is harmful.
        joints: number of joints, n.
        muscles: number of muscles, m.

    Attributes:
        pairs: held-out pairs, the newest last; none of them was learned.
    """

    def __init__(self, options: HoldOutOptions, joints: int, muscles: int) -> None:
        self._options = options
        self._believed = self._in_a_row = 0
        self.pairs = Pairs.none(joints, muscles)

    @property
    def memory(self) -> HoldOutMemory:
        """All that is remembered; may be set to that of a file."""
        return HoldOutMemory(self._believed, self._in_a_row, self.pairs)

    @memory.setter
    def memory(self, earlier: HoldOutMemory) -> None:
        self._believed, self._in_a_row, self.pairs = earlier

    def forget(self) -> None:
        """Forget all pairs, because lengths were zeroed anew."""
        self._in_a_row, self.pairs = 0, self.pairs.last(0)

    def repaired(self, muscle: int) -> None:
        """Forget the lengths of a muscle that was mounted anew.

        Args:
            muscle: its number.
        """
        self.pairs = self.pairs.with_unknown(muscle)

    def keeps(self, pair: Pairs) -> bool:
        """Whether the pair of a believed observation is held out, and must not be learned.

        Args:
            pair: of the observation.
        """
        self._believed += 1
        if self._believed % self._options.every:
            return False
        self.pairs = self.pairs.joined(pair).last(self._options.memory)
        return True

    def harmed(self, before: JointMuscleMap, after: JointMuscleMap) -> bool:
        """Whether an update made the map worse and must be undone.

        Args:
            before: the map before the update.
            after: the map after the update.
        """
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
        """Median over pairs of the RMS over muscles [m]; one wrong pair changes it little.

        Muscles that were out of use do not count.
        """
        errors = jmm.lengths(self.pairs.postures) - self.pairs.lengths
        return float(np.median(np.sqrt(np.nanmean(errors**2, axis=1))))
