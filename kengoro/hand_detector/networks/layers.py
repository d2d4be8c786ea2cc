"""Layers that both networks of the hand detector are made of."""

from __future__ import annotations

from torch import Tensor, nn


def convolution(inputs: int, outputs: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    """A convolution of 3 x 3 with batch normalisation and ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, dilation, dilation, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class Residual(nn.Module):
    """Two convolutions whose output is added to their input.

    Args:
        width: number of channels.
        dilation: distance of the cells that the first one combines.
    """

    def __init__(self, width: int, dilation: int = 1) -> None:
        super().__init__()
        self.first = convolution(width, width, dilation=dilation)
        self.second = convolution(width, width)

    def forward(self, x: Tensor) -> Tensor:
        """Features (b, width, h, w) of features of the same shape."""
        return x + self.second(self.first(x))
