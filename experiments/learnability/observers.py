"""Observers of a robot at rest: by true angles with noise, or by the pose of the marker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from experiments.robots.world import Rest, World
from jmm_agent.mapping.learner import Learner, Pairs
from jmm_agent.types import Floats
from jmm_agent.updaters import PairLengths, VisionOptions, VisionUpdater

ANGLE_NOISE = np.radians(0.5)
"""Standard deviation of the observed angles [rad]."""

Vision = Literal["true angles", "observations together", "one observation"]
RuleName = Literal["ridge", "minibatch", "minibatch, output layer"]


@dataclass(frozen=True)
class Variant:
    """A variant of learning.

    Attributes:
        vision: kind of observation.
        pair: lengths in a pair.
        rule: update rule of the map.
        learns: whether the agent learns.
    """

    vision: Vision = "observations together"
    pair: PairLengths = "min"
    rule: RuleName = "ridge"
    learns: bool = True


class Observer(Protocol):
    """Observes a robot at rest and learns from it."""

    @property
    def pairs(self) -> Pairs:
        """Pairs in the memory."""

    def observe(self, rest: Rest, antagonism: Pairs) -> Floats:
        """Observe joint angles, shape (n,) [rad], and learn the pair unless it is rejected."""


class TrueObserver:
    """Observer of true angles with noise."""

    def __init__(
        self, world: World, learner: Learner, variant: Variant, rng: np.random.Generator
    ) -> None:
        self._learner, self._rng = learner, rng
        self._options = VisionOptions(lengths=variant.pair)
        self._pairs = Pairs.none(len(world.limits), len(world.map.muscles))

    @property
    def pairs(self) -> Pairs:
        """Pairs in the memory."""
        return self._pairs

    def observe(self, rest: Rest, antagonism: Pairs) -> Floats:
        """See `Observer.observe`."""
        options = self._options
        angles = rest.true + ANGLE_NOISE * self._rng.standard_normal(len(rest.true))
        far = np.linalg.norm(angles - rest.estimate) >= options.threshold
        if not far and rest.tensions.max() < options.saturation:
            lengths = {
                "min": np.minimum(rest.lengths, rest.command),
                "l_target": rest.command,
                "l": rest.lengths,
            }[options.lengths or "min"]
            new = Pairs(angles[None], lengths[None], np.array([options.noise]))
            self._learner.learn(new, self._pairs.joined(antagonism))
            self._pairs = self._pairs.joined(new)
        return angles


class MarkerObserver:
    """Observer of the exact pose of the marker; observations are fitted together or alone."""

    def __init__(self, world: World, learner: Learner, variant: Variant) -> None:
        self._world = world
        fit: Literal["together", "alone"] = (
            "alone" if variant.vision == "one observation" else "together"
        )
        options = VisionOptions(lengths=variant.pair, fit=fit)
        self._updater = VisionUpdater(
            learner, world.prior, world.marker_residual, world.limits, options
        )

    @property
    def pairs(self) -> Pairs:
        """Pairs in the memory."""
        return self._updater.pairs

    def observe(self, rest: Rest, antagonism: Pairs) -> Floats:
        """See `Observer.observe`."""
        pose = self._world.marker(rest.true)
        return self._updater.seen(
            pose, rest.estimate, rest.lengths, rest.command, rest.tensions, antagonism
        ).angles
