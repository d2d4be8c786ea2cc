"""What the networks share: data, scales, the drawing's groups with tensions, steps of Adam."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn

from experiments.few_observations.successor_data import Drawing, Group, Observed
from jmm_agent.mapping.group_map import METRES
from jmm_agent.types import Floats, Ints

Progress = Callable[[float], None]


def tensor(array: Floats | Ints) -> Tensor:
    """A copy of an array of floats, or of indices, in torch."""
    return torch.tensor(array)


class Batch(NamedTuple):
    """Rests as tensors.

    Attributes:
        angles: (K, n) [rad].
        tensions: (K, m) [N].
        scaled: tensions, centred and scaled (K, m).
        lengths: in units of their scale (K, m).
        torques: of the loads (K, n) [N m].
    """

    angles: Tensor
    tensions: Tensor
    scaled: Tensor
    lengths: Tensor
    torques: Tensor


def batch(rests: Observed, drawing: Drawing) -> Batch:
    """Rests as tensors, scaled as the drawing's samples."""
    scales = drawing.scales
    return Batch(
        tensor(rests.angles),
        tensor(rests.tensions),
        tensor(scales.scaled_tensions(rests.tensions)),
        tensor(rests.lengths / scales.length),
        tensor(rests.torques),
    )


class GroupNetwork(nn.Module):
    """The drawing's network of one group, whose hidden units may see tensions, too.

    Args:
        group: its layers and scales.
        length: scale of all lengths (m,) [m].
        tensions: whether hidden units see the tensions of the group's muscles; with zero weights
            at first, so that the network is the drawing's.
    """

    def __init__(self, group: Group, length: Floats, tensions: bool) -> None:
        super().__init__()
        layers, own = group.layers, length[group.muscles]
        self.joints, self.muscles = tensor(group.joints), tensor(group.muscles)
        self._centre, self._scale = tensor(group.centre), tensor(group.scale)
        self._length, self._unit = tensor(own), METRES / own
        self.inner = nn.Parameter(tensor(layers.W1))
        self.inner_offset = nn.Parameter(tensor(layers.b1))
        self.outer = nn.Parameter(tensor(layers.W2 * self._unit[:, None]))
        self.outer_offset = nn.Parameter(tensor(layers.b2 * self._unit))
        pulls = torch.zeros(len(layers.b1), len(group.muscles), dtype=torch.float64)
        self.pulls = nn.Parameter(pulls, requires_grad=tensions)

    def hidden(self, angles: Tensor, scaled: Tensor) -> Tensor:
        """Activities (B, H) at angles (B, n) [rad] and scaled tensions (B, m)."""
        x = (angles[:, self.joints] - self._centre) / self._scale
        inner = x @ self.inner.T + self.inner_offset
        if self.pulls.requires_grad:
            inner = inner + scaled[:, self.muscles] @ self.pulls.T
        return torch.sigmoid(inner)

    def forward(self, hidden: Tensor) -> Tensor:
        """Lengths (B, k) of the group's muscles in units of their scale."""
        return hidden @ self.outer.T + self.outer_offset

    def torques(self, hidden: Tensor, tensions: Tensor) -> Tensor:
        """Torques G' T on the group's joints (B, n_in) [N m], G by the network, T (B, m) [N]."""
        pull = (tensions[:, self.muscles] * self._length) @ self.outer
        return (pull * hidden * (1.0 - hidden)) @ (self.inner / self._scale)

    def arrays(self) -> dict[str, Floats]:
        """Layers in the map's units, and the weights of the tensions, as copies."""
        unit = torch.tensor(self._unit)
        found = {
            "W1": self.inner,
            "b1": self.inner_offset,
            "W2": self.outer / unit[:, None],
            "b2": self.outer_offset / unit,
            "pulls": self.pulls,
        }
        return {name: part.detach().clone().numpy() for name, part in found.items()}


class Groups(nn.Module):
    """The drawing's networks of all groups.

    Args:
        drawing: the drawing.
        tensions: whether hidden units see tensions, see `GroupNetwork`.
    """

    def __init__(self, drawing: Drawing, tensions: bool) -> None:
        super().__init__()
        length = drawing.scales.length
        self.groups = nn.ModuleList(
            [GroupNetwork(group, length, tensions) for group in drawing.groups]
        )

    def forward(self, angles: Tensor, scaled: Tensor, tensions: Tensor) -> tuple[Tensor, Tensor]:
        """Lengths (B, m) in units of their scale, and torques G' T of the tensions (B, n) [N m]."""
        lengths, torques = torch.zeros_like(scaled), torch.zeros_like(angles)
        for group in self.groups:
            hidden = group.hidden(angles, scaled)
            lengths = lengths.index_copy(1, group.muscles, group(hidden))
            torques = torques.index_add(1, group.joints, group.torques(hidden, tensions))
        return lengths, torques

    def arrays(self) -> list[dict[str, Floats]]:
        """`GroupNetwork.arrays` of each group."""
        return [group.arrays() for group in self.groups]


def dense(sizes: Sequence[int], generator: torch.Generator) -> nn.Sequential:
    """Layers with tanh between them; the weights are of size 1 / sqrt(inputs).

    Args:
        sizes: numbers of inputs, of the units of each layer, and of outputs.
        generator: of the weights.
    """
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layer = nn.Linear(inputs, outputs, dtype=torch.float64)
        with torch.no_grad():
            layer.weight.normal_(0.0, inputs**-0.5, generator=generator)
            layer.bias.zero_()
        layers += [layer, nn.Tanh()]
    return nn.Sequential(*layers[:-1])


def arrays_of(network: nn.Sequential) -> list[tuple[Floats, Floats]]:
    """Weights and offsets of each layer, as copies."""
    return [
        (layer.weight.detach().clone().numpy(), layer.bias.detach().clone().numpy())
        for layer in network
        if isinstance(layer, nn.Linear)
    ]


def descend(
    moving: Sequence[nn.Parameter],
    loss: Callable[[], Tensor],
    rate: float,
    steps: Sequence[int],
    keep: Callable[[], object],
    progress: Progress,
) -> list[object]:
    """Reduce a loss by Adam.

    Args:
        moving: parameters that are moved.
        loss: of the parameters as they are.
        rate: Adam's step size.
        steps: numbers of steps after which the result is kept, rising; 0: none.
        keep: copies the result.
        progress: called with the share that is done.

    Returns:
        What was kept after each number of steps.
    """
    adam = torch.optim.Adam(moving, rate, fused=True)
    kept = [keep() for step in steps if step == 0]
    for step in range(1, steps[-1] + 1):
        adam.zero_grad()
        loss().backward()
        adam.step()
        if step in steps:
            kept.append(keep())
            progress(step / steps[-1])
    return kept
