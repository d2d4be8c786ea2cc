"""How a map is moved by the pairs that the updaters bring (paper, sec. II-C).

Every update takes a batch: the new pair, the pair (0, 0), and random pairs of the current map.
Two rules move the map by it:

* `RidgeRule` moves the output layers only, by the smallest change, counted from the drawing's map
  and weighed by its prior, that explains the batch and all pairs remembered. The default.
* `MinibatchRule` is the paper's: some gradient steps on the batch alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats


class Pairs(NamedTuple):
    """Pairs to learn: postures (K, n) [rad], lengths (K, m) [m], how exact each is (K,) [m]."""

    postures: Floats
    lengths: Floats
    noise: Floats

    def joined(self, other: Pairs) -> Pairs:
        """These pairs and the others."""
        return Pairs(*(np.concatenate(both) for both in zip(self, other, strict=True)))

    def last(self, count: int) -> Pairs:
        """The newest ``count`` pairs."""
        return Pairs(*(part[len(part) - min(count, len(part)) :] for part in self))

    @classmethod
    def none(cls, joints: int, muscles: int) -> Pairs:
        """No pairs, of the right shapes."""
        return cls(np.empty((0, joints)), np.empty((0, muscles)), np.empty(0))


@dataclass(frozen=True)
class BatchOptions:
    """What is learned beside the new pair.

    Attributes:
        rehearsal: number of random pairs of the current map (paper: 8).
        rehearsal_noise: how far they may be missed [m]; used by the ridge rule.
        zero: whether the pair (0, 0) is learned.
        zero_noise: how far the pair (0, 0) may be missed [m]; used by the ridge rule. Lengths may
            have been zeroed at a posture that was not zero, so this is no small number.
    """

    rehearsal: int = 8
    rehearsal_noise: float = 0.03
    zero: bool = True
    zero_noise: float = 0.05


class Rule(Protocol):
    """Moves a map by a batch of pairs."""

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        """The map after the update; ``remembered`` are the earlier pairs, without the batch."""


@dataclass(frozen=True, eq=False)
class RidgeRule:
    """Smallest change of the output layers that explains all pairs remembered and the batch."""

    prior: MapPrior

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        """See `Rule`; the current map enters by the batch's rehearsal pairs."""
        return self.prior.corrected(*remembered.joined(batch))


class Learner:
    """Holds the map and moves it by pairs.

    Args:
        start: the map before learning.
        limits: (n, 2) joint limits, from which rehearsal postures are drawn [rad].
        rule: how the map is moved.
        options: what is in a batch.
        rng: draws rehearsal postures.

    Attributes:
        map: as learned so far.
        rng: as given.
    """

    def __init__(
        self,
        start: JointMuscleMap,
        limits: Floats,
        rule: Rule,
        options: BatchOptions,
        rng: np.random.Generator,
    ) -> None:
        self.map = start
        self._limits, self._rule, self._options = limits, rule, options
        self.rng = rng

    def batch(self, new: Pairs) -> Pairs:
        """The update batch: new pairs, (0, 0) and random pairs of the current map."""
        options = self._options
        low, high = self._limits.T
        random = self.rng.uniform(low, high, (options.rehearsal, len(low)))
        rehearsed = Pairs(
            random, self.map.lengths(random), np.full(len(random), options.rehearsal_noise)
        )
        zero = Pairs(
            np.zeros((1, len(low))),
            np.zeros((1, len(self.map.muscles))),
            np.array([options.zero_noise]),
        )
        return new.joined(zero.last(int(options.zero))).joined(rehearsed)

    def learn(self, new: Pairs, remembered: Pairs) -> None:
        """Move the map by new pairs, given what is remembered beside them."""
        self.map = self._rule.move(self.map, remembered, self.batch(new))
