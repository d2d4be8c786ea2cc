"""One online update of the map by the paper's rule: ours in numpy beside Adam in torch.

Both start from the same map and take the same batches of ten pairs, in turns on one core, with as
many Adam steps on each. Torch is plain: four networks, one loss, one optimiser that is new in each
update, as the rule's moments are; its weights stay its own, so that nothing is converted. In
float64 both must end in the same numbers. Torch comes with the extra ``[rl]``.
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

from jmm_agent.mapping.joint_muscle_map import METRES, JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.mapping.minibatch import MinibatchRule
from kengoro.trained_maps import trained_map
from kengoro_env.postures import posture_set

if TYPE_CHECKING:
    import torch

STEPS = (1, 10)
"""Adam steps in an update: the fewest, and those of the rule."""

BATCH = 10
COMPARED, TIMED = 10, 100
"""Updates after which the numbers are compared, and those that are timed."""

SHIFT = 0.01
"""Standard deviation of what the map has to learn of each length [m]."""

WEIGHTS = ("W1", "b1", "W2", "b2")


class TorchMap:
    """The four networks of a map as a torch user would write them, learning by Adam.

    Args:
        start: the map that it begins as.
        kind: "float32" or "float64".
        steps: Adam steps in an update.
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
        """Move the networks down the mean squared error [mm^2] of each group."""
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
        """Largest difference from the weights of ``ours``, whatever their unit."""
        return max(
            float(np.abs(parameter.detach().numpy() - getattr(group, name)).max())
            for group, network in zip(ours.groups, self.networks, strict=True)
            for name, parameter in zip(WEIGHTS, network.parameters(), strict=True)
        )


def batches(start: JointMuscleMap, count: int) -> list[Pairs]:
    """Batches of pairs whose lengths are off the map's by a random `SHIFT`."""
    rng = np.random.default_rng(0)
    made = []
    for _ in range(count):
        postures = posture_set()[rng.integers(len(posture_set()), size=BATCH)]
        lengths = start.lengths(postures)
        shifted = lengths + SHIFT * rng.standard_normal(lengths.shape)
        made.append(Pairs(postures, shifted, np.full(BATCH, SHIFT)))
    return made


def measure(start: JointMuscleMap, steps: int) -> tuple[dict[str, list[float]], dict[str, float]]:
    """Times of an update [s] by who made it, in turns; and how far torch's weights are from ours
    after `COMPARED` updates, by torch's precision."""
    rule = MinibatchRule(steps=steps)
    theirs = {kind: TorchMap(start, kind, steps, rule.rate) for kind in ("float64", "float32")}
    nothing = Pairs.none(len(start.joints), len(start.muscles))
    ours, apart = start, dict[str, float]()
    seconds: dict[str, list[float]] = {"ours": [], **{kind: [] for kind in theirs}}
    for number, batch in enumerate(batches(start, COMPARED + TIMED), start=1):
        begin = perf_counter()
        ours = rule.move(ours, nothing, batch)
        seconds["ours"].append(perf_counter() - begin)
        for kind, their in theirs.items():
            begin = perf_counter()
            their.update(batch)
            seconds[kind].append(perf_counter() - begin)
            if number == COMPARED:
                apart[kind] = their.difference(ours)
    return {who: taken[COMPARED:] for who, taken in seconds.items()}, apart


def main() -> None:
    """Print the table, or in one sentence that torch is missing."""
    try:
        import torch
    except ImportError:
        sys.exit("This benchmark needs torch, which is not installed: pip install 'kengoro[rl]'.")
    start = trained_map()
    table = Table(title=f"One update of the map by {BATCH} pairs, torch {torch.__version__}")
    heads = ("steps", "who", "median us", "99th us", "times ours", "difference")
    for head in heads:
        table.add_column(head, justify="left" if head == "who" else "right")
    for steps in STEPS:
        seconds, apart = measure(start, steps)
        for who, taken in seconds.items():
            ratio = np.median(np.divide(taken, seconds["ours"]))
            table.add_row(
                f"{steps}",
                "numpy float64" if who == "ours" else f"torch {who}",
                f"{1e6 * np.median(taken):.0f}",
                f"{1e6 * np.percentile(taken, 99):.0f}",
                "" if who == "ours" else f"{ratio:.2f}",
                "" if who == "ours" else f"{apart[who]:.1e}",
            )
    Console().print(table)
    print("Steps: of Adam in an update. Times ours: median of the ratios, update by update.")
    print(
        f"Difference: largest of all weights (hidden in 1, output in mm) after {COMPARED} updates."
    )


if __name__ == "__main__":
    main()
