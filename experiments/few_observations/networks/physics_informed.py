"""Physics-informed network l = h(theta, f) with a torque-tension loss.

Kawaharazuka et al., "PIMBS: Efficient Body Schema Learning for Musculoskeletal Humanoids with
Physics-Informed Neural Networks", arXiv 2506.20343. From summaries of the paper: h(theta, f) is the
geometric length with what tensions stretch; its derivative by theta is taken as the muscle
Jacobian G; the loss is that of the lengths, one of the physics, by which tensions and joint torques
balance through G, and one of the boundary.

From memory or by choice, because its equations could not be read: h is the drawing's networks of
this project with tensions among their inputs, with zero weights at first; joint torques are those
of gravity by the drawing, at each rest that was seen, and the balance is G' f = tau, because here a
wire that is pulled gets shorter; the boundary is h(0, f) = 0 with the tensions that hold theta = 0.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.nn.functional import mse_loss

from experiments.few_observations.networks.common import Groups, Progress, batch, descend
from experiments.few_observations.successor_data import Drawing, Learning, Observed


def learn(drawing: Drawing, seen: Observed, learning: Learning, progress: Progress) -> list[Any]:
    """Update the network.

    Args:
        drawing: where it starts.
        seen: what was measured, and the torques of the loads there.
        learning: settings; `Learning.own` is the weight of the balance.
        progress: called with the share that is done.

    Returns:
        Arrays of each group, after each number of steps.
    """
    model = Groups(drawing, tensions=True)
    new, torque = batch(seen, drawing), drawing.scales.torque
    zero = batch(drawing.zero, drawing)

    def loss() -> Tensor:
        lengths, torques = model(new.angles, new.scaled, new.tensions)
        missed = mse_loss(lengths, new.lengths)
        missed = missed + learning.own * mse_loss(torques / torque, new.torques / torque)
        if learning.boundary > 0.0:
            at_zero = model(zero.angles, zero.scaled, zero.tensions)[0]
            missed = missed + learning.boundary * torch.mean(at_zero**2)
        return missed

    moving = [part for part in model.parameters() if part.requires_grad]
    return descend(moving, loss, learning.rate, learning.steps, model.arrays, progress)
