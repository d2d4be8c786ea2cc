"""Network that locates the points of a hand in a crop, each with a covariance.

An encoder halves the resolution four times; a decoder goes back to a quarter of it. There each
point has a map of weights, whose mean place, plus an offset, is its place (integral regression, Sun
et al. 2018, arXiv 1711.08229). Offsets, covariances and whether there is a hand come from the
coarsest features, so that a point may lie outside of the crop.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from jmm_agent.vision.hand_detector import SPREAD
from jmm_agent.vision.weighted_pnp import TAIL
from kengoro.hand_detector.networks.layers import Residual, convolution


class PointsNetwork(nn.Module):
    """Points of a hand in crops.

    Args:
        count: number of points.
        size: of the crops [px], a multiple of 32.
        widths: numbers of channels at halved resolutions, from the finest.
    """

    def __init__(self, count: int, size: int, widths: tuple[int, ...] = (24, 48, 96, 128)) -> None:
        super().__init__()
        a, b, c, d = widths
        self.stem = convolution(3, a, 2)
        self.fine = nn.Sequential(convolution(a, b, 2), Residual(b))
        self.middle = nn.Sequential(convolution(b, c, 2), Residual(c), Residual(c))
        self.coarse = nn.Sequential(convolution(c, d, 2), Residual(d), Residual(d))
        self.from_coarse, self.from_middle = nn.Conv2d(d, c, 1), nn.Conv2d(c, c, 1)
        self.to_fine, self.from_fine = nn.Conv2d(c, b, 1), nn.Conv2d(b, b, 1)
        self.up_middle, self.up_fine = Residual(c), Residual(b)
        self.maps = nn.Conv2d(b, count, 1)
        self.summary = nn.Sequential(
            nn.AvgPool2d(2), nn.Conv2d(d, 32, 1), nn.Flatten(),
            nn.Linear(32 * (size // 32) ** 2, 256), nn.ReLU(inplace=True),
        )  # fmt: skip
        self.offsets, self.spreads = nn.Linear(256, 2 * count), nn.Linear(256, 3 * count)
        self.present = nn.Linear(256, 1)
        nn.init.zeros_(self.offsets.weight)
        nn.init.zeros_(self.spreads.weight)
        at = (torch.arange(size // 4, dtype=torch.float32) * 4 + 1.5 - (size - 1) / 2) / (size / 2)
        grid = torch.stack(torch.meshgrid(at, at, indexing="xy"), dim=-1).reshape(-1, 2)
        self.register_buffer("grid", grid)

    def forward(self, crops: Tensor) -> Tensor:
        """Outputs (b, 5 n + 1) of crops (b, 3, size, size) in [0, 1].

        Places (n, 2) in half widths of the crop from its middle, spreads (n, 3), presence.
        """
        fine = self.fine(self.stem(crops - 0.5))
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        up = self.up_middle(_twice(self.from_coarse(coarse)) + self.from_middle(middle))
        up = self.up_fine(_twice(self.to_fine(up)) + self.from_fine(fine))
        weights = self.maps(up).flatten(2).softmax(dim=2)
        summary = self.summary(coarse)
        positions = torch.matmul(weights, self.grid).flatten(1) + self.offsets(summary)
        return torch.cat([positions, self.spreads(summary), self.present(summary)], dim=1)


def _twice(x: Tensor) -> Tensor:
    return nn.functional.interpolate(x, scale_factor=2.0)


def points_loss(outputs: Tensor, positions: Tensor, present: Tensor) -> Tensor:
    """Negative log likelihood of the points of hands that are there, and of presence.

    The error of a point has a t distribution of `TAIL` degrees of freedom; the rows of its
    whitening matrix are (exp(s0), 0) and (s2, exp(s1)). Its absolute value is added: before the
    spreads are learned it draws the positions to the points.

    Args:
        outputs: of the network (b, 5 n + 1).
        positions: true ones (b, n, 2) [half widths].
        present: whether the hand is there (b,), as 0 or 1.
    """
    count = positions.shape[1]
    error = outputs[:, : 2 * count].reshape(-1, count, 2) - positions
    spreads = outputs[:, 2 * count : 5 * count].reshape(-1, count, 3)
    first, second = spreads[..., 0].clamp(*SPREAD), spreads[..., 1].clamp(*SPREAD)
    across = error[..., 0] * first.exp()
    along = error[..., 0] * spreads[..., 2] + error[..., 1] * second.exp()
    tail = (TAIL + 2.0) / 2.0 * torch.log1p((across**2 + along**2) / TAIL)
    points = (tail - first - second + 2.0 * error.abs().sum(-1)).mean(dim=1)
    there = nn.functional.binary_cross_entropy_with_logits(outputs[:, 5 * count], present)
    return (points * present).sum() / present.sum().clamp(min=1.0) + there
