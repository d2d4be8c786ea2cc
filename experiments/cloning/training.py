"""Training of a cloned policy by PyTorch, in a process of its own: it and drawing do not share one.

``python -m experiments.cloning.training JOB`` reads ``examples`` (npz with ``inputs`` (K, D),
``commands`` (K, m + 1) and ``groups`` (K,)) and writes ``policy`` (npz), which
`experiments.cloning.policy` reads. JOB is JSON with these paths, ``epochs`` and ``seed``.

The loss is the mean square of the standardised commands' error. The weights are those of the epoch
with the smallest loss on the held-out groups, such as robots: the last tenth of them.
"""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from experiments.cloning.features import EXACT
from experiments.cloning.policy import standardised
from mjcf_sandbox.files import write_bytes

WIDTH = 256
"""Units of each of the two hidden layers."""
BATCH = 256
RATE = 1e-3
"""Learning rate at the start; it falls to zero as a cosine."""
NOISE = 1.0
"""Deviation of what is added to the standardised readings, but not to time and can. The agent's
commands hardly depend on the readings, which follow them; a policy that takes its commands from
such readings repeats its own errors until the arm is lost."""
HELD_OUT = 0.1
"""Share of the groups by which the epoch is chosen."""


def main(job: dict[str, Any]) -> None:
    """Train one policy, and write it."""
    torch.manual_seed(job["seed"])
    torch.set_num_threads(1)
    with np.load(job["examples"], allow_pickle=False) as stored:
        inputs, commands, groups = stored["inputs"], stored["commands"], stored["groups"]
    scales = {
        "input_mean": inputs.mean(axis=0), "input_scale": _scale(inputs),
        "output_mean": commands.mean(axis=0), "output_scale": _scale(commands),
    }  # fmt: skip
    held_out = np.isin(groups, _held_out(groups))
    x = _tensor(standardised(inputs, scales["input_mean"], scales["input_scale"]))
    y = _tensor((commands - scales["output_mean"]) / scales["output_scale"])
    network = nn.Sequential(
        nn.Linear(x.shape[1], WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU(),
        nn.Linear(WIDTH, y.shape[1]),
    )  # fmt: skip
    losses = _fit(network, (x[~held_out], y[~held_out]), (x[held_out], y[held_out]), job["epochs"])
    weights = {
        name.replace(".", "_"): values.numpy() for name, values in network.state_dict().items()
    }
    content = io.BytesIO()
    np.savez(content, losses=np.array(losses), **scales, **weights)
    write_bytes(Path(job["policy"]), content.getvalue())


def _fit(network: nn.Sequential, learned: Any, held_out: Any, epochs: int) -> list[list[float]]:
    """Train; the losses of each epoch, on what is learned from and on what is held out."""
    optimizer = torch.optim.Adam(network.parameters(), lr=RATE, weight_decay=1e-5)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, epochs)
    inputs, commands = learned
    noise = torch.full(inputs.shape[1:], NOISE)
    noise[-EXACT:] = 0.0
    best, losses = (np.inf, network.state_dict()), []
    for _ in range(epochs):
        total = 0.0
        for batch in torch.randperm(len(inputs)).split(BATCH):
            noisy = inputs[batch] + noise * torch.randn_like(inputs[batch])
            loss = nn.functional.mse_loss(network(noisy), commands[batch])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total += loss.item() * len(batch)
        schedule.step()
        with torch.no_grad():
            new = float(nn.functional.mse_loss(network(held_out[0]), held_out[1]))
        losses.append([total / len(inputs), new])
        if new < best[0]:
            best = new, {name: values.clone() for name, values in network.state_dict().items()}
    network.load_state_dict(best[1])
    return losses


def _held_out(groups: Any) -> Any:
    known = np.unique(groups)
    return known[-max(1, round(HELD_OUT * len(known))) :]


def _scale(values: Any) -> Any:
    """Standard deviation of each column; 1 where it is constant."""
    deviation = values.std(axis=0)
    return np.where(deviation > 1e-9, deviation, 1.0)


def _tensor(values: Any) -> torch.Tensor:
    return torch.as_tensor(np.asarray(values), dtype=torch.float32)


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
