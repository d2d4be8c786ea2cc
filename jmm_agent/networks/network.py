"""Network of one group of muscles as a module of torch (Kawaharazuka et al. 2018, sec. II-A).

It is `jmm_agent.mapping.group_map.GroupMap`, which the control step evaluates without torch.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor, nn

from jmm_agent.mapping.group_map import GroupMap, Layers
from jmm_agent.types import Floats


class Network(nn.Module):
    """One hidden layer of sigmoids: joint angles (B, n) [rad] -> lengths (B, k) [mm].

    Args:
        layers: at the start.
        dtype: precision of the layers.
        centre: of the inputs (n,) [rad]; zero if left out.
        scale: of the inputs (n,) [rad]; one if left out.

    Attributes:
        hidden: hidden layer, from scaled joint angles to sums of the sigmoids.
        output: output layer, from sigmoids to lengths [mm].
    """

    centre: Tensor
    scale: Tensor

    def __init__(
        self,
        layers: Layers,
        dtype: torch.dtype = torch.float64,
        centre: Floats | None = None,
        scale: Floats | None = None,
    ) -> None:
        super().__init__()
        units, inputs = layers.W1.shape
        self.hidden = nn.Linear(inputs, units, dtype=dtype)
        self.output = nn.Linear(units, len(layers.b2), dtype=dtype)
        middle = torch.zeros(inputs, dtype=dtype) if centre is None else tensor(centre, dtype)
        width = torch.ones(inputs, dtype=dtype) if scale is None else tensor(scale, dtype)
        self.register_buffer("centre", middle)
        self.register_buffer("scale", width)
        with torch.no_grad():
            for parameter, layer in zip(self._parameters_of_layers(), layers, strict=True):
                parameter.copy_(tensor(layer, dtype))

    @classmethod
    def of(cls, group: GroupMap) -> Network:
        """The same network as a group of a map, to the bit.

        Args:
            group: the group.
        """
        return cls(group.layers, torch.float64, group.centre, group.scale)

    def forward(self, q: Tensor) -> Tensor:
        """Lengths (B, k) [mm] at joint angles (B, n) [rad]."""
        return self.of_scaled((q - self.centre) / self.scale)

    def of_scaled(self, x: Tensor) -> Tensor:
        """Lengths (B, k) [mm] at joint angles (B, n) that are scaled already."""
        return self.output(torch.sigmoid(self.hidden(x)))

    def layers(self) -> Layers:
        """The present layers, in float64."""
        return Layers(
            *(
                parameter.detach().to(torch.float64, copy=True).numpy()
                for parameter in self._parameters_of_layers()
            )
        )

    def group(self, like: GroupMap) -> GroupMap:
        """The network as a group of a map, the same to the bit in float64.

        Args:
            like: a group of the same name, joints, muscles and scales.
        """
        return replace(like, **self.layers()._asdict())

    def _parameters_of_layers(self) -> tuple[nn.Parameter, ...]:
        hidden, output = self.hidden, self.output
        return hidden.weight, hidden.bias, output.weight, output.bias


def tensor(array: Floats, dtype: torch.dtype = torch.float64) -> Tensor:
    """A copy of an array.

    Args:
        array: of any shape.
        dtype: precision of the copy.
    """
    return torch.tensor(array, dtype=dtype)
