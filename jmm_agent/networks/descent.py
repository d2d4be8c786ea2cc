"""Update of networks by the paper's rule: Adam steps on one batch (sec. II-C)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch.nn.functional import mse_loss

from jmm_agent.mapping.group_map import Layers
from jmm_agent.networks.network import Network, tensor
from jmm_agent.types import Floats


def descend(
    layers: Sequence[Layers],
    inputs: Sequence[Floats],
    targets: Sequence[Floats],
    steps: int,
    rate: float,
    all_layers: bool,
    progress: Callable[[float], None],
) -> list[Layers]:
    """Reduce the mean square error [mm^2] of each network on its batch.

    Args:
        layers: of each network.
        inputs: scaled joint angles (B, n) of each network.
        targets: lengths (B, k) [mm] of each network.
        steps: number of Adam steps.
        rate: Adam's step size.
        all_layers: whether the hidden layers move, too.
        progress: not called; an update is short.

    Returns:
        The layers of each network after the update.
    """
    networks = [Network(before) for before in layers]
    batches = [(tensor(x), tensor(y)) for x, y in zip(inputs, targets, strict=True)]
    moving = []
    for network in networks:
        network.hidden.requires_grad_(all_layers)
        moving += [weights for weights in network.parameters() if weights.requires_grad]
    adam = torch.optim.Adam(moving, rate, fused=True)
    for _ in range(steps):
        adam.zero_grad()
        losses = [
            mse_loss(network.of_scaled(x), y)
            for network, (x, y) in zip(networks, batches, strict=True)
        ]
        torch.stack(losses).sum().backward()
        adam.step()
    return [network.layers() for network in networks]
