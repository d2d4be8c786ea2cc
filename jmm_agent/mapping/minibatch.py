"""Update rule of the paper: gradient steps on one batch of ten pairs (sec. II-C)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from jmm_agent.mapping.group_map import METRES, GroupMap
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.types import Floats


@dataclass(frozen=True)
class MinibatchRule:
    """Adam steps on the batch alone, in all layers or the output layer only.

    Attributes:
        steps: number of gradient steps of an update.
        rate: Adam's step size.
        all_layers: whether the hidden layer moves too.
    """

    steps: int = 10
    rate: float = 1e-2
    all_layers: bool = True

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        """The map after an update; see `learner.Rule`.

        Args:
            current: the map before.
            remembered: earlier pairs; not used.
            batch: the new pair, and pairs that are learned beside it.
        """
        groups = tuple(self._descend(group, batch) for group in current.groups)
        return replace(current, groups=groups)

    def _descend(self, group: GroupMap, batch: Pairs) -> GroupMap:
        target = batch.lengths[:, group.muscle_index] / METRES
        inputs = (batch.postures[:, group.joint_index] - group.centre) / group.scale
        weights = [group.W2.copy(), group.b2.copy(), group.W1.copy(), group.b1.copy()]
        moving = weights if self.all_layers else weights[:2]
        first = [np.zeros_like(w) for w in moving]
        second = [np.zeros_like(w) for w in moving]
        for step in range(1, self.steps + 1):
            slopes = _slopes(weights, inputs, target)
            for weight, slope, mean, square in zip(moving, slopes, first, second, strict=False):
                mean += 0.1 * (slope - mean)
                square += 0.001 * (slope**2 - square)
                root = np.sqrt(square / (1 - 0.999**step)) + 1e-8
                weight -= self.rate * mean / (1 - 0.9**step) / root
        W2, b2, W1, b1 = weights
        return replace(group, W1=W1, b1=b1, W2=W2, b2=b2)


def _slopes(weights: Sequence[Floats], inputs: Floats, target: Floats) -> list[Floats]:
    """Gradients of the mean squared error [mm^2] by output and hidden layer."""
    W2, b2, W1, b1 = weights
    hidden = 1.0 / (1.0 + np.exp(-(inputs @ W1.T + b1)))
    error = 2.0 * (hidden @ W2.T + b2 - target) / target.size
    back = (error @ W2) * hidden * (1.0 - hidden)
    return [error.T @ hidden, error.sum(axis=0), back.T @ inputs, back.sum(axis=0)]
