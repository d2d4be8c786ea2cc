"""Ideal joint-muscle model with a muscle-route change model, l = f(theta) + g(theta, T).

Kawaharazuka et al., "Online Self-body Image Acquisition Considering Changes in Muscle Routes Caused
by Softness of Body Tissue", arXiv 2404.05286, and "Long-time Self-body Image Acquisition", arXiv
2404.05293. From the papers: two networks, both initialised by the geometric model and both updated
online from (theta, T, l), by gradient steps on what was measured beside pairs of the model before.

From memory or by choice, because only the papers' beginnings could be read: f is the drawing's
networks of this project; g has one hidden layer and is zero at first, because the drawing's wires
do not stretch; both move in the same steps; rehearsed pairs are the drawing's.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.functional import mse_loss

from experiments.few_observations.networks.common import (
    Groups,
    Progress,
    arrays_of,
    batch,
    dense,
    descend,
)
from experiments.few_observations.successor_data import Drawing, Learning, Observed

HIDDEN = 100
"""Hidden units of g."""


class RouteChange(nn.Module):
    """Both networks, at first the drawing.

    Args:
        drawing: the drawing.
    """

    def __init__(self, drawing: Drawing) -> None:
        super().__init__()
        self.ideal = Groups(drawing, tensions=False)
        n, m = len(drawing.scales.angle), len(drawing.scales.length)
        self.change = dense((n + m, HIDDEN, m), torch.Generator().manual_seed(0))
        nn.init.zeros_(self.change[-1].weight)
        self._centre = torch.tensor(drawing.scales.angle_centre)
        self._scale = torch.tensor(drawing.scales.angle)

    def forward(self, angles: Tensor, scaled: Tensor, tensions: Tensor) -> Tensor:
        """Lengths (B, m) in units of their scale."""
        x = torch.hstack([(angles - self._centre) / self._scale, scaled])
        return self.ideal(angles, scaled, tensions)[0] + self.change(x)


def learn(drawing: Drawing, seen: Observed, learning: Learning, progress: Progress) -> list[Any]:
    """Update both networks.

    Args:
        drawing: where they start; its samples are rehearsed with the weight `Learning.own`.
        seen: what was measured.
        learning: settings.
        progress: called with the share that is done.

    Returns:
        Arrays of both networks, after each number of steps.
    """
    model = RouteChange(drawing)
    new, old = batch(seen, drawing), batch(drawing.rehearsed, drawing)

    def loss() -> Tensor:
        missed = mse_loss(model(new.angles, new.scaled, new.tensions), new.lengths)
        if learning.own > 0.0:
            again = mse_loss(model(old.angles, old.scaled, old.tensions), old.lengths)
            missed = missed + learning.own * again
        return missed

    def keep() -> Any:
        return model.ideal.arrays(), arrays_of(model.change)

    moving = [part for part in model.parameters() if part.requires_grad]
    return descend(moving, loss, learning.rate, learning.steps, keep, progress)
