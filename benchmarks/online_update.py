"""Time of an online update of the map by the ridge rule and by the paper's.

All learn from the same batches of ten pairs, one after the other on one core. The paper's rule runs
in a process of torch, to which the layers of the map travel and from which they come back; its
steps alone, in the process of the benchmark, show what that costs. Both must get the same bits.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table

from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs, RidgeRule, Rule
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.mapping.torch_process import shared
from kengoro.trained_maps import trained_map
from kengoro_env.postures import posture_set

STEPS = (1, 10)
"""Adam steps of an update: the smallest number, and that of the rule."""

BATCH = 10
"""Pairs of a batch."""

WARM, TIMED = 10, 100
"""Updates before the timed ones, which start torch and its process, and timed updates."""

SHIFT = 0.01
"""Standard deviation of the change of each length that the map has to learn [m]."""

Update = Callable[[JointMuscleMap, Pairs], JointMuscleMap]


def steps_alone(rule: MinibatchRule) -> Update:
    """The update of the paper's rule in this process.

    Args:
        rule: the rule.
    """
    import torch

    from jmm_agent.networks.descent import descend

    torch.set_num_threads(1)

    def update(current: JointMuscleMap, batch: Pairs) -> JointMuscleMap:
        groups = current.groups
        moved = descend(
            [group.layers for group in groups],
            [(batch.postures[:, g.joint_index] - g.centre) / g.scale for g in groups],
            [batch.lengths[:, group.muscle_index] / METRES for group in groups],
            rule.steps,
            rule.rate,
            rule.all_layers,
            lambda share: None,
        )
        return current.with_layers(
            {group.name: layers for group, layers in zip(groups, moved, strict=True)}
        )

    return update


def moved_by(rule: Rule, remembered: Pairs) -> Update:
    """The update of a rule that always remembers the same pairs.

    Args:
        rule: the rule.
        remembered: earlier pairs.
    """
    return lambda current, batch: rule.move(current, remembered, batch)


def batches(start: JointMuscleMap, count: int) -> list[Pairs]:
    """Batches of pairs whose lengths differ from the map's by normal noise of `SHIFT`.

    Args:
        start: the map.
        count: number of batches.
    """
    rng = np.random.default_rng(0)
    pairs = []
    for _ in range(count):
        postures = posture_set()[rng.integers(len(posture_set()), size=BATCH)]
        lengths = start.lengths(postures)
        shifted = lengths + SHIFT * rng.standard_normal(lengths.shape)
        pairs.append(Pairs(postures, shifted, np.full(BATCH, SHIFT)))
    return pairs


def measure(start: JointMuscleMap, updates: dict[str, Update]) -> dict[str, list[float]]:
    """Time updates, which take turns.

    Args:
        start: map that all start from.
        updates: what to time, by name.

    Returns:
        Times of the updates after the first `WARM` by name [s].

    Raises:
        AssertionError: the paper's rule has not the same bits in both processes.
    """
    maps = dict.fromkeys(updates, start)
    seconds: dict[str, list[float]] = {name: [] for name in updates}
    for batch in batches(start, WARM + TIMED):
        for name, update in updates.items():
            begin = perf_counter()
            maps[name] = update(maps[name], batch)
            seconds[name].append(perf_counter() - begin)
    for rank, steps in enumerate(STEPS):
        here, there = list(maps.values())[2 * rank : 2 * rank + 2]
        for one, other in zip(here.groups, there.groups, strict=True):
            same = all(map(np.array_equal, one.layers, other.layers))
            assert same, f"{steps} steps: the processes have different bits"
    return {name: times[WARM:] for name, times in seconds.items()}


def updates_of(start: JointMuscleMap) -> dict[str, Update]:
    """The updates to time: those of the paper's rule in pairs, then the ridge rule's.

    Args:
        start: the map before learning.
    """
    none = Pairs.none(len(start.joints), len(start.muscles))
    found: dict[str, Update] = {}
    for steps in STEPS:
        rule = MinibatchRule(steps=steps)
        named = f"paper's rule, {steps} step{'s' * (steps > 1)}"
        found[named] = moved_by(rule, none)
        found[f"{named}, without its process"] = steps_alone(rule)
    ridge = RidgeRule(MapPrior(start, posture_set(), PriorOptions()))
    found["ridge rule"] = moved_by(ridge, none)
    return found


def main() -> None:
    """Print the table."""
    start = trained_map()
    table = Table(title=f"One update of the map with {BATCH} pairs")
    for head in ("update", "median us", "99th percentile us"):
        table.add_column(head, justify="left" if head == "update" else "right")
    for name, times in measure(start, updates_of(start)).items():
        columns = np.median(times), np.percentile(times, 99)
        table.add_row(name, *(f"{1e6 * column:.0f}" for column in columns))
    shared().close()
    Console().print(table)


if __name__ == "__main__":
    main()
