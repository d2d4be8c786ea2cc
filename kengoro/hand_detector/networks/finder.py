"""Network that finds the hand in a frame that was made small.

Each cell of `STRIDE` pixels has four outputs: a score, the distance of the hand's middle from the
cell (column, row) in cells, and the logarithm of the slope that the half width of its view has.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from kengoro.hand_detector.networks.layers import Residual, convolution

NEAR = 1.5
"""Cells nearer to the hand than this learn its place and size [cells]."""


class FinderNetwork(nn.Module):
    """Where in a frame a hand may be."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            convolution(3, 16, 2), convolution(16, 32, 2), Residual(32), convolution(32, 64, 2),
            Residual(64), Residual(64), Residual(64), Residual(64, 2), Residual(64, 4),
            nn.Conv2d(64, 4, 1),
        )  # fmt: skip

    def forward(self, frames: Tensor) -> Tensor:
        """Outputs (b, 4, h / 8, w / 8) of frames (b, 3, h, w) in [0, 1]."""
        return self.layers(frames - 0.5)


def finder_loss(outputs: Tensor, cells: Tensor) -> Tensor:
    """Error of scores, positions and sizes.

    Args:
        outputs: of the network (b, 4, rows, columns).
        cells: column and row of the hand [cells], log slope, whether it is there (b, 4).
    """
    rows, columns = outputs.shape[2:]
    row = torch.arange(rows, dtype=outputs.dtype, device=outputs.device)[None, :, None]
    column = torch.arange(columns, dtype=outputs.dtype, device=outputs.device)[None, None, :]
    right, below = cells[:, 0, None, None] - column, cells[:, 1, None, None] - row
    there = cells[:, 3, None, None]
    distance = right**2 + below**2
    wanted = there * torch.exp(-distance / 2.0)
    scores = nn.functional.binary_cross_entropy_with_logits(outputs[:, 0], wanted, reduction="none")
    near = there * (distance < NEAR**2)
    errors = (outputs[:, 1] - right).abs() + (outputs[:, 2] - below).abs()
    errors = errors + 2.0 * (outputs[:, 3] - cells[:, 2, None, None]).abs()
    return scores.sum(dim=(1, 2)).mean() + (near * errors).sum() / near.sum().clamp(min=1.0)
