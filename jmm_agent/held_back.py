"""An update that made the map worse shows on the next look, which it was not learned from.

The newest look's pair is held back: before it is learned it tests the update before it. If the map
explains it much worse with that update than without, the update is undone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jmm_agent.learner import Pairs
from jmm_agent.mapping import JointMuscleMap


@dataclass(frozen=True)
class HeldBackOptions:
    """When an update has made the map worse, and not just a look noisy.

    Attributes:
        factor: it raised the error on the pair held back by this factor ...
        noise: ... and by this much beyond it [m].
    """

    factor: float = 1.5
    noise: float = 0.003


def made_worse(
    before: JointMuscleMap, after: JointMuscleMap, held_back: Pairs, options: HeldBackOptions
) -> bool:
    """Whether an update, from one map to the next, raised the error on pairs held back; not if
    there are none."""
    if not len(held_back.postures):
        return False
    return error(after, held_back) > options.factor * error(before, held_back) + options.noise


def error(jmm: JointMuscleMap, pairs: Pairs) -> float:
    """RMS over pairs and wires of what a map gets wrong [m]."""
    return float(np.sqrt(np.mean((jmm.lengths(pairs.postures) - pairs.lengths) ** 2)))
