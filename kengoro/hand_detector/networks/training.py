"""Training of the networks of a hand detector, and their export as ONNX.

``python -m kengoro.hand_detector.networks.training`` runs it in a process of its own; what it needs
to know comes as JSON, see `Job`. Checkpoints lie beside the examples: a run that was stopped goes
on from the last one, and ends with the same weights.
"""

from __future__ import annotations

import json
import math
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from kengoro.hand_detector.networks.finder import FinderNetwork, finder_loss
from kengoro.hand_detector.networks.points import PointsNetwork, points_loss
from mjcf_sandbox.files import whole_file

BATCH = 64
RATE = 3e-3
"""Largest step size of AdamW."""
WARM_UP = 0.1
"""Share of the steps in which the step size rises; then it falls as a cosine [1]."""
HELD_OUT = 0.04
"""Share of the examples that are not learned from: the last ones [1]."""
CHECKPOINT = 60.0
"""Time between checkpoints [s]."""
LARGEST_GRADIENT = 5.0
TOLERANCE = 1e-3
"""Largest difference of an exported network's outputs from PyTorch's."""


@dataclass(frozen=True)
class Job:
    """What is trained.

    Attributes:
        folder: of the files of examples; checkpoints and networks are written there.
        kind: ``finder`` or ``points``.
        samples: number of examples that are learned from, each several times.
        size: of the crops [px].
        count: number of points.
        seed: of weights and order.
        threads: number of threads.
    """

    folder: str
    kind: str
    samples: int
    size: int
    count: int
    seed: int = 0
    threads: int = 2


class Examples:
    """Examples of a network, from all files of a folder.

    Args:
        job: what is trained.
    """

    def __init__(self, job: Job) -> None:
        paths = sorted(Path(job.folder).glob("examples_*.npz"))
        names = ("small", "cells") if job.kind == "finder" else ("crops", "positions", "present")
        parts = []
        for path in paths:
            with np.load(path) as stored:
                parts.append([stored[name] for name in names])
        self._arrays = [np.concatenate([part[i] for part in parts]) for i in range(len(names))]
        self._count = int(len(self._arrays[0]) * (1.0 - HELD_OUT))

    def batch(self, random: np.random.Generator) -> list[Tensor]:
        """Pictures (b, 3, h, w) in [0, 1] of training examples, and their labels."""
        chosen = random.integers(self._count, size=BATCH)
        picture, *labels = (array[chosen] for array in self._arrays)
        pictures = torch.from_numpy(picture).permute(0, 3, 1, 2).float().div_(255.0)
        gain = random.normal(1.0, 0.15, (BATCH, 3, 1, 1)).astype(np.float32)
        bias = random.normal(0.0, 0.06, (BATCH, 3, 1, 1)).astype(np.float32)
        pictures = (pictures * torch.from_numpy(gain) + torch.from_numpy(bias)).clamp_(0.0, 1.0)
        return [pictures, *map(torch.from_numpy, labels)]

    def held_out(self) -> list[Tensor]:
        """Pictures and labels of the examples that are not learned from, at most 1000."""
        picture, *labels = (array[self._count :][:1000] for array in self._arrays)
        pictures = torch.from_numpy(picture).permute(0, 3, 1, 2).float().div_(255.0)
        return [pictures, *map(torch.from_numpy, labels)]


def train(job: Job) -> nn.Module:
    """Train a network, or go on from its checkpoint.

    Args:
        job: what is trained.
    """
    torch.set_num_threads(job.threads)
    torch.manual_seed(job.seed)
    network = FinderNetwork() if job.kind == "finder" else PointsNetwork(job.count, job.size)
    network = network.to(memory_format=torch.channels_last)
    loss = finder_loss if job.kind == "finder" else points_loss
    steps = max(job.samples // BATCH, 1)
    optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, partial(_rate, steps))
    examples, state = Examples(job), Path(job.folder) / f"{job.kind}.checkpoint"
    step, curve = _resume(state, network, optimiser, schedule)
    held, saved = examples.held_out(), time.monotonic()
    while step < steps:
        pictures, *labels = examples.batch(np.random.default_rng([job.seed, step]))
        error = loss(network(pictures.to(memory_format=torch.channels_last)), *labels)
        optimiser.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(network.parameters(), LARGEST_GRADIENT)
        optimiser.step()
        schedule.step()
        step += 1
        if step % max(steps // 40, 1) == 0 or step == steps:
            curve.append([step * BATCH, error.item(), _evaluate(network, loss, held)])
            _report(job, curve, step / steps)
        if time.monotonic() - saved > CHECKPOINT or step == steps:
            _save(state, network, optimiser, schedule, step, curve)
            saved = time.monotonic()
    return network


def _rate(steps: int, step: int) -> float:
    """Step size of a step, as a share of the largest one."""
    rising = WARM_UP * steps
    if step < rising:
        return (step + 1.0) / (rising + 1.0)
    return 0.5 + 0.5 * math.cos(math.pi * (step - rising) / (steps - rising))


def _evaluate(network: nn.Module, loss: object, held: list[Tensor]) -> float:
    """Mean loss on examples that are not learned from."""
    network.eval()
    with torch.no_grad():
        parts = [
            float(loss(network(part[0]), *part[1:]))  # type: ignore[operator]
            for part in zip(*(tensor.split(BATCH) for tensor in held), strict=True)
        ]
    network.train()
    return float(np.mean(parts))


def _report(job: Job, curve: list[list[float]], share: float) -> None:
    """One line of progress as JSON; the process that started this one shows it."""
    print(json.dumps({"kind": job.kind, "share": share, "curve": curve[-1]}), flush=True)


def _save(state: Path, network: nn.Module, optimiser: object, schedule: object, step: int,
          curve: list[list[float]]) -> None:  # fmt: skip
    content = {
        "network": network.state_dict(), "optimiser": optimiser.state_dict(),  # type: ignore[attr-defined]
        "schedule": schedule.state_dict(), "step": step, "curve": curve,  # type: ignore[attr-defined]
    }  # fmt: skip
    with whole_file(state) as beside:
        torch.save(content, beside)


def _resume(
    state: Path, network: nn.Module, optimiser: object, schedule: object
) -> tuple[int, list[list[float]]]:
    """Number of steps that a checkpoint has done, and its curve."""
    if not state.exists():
        return 0, []
    content = torch.load(state, weights_only=True)
    network.load_state_dict(content["network"])
    optimiser.load_state_dict(content["optimiser"])  # type: ignore[attr-defined]
    schedule.load_state_dict(content["schedule"])  # type: ignore[attr-defined]
    return content["step"], content["curve"]


def export(network: nn.Module, job: Job, path: Path) -> None:
    """Write a network as ONNX.

    Args:
        network: the network.
        job: what was trained.
        path: of the file.
    """
    network.eval()
    shape = (1, 3, job.size, job.size) if job.kind == "points" else (1, 3, 128, 160)
    names = {"input_names": ["picture"], "output_names": ["output"]}
    free = {"frames": {2: "h", 3: "w"}} if job.kind == "finder" else None
    torch.onnx.export(
        network, (torch.zeros(shape),), path, dynamo=True, external_data=False,
        dynamic_shapes=free, verbose=False, **names,
    )  # fmt: skip


def main() -> None:
    """Train and export what the command line says as JSON."""
    job = Job(**json.loads(sys.argv[1]))
    network = train(job)
    export(network, job, Path(job.folder) / f"{job.kind}.onnx")


if __name__ == "__main__":
    main()
