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
import onnx
import torch
from torch import Tensor, nn

from kengoro.hand_detector.networks.augmentation import hide_parts, move_frames, vary_colours
from kengoro.hand_detector.networks.finder import FinderNetwork, finder_loss
from kengoro.hand_detector.networks.points import PointsNetwork, points_loss
from kengoro.hand_detector.networks.start import start_from
from mjcf_sandbox.files import whole_file

RATE = 3e-3
"""Largest step size of AdamW."""
STARTED_RATES = {"finder": 1e-3, "points": 5e-4}
"""The same from trained weights on."""
WARM_UP = 0.1
"""Share of the steps in which the step size rises; then it falls as a cosine [1]."""
HELD_BATCH = 64
"""Number of examples that are judged at a time."""
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
        batch: number of examples of a step.
        device: that computes, as PyTorch names it: ``cpu`` or ``cuda``.
        start: trained network as ONNX whose weights are the first ones; empty: random ones.
    """

    folder: str
    kind: str
    samples: int
    size: int
    count: int
    seed: int = 0
    threads: int = 2
    batch: int = 64
    device: str = "cpu"
    start: str = ""


class Examples:
    """Examples of a network, from all files of a folder.

    Args:
        job: what is trained.
    """

    def __init__(self, job: Job) -> None:
        paths = sorted(Path(job.folder).glob("examples_*.npz"))
        names = ("small", "cells") if job.kind == "finder" else ("crops", "positions", "present")
        self._tensors = [_joined(paths, name, job.device) for name in names]
        total = len(self._tensors[0])
        self._count, self._batch = int(total * (1.0 - HELD_OUT)), job.batch
        self._kind = job.kind

    def batch(self, random: np.random.Generator) -> list[Tensor]:
        """Pictures (b, 3, h, w) in [0, 1] of varied training examples, and their labels."""
        device = self._tensors[0].device
        chosen = torch.from_numpy(random.integers(self._count, size=self._batch)).to(device)
        pictures, *labels = (tensor[chosen] for tensor in self._tensors)
        pictures = vary_colours(pictures, random)
        if self._kind == "finder":
            return list(move_frames(pictures, labels[0], random))
        return [hide_parts(pictures, random), *labels]

    def held_out(self) -> list[Tensor]:
        """Pictures and labels of the examples that are not learned from, at most 1000."""
        pictures, *labels = (tensor[self._count :][:1000] for tensor in self._tensors)
        return [_planes(pictures), *labels]


def _joined(paths: list[Path], name: str, device: str) -> Tensor:
    """An array of all files one after the other, in memory once."""
    with np.load(paths[0]) as stored:
        row = torch.from_numpy(stored[name][:0])
    counts = []
    for path in paths:
        with np.load(path) as stored:
            counts.append(len(stored["cells" if name in ("small", "cells") else "present"]))
    joined = row.new_empty((sum(counts), *row.shape[1:]), device=device)
    for path, part in zip(paths, joined.split(counts), strict=True):
        with np.load(path) as stored:
            part.copy_(torch.from_numpy(stored[name]))
    return joined


def _planes(pictures: Tensor) -> Tensor:
    """Pictures (b, 3, h, w) in [0, 1] of (b, h, w, 3) uint8."""
    return pictures.permute(0, 3, 1, 2).float().div_(255.0)


def train(job: Job) -> nn.Module:
    """Train a network, or go on from its checkpoint.

    Args:
        job: what is trained.
    """
    torch.set_num_threads(job.threads)
    torch.manual_seed(job.seed)
    network = FinderNetwork() if job.kind == "finder" else PointsNetwork(job.count, job.size)
    network = network.to(device=job.device, memory_format=torch.channels_last)
    loss = finder_loss if job.kind == "finder" else points_loss
    steps = max(job.samples // job.batch, 1)
    rate = STARTED_RATES[job.kind] if job.start else RATE
    optimiser = torch.optim.AdamW(network.parameters(), rate, weight_decay=1e-2)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, partial(_rate, steps))
    examples, state = Examples(job), Path(job.folder) / f"{job.kind}.checkpoint"
    step, curve = _resume(state, network, optimiser, schedule)
    if job.start and step == 0:
        pictures = examples.batch(np.random.default_rng(job.seed))[0]
        taken, count = start_from(network, Path(job.start), pictures)
        print(json.dumps({"taken": taken, "of": count}), flush=True)
    held, saved, half = examples.held_out(), time.monotonic(), _has_half(job.device)
    if step >= steps:
        _report(job, curve, 1.0)
    while step < steps:
        pictures, *labels = examples.batch(np.random.default_rng([job.seed, step]))
        with torch.autocast(job.device, torch.bfloat16, enabled=half):
            outputs = network(pictures.to(memory_format=torch.channels_last))
        error = loss(outputs.float(), *labels)
        optimiser.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(network.parameters(), LARGEST_GRADIENT)
        optimiser.step()
        schedule.step()
        step += 1
        if step % max(steps // 40, 1) == 0 or step == steps:
            curve.append([step * job.batch, error.item(), _evaluate(network, loss, held)])
            _report(job, curve, step / steps)
        if time.monotonic() - saved > CHECKPOINT or step == steps:
            _save(state, network, optimiser, schedule, step, curve)
            saved = time.monotonic()
    return network


def _has_half(device: str) -> bool:
    """Whether a device multiplies numbers of 16 bits faster than those of 32."""
    return device != "cpu" or bool(torch.cpu.get_capabilities().get("avx512_bf16"))


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
            for part in zip(*(tensor.split(HELD_BATCH) for tensor in held), strict=True)
        ]
    network.train()
    return float(np.mean(parts))


def _report(job: Job, curve: list[list[float]], share: float) -> None:
    """One line of progress as JSON; the process that started this one shows it."""
    print(json.dumps({"kind": job.kind, "share": share, "curve": curve}), flush=True)


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
    content = torch.load(state, weights_only=True, map_location="cpu")
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
    network = network.cpu().eval()
    shape = (1, 3, job.size, job.size) if job.kind == "points" else (1, 3, 128, 160)
    names = {"input_names": ["picture"], "output_names": ["output"]}
    free = {"frames": {2: "h", 3: "w"}} if job.kind == "finder" else None
    torch.onnx.export(
        network, (torch.zeros(shape),), path, dynamo=True, external_data=False,
        dynamic_shapes=free, verbose=False, **names,
    )  # fmt: skip
    _forget_origin(path)


def _forget_origin(path: Path) -> None:
    """Remove what the exporter noted of source files and their folders from an ONNX file."""
    model = onnx.load(path)
    graph = model.graph
    for part in (model, graph, *graph.node, *graph.value_info, *graph.input, *graph.output,
                 *graph.initializer):  # fmt: skip
        del part.metadata_props[:]
        part.ClearField("doc_string")
    path.write_bytes(model.SerializeToString())


def main() -> None:
    """Train and export what the command line says as JSON."""
    job = Job(**json.loads(sys.argv[1]))
    network = train(job)
    export(network, job, Path(job.folder) / f"{job.kind}.onnx")


if __name__ == "__main__":
    main()
