"""Variations of examples that keep their labels right, made anew at each step of a training.

A rendered frame takes long, a step of the training does not: varied examples keep a network from
learning the rendered ones by heart.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
import torch
from torch import Tensor, nn

from jmm_agent.vision.hand_detector import STRIDE

GAIN, BIAS = 0.15, 0.06
"""Standard deviations of a picture's gain, and of what is added to each of its colours [1]."""
SWAPPED = 0.5
"""Share of the pictures whose colours are exchanged for each other [1]."""
HIDDEN, LARGEST = 0.3, 0.4
"""Share of the crops in which a rectangle is hidden, and its longest side [sides]."""
MOVED = 0.7
"""Share of the frames that are moved [1]."""
ZOOM, TURN = 0.2, 0.2
"""Standard deviations of a frame's logarithm of the zoom [1] and of its turn [rad]."""
SHIFT = 0.15
"""Standard deviation of a frame's shift [sides]."""
INSIDE = 0.95
"""Half sides of a frame within which the middle of a hand stays."""

_ORDERS = np.array(list(permutations(range(3))))


def vary_colours(pictures: Tensor, random: np.random.Generator) -> Tensor:
    """Planes (b, 3, h, w) in [0, 1] of pictures (b, h, w, 3) uint8, in other colours."""
    count, device = len(pictures), pictures.device
    orders = _ORDERS[np.where(random.random(count) < SWAPPED, random.integers(6, size=count), 0)]
    mixing = np.eye(3)[orders].transpose(0, 2, 1) * random.normal(1.0, GAIN, (count, 1, 3)) / 255.0
    bias = random.normal(0.0, BIAS, (count, 1, 3))
    factors, added = (torch.from_numpy(each).float().to(device) for each in (mixing, bias))
    varied = torch.baddbmm(added, pictures.flatten(1, 2).float(), factors).clamp_(0.0, 1.0)
    return varied.unflatten(1, pictures.shape[1:3]).permute(0, 3, 1, 2)


def hide_parts(crops: Tensor, random: np.random.Generator) -> Tensor:
    """Crops (b, 3, h, w), some of them with a rectangle of one colour.

    It hides a part of a hand that fills a crop. In a whole frame it might hide a small hand.
    """
    count, _, height, width = crops.shape
    hidden = random.random((count, 1)) < HIDDEN
    middle, half = random.random((count, 2)), random.uniform(0.0, LARGEST / 2.0, (count, 2))
    first, last = _to(crops, middle - half), _to(crops, np.where(hidden, middle + half, -1.0))
    rows, columns = (
        (torch.arange(side, device=crops.device) + 0.5) / side for side in (height, width)
    )
    in_rows = (rows > first[:, :1]) & (rows < last[:, :1])
    in_columns = (columns > first[:, 1:]) & (columns < last[:, 1:])
    covered = (in_rows[:, :, None] & in_columns[:, None, :])[:, None]
    return torch.where(covered, _to(crops, random.random((count, 3, 1, 1))), crops)


def move_frames(
    pictures: Tensor, cells: Tensor, random: np.random.Generator
) -> tuple[Tensor, Tensor]:
    """Frames that are shifted, zoomed, turned and mirrored, and the labels of the finder for them.

    Args:
        pictures: frames (b, 3, h, w).
        cells: labels (b, 4), see `finder_loss`.
        random: source of all.
    """
    count, _, height, width = pictures.shape
    sides = np.array([width, height])
    labels = cells.cpu().numpy().astype(float)
    there = labels[:, 3:] > 0.0
    at = np.where(there, (labels[:, :2] + 0.5) * STRIDE - sides / 2.0, 0.0)
    limit = INSIDE * sides / 2.0
    moved = random.random(count) < MOVED
    to = np.clip(at + SHIFT * sides * random.normal(size=(count, 2)), -limit, limit)
    to = np.where(moved[:, None], to, at)
    zoom = np.exp(moved * ZOOM * random.normal(size=count))
    turn = moved * TURN * random.normal(size=count)
    mirror = np.where(moved, random.choice([-1.0, 1.0], size=count), 1.0)
    back = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) / zoom
    back = back.transpose(2, 0, 1)  # from the new frame to the given one
    back[:, 0] *= mirror[:, None]
    shift = at - np.einsum("bij,bj->bi", back, to)
    matrix = np.concatenate([back * sides / sides[:, None], (2.0 * shift / sides)[..., None]], 2)
    grid = nn.functional.affine_grid(
        _to(pictures, matrix), list(pictures.shape), align_corners=False
    )
    varied = nn.functional.grid_sample(pictures, grid, align_corners=False)
    labels[:, :2] = (to + sides / 2.0) / STRIDE - 0.5
    labels[:, 2] += np.log(zoom)
    return varied, torch.where(cells[:, 3:] > 0.0, _to(cells, labels), cells)


def _to(like: Tensor, values: np.ndarray) -> Tensor:
    return torch.from_numpy(values).to(like)
