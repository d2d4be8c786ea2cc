"""Time of an online update of the map by the paper's rule, in NumPy and in torch.

Both start from the same map, learn from the same batches of ten pairs, and do the same number of
Adam steps on each batch, alternately on one core. The torch version has four networks, one loss,
and a new optimiser in each update, because the rule resets Adam's moments as well. It keeps its own
weights, so no time is spent on conversions of them. In float64 both must get the same weights.
Torch comes with the extra ``[rl]``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from jmm_agent.mapping.group_map import METRES
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.mapping.minibatch import MinibatchRule
from kengoro.trained_maps import trained_map
from kengoro_env.postures import posture_set

if TYPE_CHECKING:
    import torch

STEPS = (1, 10)
"""Adam steps of an update: the smallest number, and that of the rule."""

BATCH = 10
"""Pairs of a batch."""

COMPARED, TIMED = 10, 100
"""Updates after which the weights are compared, and further updates, which are timed."""

SHIFT = 0.01
"""Standard deviation of the change of each length that the map has to learn [m]."""

WEIGHTS = ("W1", "b1", "W2", "b2")
"""Weights of a group, in the order of torch's parameters."""


class TorchMap:
    """Networks of a map in torch, which learn by Adam.

    Args:
        start: map whose weights are copied.
        kind: precision, "float32" or "float64".
        steps: Adam steps of an update.
        rate: Adam's step size.
    """

    def __init__(self, start: JointMuscleMap, kind: str, steps: int, rate: float) -> None:
        import torch

        torch.set_num_threads(1)
        self._torch, self._kind = torch, getattr(torch, kind)
        self._steps, self._rate, self._groups = steps, rate, start.groups
        self.networks = []
        for group in start.groups:
            hidden, inputs = group.W1.shape
            network = torch.nn.Sequential(
                torch.nn.Linear(inputs, hidden),
                torch.nn.Sigmoid(),
                torch.nn.Linear(hidden, group.muscle_index.size),
            ).to(self._kind)
            for parameter, name in zip(network.parameters(), WEIGHTS, strict=True):
                parameter.data = self._tensor(getattr(group, name))
            self.networks.append(network)

    def _tensor(self, array: Any) -> torch.Tensor:
        return self._torch.tensor(array, dtype=self._kind)

    def update(self, batch: Pairs) -> None:
        """Reduce the mean squared error [mm^2] of each group.

        Args:
            batch: pairs of postures [rad] and lengths [m].
        """
        torch = self._torch
        pairs = [
            (
                self._tensor((batch.postures[:, group.joint_index] - group.centre) / group.scale),
                self._tensor(batch.lengths[:, group.muscle_index] / METRES),
            )
            for group in self._groups
        ]
        parameters = [p for network in self.networks for p in network.parameters()]
        optimiser = torch.optim.Adam(parameters, lr=self._rate)
        for _ in range(self._steps):
            optimiser.zero_grad()
            losses = [
                torch.nn.functional.mse_loss(network(inputs), target)
                for network, (inputs, target) in zip(self.networks, pairs, strict=True)
            ]
            torch.stack(losses).sum().backward()
            optimiser.step()

    def difference(self, ours: JointMuscleMap) -> float:
        """Largest difference of a weight from that of ``ours``; the units of the weights differ."""
        return max(
            float(np.abs(parameter.detach().numpy() - getattr(group, name)).max())
            for group, network in zip(ours.groups, self.networks, strict=True)
            for name, parameter in zip(WEIGHTS, network.parameters(), strict=True)
        )


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


def measure(start: JointMuscleMap, steps: int) -> tuple[dict[str, list[float]], dict[str, float]]:
    """Run both versions alternately.

    Args:
        start: map that both start from.
        steps: Adam steps of an update.

    Returns:
        Times of the updates by version, "ours" or torch's precision [s]; largest difference of the
        weights after `COMPARED` updates, by torch's precision.
    """
    rule = MinibatchRule(steps=steps)
    torch_maps = {kind: TorchMap(start, kind, steps, rule.rate) for kind in ("float64", "float32")}
    no_pairs = Pairs.none(len(start.joints), len(start.muscles))
    ours, differences = start, dict[str, float]()
    seconds: dict[str, list[float]] = {"ours": [], **{kind: [] for kind in torch_maps}}
    for number, batch in enumerate(batches(start, COMPARED + TIMED), start=1):
        begin = perf_counter()
        ours = rule.move(ours, no_pairs, batch)
        seconds["ours"].append(perf_counter() - begin)
        for kind, torch_map in torch_maps.items():
            begin = perf_counter()
            torch_map.update(batch)
            seconds[kind].append(perf_counter() - begin)
            if number == COMPARED:
                differences[kind] = torch_map.difference(ours)
    return {version: times[COMPARED:] for version, times in seconds.items()}, differences


def main() -> None:
    """Print the table; exit with a message if torch is missing."""
    try:
        import torch
    except ImportError:
        sys.exit("This benchmark needs torch, which is not installed: pip install 'kengoro[rl]'.")
    start = trained_map()
    table = Table(title=f"One update of the map with {BATCH} pairs, torch {torch.__version__}")
    heads = ("steps", "version", "median us", "99th percentile us", "ratio", "difference")
    for head in heads:
        table.add_column(head, justify="left" if head == "version" else "right")
    for steps in STEPS:
        seconds, differences = measure(start, steps)
        for version, times in seconds.items():
            ratio = np.median(np.divide(times, seconds["ours"]))
            table.add_row(
                f"{steps}",
                "NumPy float64" if version == "ours" else f"torch {version}",
                f"{1e6 * np.median(times):.0f}",
                f"{1e6 * np.percentile(times, 99):.0f}",
                "" if version == "ours" else f"{ratio:.2f}",
                "" if version == "ours" else f"{differences[version]:.1e}",
            )
    Console().print(table)
    print(
        "Steps: Adam steps of an update. Ratio: median of time / time of NumPy, update by update."
    )
    print(f"Difference: largest of all weights (hidden [1], output [mm]) after {COMPARED} updates.")


if __name__ == "__main__":
    main()
