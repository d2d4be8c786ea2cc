"""Online learning of the map from pairs of postures and lengths (paper, sec. II-C).

Every update uses a batch: the new pair, the pair (0, 0), and random pairs of the current map, which
rehearse it. Two rules move the map:

* `RidgeRule`, the default, changes the output layers only: by the smallest change from the nominal
  map, weighed by its prior, that explains the batch and all remembered pairs.
* `minibatch.MinibatchRule` is the paper's: some gradient steps on the batch alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import MapPrior, with_unknown
from jmm_agent.types import Floats


class Pairs(NamedTuple):
    """Pairs to learn.

    Attributes:
        postures: (K, n) [rad].
        lengths: muscle lengths (K, m) [m]; NaN of muscles that were out of use.
        noise: standard deviation of the lengths of each pair (K,) [m].
    """

    postures: Floats
    lengths: Floats
    noise: Floats

    def joined(self, other: Pairs) -> Pairs:
        """These pairs, followed by others.

        Args:
            other: of the same joints and muscles.
        """
        return Pairs(*(np.concatenate(both) for both in zip(self, other, strict=True)))

    def last(self, count: int) -> Pairs:
        """The last pairs.

        Args:
            count: number of pairs; all if there are fewer.
        """
        return Pairs(*(part[len(part) - min(count, len(part)) :] for part in self))

    def with_unknown(self, muscle: int) -> Pairs:
        """These pairs, in which the length of a muscle is unknown.

        Args:
            muscle: its number.
        """
        return self._replace(lengths=with_unknown(self.lengths, muscle))

    @classmethod
    def none(cls, joints: int, muscles: int) -> Pairs:
        """No pairs, in arrays of the right shapes.

        Args:
            joints: number of joints, n.
            muscles: number of muscles, m.
        """
        return cls(np.empty((0, joints)), np.empty((0, muscles)), np.empty(0))


@dataclass(frozen=True)
class BatchOptions:
    """Pairs that are learned beside the new one.

    Attributes:
        rehearsal: number of random pairs of the current map (paper: 8).
        rehearsal_noise: standard deviation of their lengths [m]; used by the ridge rule.
        zero: whether the pair (0, 0) is learned.
        zero_noise: standard deviation of the lengths of (0, 0) [m]; used by the ridge rule. It is
            not small, because lengths may have been zeroed at a posture that was not zero.
    """

    rehearsal: int = 8
    rehearsal_noise: float = 0.03
    zero: bool = True
    zero_noise: float = 0.05


class Rule(Protocol):
    """Moves a map by a batch of pairs."""

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        """The map after an update.

        Args:
            current: the map before.
            remembered: earlier pairs, without the batch.
            batch: the new pair, and pairs that are learned beside it.
        """


@runtime_checkable
class PriorRule(Rule, Protocol):
    """A rule that uses the prior of the map's error."""

    def with_prior(self, prior: MapPrior) -> Rule:
        """The rule, after more became known of the map's error.

        Args:
            prior: of the map's error.
        """


@dataclass(frozen=True, eq=False)
class RidgeRule:
    """Smallest change of the output layers that explains remembered pairs and batch.

    Attributes:
        prior: of the nominal map, from which the change is counted.
    """

    prior: MapPrior

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        """The map after an update; see `Rule`.

        Args:
            current: the map before; it is only used by the rehearsal pairs of the batch.
            remembered: earlier pairs, without the batch.
            batch: the new pair, and pairs that are learned beside it.
        """
        return self.prior.corrected(*remembered.joined(batch))

    def with_prior(self, prior: MapPrior) -> RidgeRule:
        """The rule with another prior; see `PriorRule`."""
        return RidgeRule(prior)


class Learner:
    """Holds the map, and moves it by pairs.

    Args:
        start: the map before learning.
        limits: joint limits (n, 2) [rad], within which rehearsal postures are sampled.
        rule: how the map is moved.
        options: pairs of a batch.
        rng: samples rehearsal postures.

    Attributes:
        map: as learned so far.
        rule: how the map is moved.
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
        self._limits, self.rule, self._options = limits, rule, options
        self.rng = rng

    @property
    def uses_prior(self) -> bool:
        """Whether the rule uses the prior of the map's error."""
        return isinstance(self.rule, PriorRule)

    @property
    def prior(self) -> MapPrior | None:
        """Prior of the map's error, as known so far; None if the rule uses none."""
        return getattr(self.rule, "prior", None)

    def know(self, prior: MapPrior) -> None:
        """Use another prior of the map's error, if the rule uses one.

        Args:
            prior: by what became known of the robot.
        """
        if isinstance(self.rule, PriorRule):
            self.rule = self.rule.with_prior(prior)

    def batch(self, new: Pairs) -> Pairs:
        """The batch of an update: new pairs, (0, 0) and random pairs of the current map.

        Args:
            new: new pairs.
        """
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
        """Move the map by new pairs.

        Args:
            new: new pairs.
            remembered: earlier pairs.
        """
        self.map = self.rule.move(self.map, remembered, self.batch(new))
