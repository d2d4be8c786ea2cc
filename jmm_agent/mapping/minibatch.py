"""Update rule of the paper: gradient steps on one batch of ten pairs (sec. II-C)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.mapping.torch_process import shared


@dataclass(frozen=True)
class MinibatchRule:
    """Adam steps on the batch alone, in all layers or the output layer only.

    The steps are those of torch, in a process of its own that the first update starts (in some
    seconds) and that ends with this one; see `jmm_agent.mapping.torch_process`.

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

        Raises:
            TrainingError: the process that runs torch has failed.
        """
        groups, lengths = current.groups, batch.lengths
        if np.isnan(lengths).any():  # muscles that were out of use stay as they are
            lengths = np.where(np.isnan(lengths), current.lengths(batch.postures), lengths)
        moved = shared().call(
            "jmm_agent.networks.descent:descend",
            [group.layers for group in groups],
            [(batch.postures[:, g.joint_index] - g.centre) / g.scale for g in groups],
            [lengths[:, group.muscle_index] / METRES for group in groups],
            self.steps,
            self.rate,
            self.all_layers,
        )
        names = [group.name for group in groups]
        return current.with_layers(dict(zip(names, moved, strict=True)))
