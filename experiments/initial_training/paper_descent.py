"""Adam steps of the paper's initial training, which need torch (sec. IV-A).

They run in the process that `jmm_agent.mapping.torch_process` starts.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from math import ceil

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import mse_loss

from experiments.initial_training.paper_recipe import BATCH, EPOCHS
from jmm_agent.mapping.group_map import METRES, Layers
from jmm_agent.networks.fit import BETAS
from jmm_agent.networks.network import Network, tensor
from jmm_agent.types import Floats

RATE = 1e-3
VALIDATION = 5000
"""Largest number of postures on which the error is evaluated after each epoch."""


def descend(
    start: Layers,
    x: Floats,
    y: Floats,
    rng: np.random.Generator,
    least_steps: int,
    progress: Callable[[float], None],
) -> tuple[Layers, int, tuple[float, ...], float]:
    """Train on all samples except the first fifth.

    Args:
        start: layers before training.
        x: joint angles (B, n) [rad].
        y: muscle lengths (B, k) [mm].
        rng: chooses the order of the samples.
        least_steps: least number of steps, if 20 epochs have fewer.
        progress: called with the share that is done.

    Returns:
        The layers, the steps in an epoch, the RMSE [m] on the first fifth before the first epoch
        and after each, and the processor time [s].
    """
    begin = time.process_time()
    held = len(x) // 5
    steps = (len(x) - held) // BATCH
    inputs, targets = tensor(x, torch.float32), tensor(y, torch.float32)
    network = Network(start, torch.float32)
    adam = torch.optim.Adam(network.parameters(), RATE, BETAS, fused=True)
    test = slice(min(held, VALIDATION))
    history = [rmse(network, inputs[test], targets[test])]
    epochs = max(EPOCHS, ceil(least_steps / steps))
    for epoch in range(epochs):
        order = held + rng.permutation(len(x) - held)[: steps * BATCH]
        for rows in torch.from_numpy(order.reshape(steps, BATCH)):
            adam.zero_grad()
            mse_loss(network(inputs[rows]), targets[rows]).backward()
            adam.step()
        history.append(rmse(network, inputs[test], targets[test]))
        progress((epoch + 1) / epochs)
    return network.layers(), steps, tuple(history), time.process_time() - begin


def rmse(network: Network, x: Tensor, y: Tensor) -> float:
    """RMSE [m] of a network on joint angles (B, n) [rad] and lengths (B, k) [mm]."""
    with torch.no_grad():
        return METRES * mse_loss(network(x), y).sqrt().item()
