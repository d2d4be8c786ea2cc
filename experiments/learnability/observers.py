"""How a robot at rest is seen: by true angles, or by the pose of its marker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from experiments.robots.world import Rest, World
from jmm_agent.mapping.learner import Learner, Pairs
from jmm_agent.types import Floats
from jmm_agent.updaters import PairLengths, VisionOptions, VisionUpdater

ANGLE_NOISE = np.radians(0.5)

Vision = Literal["true angles", "looks together", "one look"]
RuleName = Literal["ridge", "minibatch", "minibatch, output layer"]


@dataclass(frozen=True)
class Variant:
    """How a robot is seen, what a pair holds, and by which rule the map is moved."""

    vision: Vision = "looks together"
    pair: PairLengths = "min"
    rule: RuleName = "ridge"
    learns: bool = True


class Watcher(Protocol):
    """Learns from a robot at rest by looking at it."""

    @property
    def pairs(self) -> Pairs:
        """Pairs that are remembered."""

    def look(self, rest: Rest, antagonism: Pairs) -> Floats:
        """Joint angles by vision (n,) [rad]; learns the pair unless it is in doubt."""


class TrueWatcher:
    """True angles with noise, in place of vision."""

    def __init__(
        self, world: World, learner: Learner, variant: Variant, rng: np.random.Generator
    ) -> None:
        self._learner, self._rng = learner, rng
        self._options = VisionOptions(lengths=variant.pair)
        self._pairs = Pairs.none(len(world.limits), len(world.map.muscles))

    @property
    def pairs(self) -> Pairs:
        """Pairs that are remembered."""
        return self._pairs

    def look(self, rest: Rest, antagonism: Pairs) -> Floats:
        """See `Watcher`."""
        options = self._options
        angles = rest.true + ANGLE_NOISE * self._rng.standard_normal(len(rest.true))
        far = np.linalg.norm(angles - rest.estimate) >= options.threshold
        if not far and rest.tensions.max() < options.saturation:
            lengths = {
                "min": np.minimum(rest.lengths, rest.command),
                "l_target": rest.command,
                "l": rest.lengths,
            }[options.lengths]
            new = Pairs(angles[None], lengths[None], np.array([options.noise]))
            self._learner.learn(new, self._pairs.joined(antagonism))
            self._pairs = self._pairs.joined(new)
        return angles


class MarkerWatcher:
    """The exact pose of the marker: looks fitted together with the wires, or each alone."""

    def __init__(self, world: World, learner: Learner, variant: Variant) -> None:
        self._world = world
        fit: Literal["together", "alone"] = "alone" if variant.vision == "one look" else "together"
        options = VisionOptions(lengths=variant.pair, fit=fit)
        self._updater = VisionUpdater(learner, world.prior, world.sight, world.limits, options)

    @property
    def pairs(self) -> Pairs:
        """Pairs that are remembered."""
        return self._updater.pairs

    def look(self, rest: Rest, antagonism: Pairs) -> Floats:
        """See `Watcher`."""
        pose = self._world.marker(rest.true)
        return self._updater.seen(
            pose, rest.estimate, rest.lengths, rest.command, rest.tensions, antagonism
        ).angles
