"""Musculoskeletal AutoEncoder: any two of joint angles, tensions and lengths give all three.

Kawaharazuka et al., "Musculoskeletal AutoEncoder: A Unified Online Acquisition Method of
Intersensory Networks", arXiv 2406.17134. From summaries of the paper: inputs are (theta, T, l) and
three masks, what is masked is 0; layers of D + 2M + 3, 200, 30, D + M, 30, 200, D + 2M units for D
joints and M muscles; initial training on random angles and tensions of the geometric model, with
lengths by it; then online training on what was measured, with all masks; the loss is a weighted sum
of squares of all three.

By choice: quantities are scaled, and the weights are 1, but that of the tensions 0.05, with which
the lengths of the drawing are learned in half of the steps; the layers of 200 and 30 units have
8 (D + M) and 2 (D + M) units, because the latent state of our arm with 14 joints and 36 muscles
would not pass 30 units; the drawing's samples are rehearsed beside what was measured.
"""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from experiments.few_observations.networks.common import (
    Progress,
    arrays_of,
    dense,
    descend,
    tensor,
)
from experiments.few_observations.successor_data import Drawing, Initial, Learning, Observed
from jmm_agent.types import Floats

MASKS = ((1.0, 1.0, 0.0), (0.0, 1.0, 1.0), (1.0, 0.0, 1.0))
"""Which of joint angles, tensions and lengths are given."""
TENSION = 0.05
"""Weight of the tensions in the loss; that of angles and lengths is 1."""


def train(drawing: Drawing, initial: Initial, progress: Progress) -> list[tuple[Floats, Floats]]:
    """Train the network on samples of the drawing.

    Args:
        drawing: the drawing.
        initial: how.
        progress: called with the share that is done.

    Returns:
        Weights and offsets of each layer.
    """
    generator = torch.Generator().manual_seed(0)
    state = _state(drawing.samples, drawing)
    n, m = len(drawing.scales.angle), len(drawing.scales.length)
    wide, narrow, latent = 8 * (n + m), 2 * (n + m), n + m
    sizes = (n + 2 * m + 3, wide, narrow, latent, narrow, wide, n + 2 * m)
    network = dense(sizes, generator).to(torch.float32)
    masks, widths = torch.tensor(MASKS, dtype=torch.float32), torch.tensor([n, m, m])
    state = state.to(torch.float32)
    adam = torch.optim.Adam(network.parameters(), initial.rate, fused=True)
    falling = torch.optim.lr_scheduler.LambdaLR(
        adam, lambda step: 0.5 * (1.0 + cos(pi * step / initial.steps))
    )
    for step in range(initial.steps):
        rows = torch.randint(len(state), (initial.batch,), generator=generator)
        kinds = torch.randint(len(MASKS), (initial.batch,), generator=generator)
        adam.zero_grad()
        _missed(network(_masked(state[rows], masks[kinds], widths)), state[rows], widths).backward()
        adam.step()
        falling.step()
        if step % 100 == 0:
            progress(step / initial.steps)
    return arrays_of(network.to(torch.float64))


def learn(
    drawing: Drawing,
    start: list[tuple[Floats, Floats]],
    seen: Observed,
    learning: Learning,
    progress: Progress,
) -> list[Any]:
    """Update the network.

    Args:
        drawing: its samples are rehearsed with the weight `Learning.own`.
        start: layers by `train`.
        seen: what was measured.
        learning: settings.
        progress: called with the share that is done.

    Returns:
        Weights and offsets of each layer, after each number of steps.
    """
    network = _network(start)
    n, m = len(drawing.scales.angle), len(drawing.scales.length)
    masks, widths = torch.tensor(MASKS, dtype=torch.float64), torch.tensor([n, m, m])

    def all_masks(rests: Observed) -> tuple[Tensor, Tensor]:
        state = _state(rests, drawing)
        repeated = state.repeat(len(MASKS), 1)
        return _masked(repeated, masks.repeat_interleave(len(state), 0), widths), repeated

    new, old = all_masks(seen), all_masks(drawing.rehearsed)

    def loss() -> Tensor:
        missed = _missed(network(new[0]), new[1], widths)
        if learning.own > 0.0:
            missed = missed + learning.own * _missed(network(old[0]), old[1], widths)
        return missed

    def keep() -> Any:
        return arrays_of(network)

    moving = list(network.parameters())
    return descend(moving, loss, learning.rate, learning.steps, keep, progress)


def _network(layers: list[tuple[Floats, Floats]]) -> nn.Sequential:
    sizes = [layers[0][0].shape[1], *(len(offsets) for _, offsets in layers)]
    network = dense(sizes, torch.Generator())
    assert len(layers) == len(list(pairwise(sizes)))
    linear = [layer for layer in network if isinstance(layer, nn.Linear)]
    with torch.no_grad():
        for layer, (weights, offsets) in zip(linear, layers, strict=True):
            layer.weight.copy_(tensor(weights))
            layer.bias.copy_(tensor(offsets))
    return network


def _state(rests: Observed, drawing: Drawing) -> Tensor:
    """Scaled angles, tensions and lengths (K, n + 2m)."""
    scales = drawing.scales
    parts = (
        scales.scaled_angles(rests.angles),
        scales.scaled_tensions(rests.tensions),
        (rests.lengths - scales.length_centre) / scales.length,
    )
    return tensor(np.hstack(parts))


def _missed(found: Tensor, state: Tensor, widths: Tensor) -> Tensor:
    """Weighted mean square error of states (K, n + 2m)."""
    weights = torch.tensor([1.0, TENSION, 1.0], dtype=state.dtype).repeat_interleave(widths)
    return torch.mean(weights * (found - state) ** 2)


def _masked(state: Tensor, masks: Tensor, widths: Tensor) -> Tensor:
    """States (K, n + 2m) with what is not given set to 0, followed by the masks (K, 3)."""
    return torch.hstack([state * masks.repeat_interleave(widths, 1), masks])
