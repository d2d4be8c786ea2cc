"""The paper's own initial training: a grid of the drawing's postures, Adam by five (sec. IV-A).

The range of each joint is divided into 5 to 9 parts; the shoulder's 8 joints then have the paper's
2,646,000 postures. One fifth is kept for validation. The network takes radians and gives
millimetres as they are, begins as a linear layer of today's libraries does, and sees the rest 20
times in minibatches of five.

Here a random share of the grid stands for it, since all of it takes millions of steps. The grids
of the other groups are so small that 20 epochs are few steps; they are trained on from there.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, prod

import numpy as np

from jmm_agent.mapping.joint_muscle_map import METRES, GroupMap, JointMuscleMap, sigmoid
from jmm_agent.mapping.network_fit import Layers, Network
from jmm_agent.nominal_model import NominalModel
from jmm_agent.types import Floats, Ints

PARTS: dict[str, int] = {
    "neck_yaw": 9,
    "neck_pitch": 8,
    "neck_roll": 7,
    "sc_roll": 5,
    "sc_yaw": 6,
    "ac_roll": 5,
    "ac_pitch": 5,
    "sh_pitch": 9,
    "sh_roll": 7,
    "sh_yaw": 8,
    "elbow": 7,
    "radioulnar": 9,
    "wrist_flex": 8,
    "wrist_dev": 7,
}
"""Values of each joint in the grid. The paper says 5 to 9 and the product for the shoulder; which
joint has which is chosen here: more for a wider range."""

EPOCHS = 20
BATCH = 5
RATE = 1e-3
HIDDEN = 1000
VALIDATION = 5000
"""Most postures on which the error is taken after each epoch."""


@dataclass(frozen=True)
class Share:
    """How much of the paper's training is done.

    Attributes:
        samples: postures of a group's grid that are used, those for validation among them.
        least_steps: a group trains beyond the paper's 20 epochs until it has taken so many.
    """

    samples: int
    least_steps: int


@dataclass(frozen=True)
class PaperReport:
    """How the paper's training of one group went.

    Attributes:
        grid: postures in the whole grid.
        samples: of them used, those for validation among them.
        epoch_steps: Adam steps in each epoch.
        history: validation RMSE [m] before the first epoch and after each.
        seconds: processor time of the training.
    """

    grid: int
    samples: int
    epoch_steps: int
    history: tuple[float, ...]
    seconds: float

    @property
    def validation_rmse(self) -> float:
        """RMSE [m] after the paper's 20 epochs, on the postures that were kept for it."""
        return self.history[EPOCHS]

    @property
    def full_steps(self) -> int:
        """Adam steps that the paper's 20 epochs over the whole grid take."""
        return EPOCHS * ((self.grid - self.grid // 5) // BATCH)

    @property
    def full_seconds(self) -> float:
        """What they would take, at the time that a step took here."""
        steps = self.epoch_steps * (len(self.history) - 1)
        return self.full_steps * self.seconds / steps


def train_as_paper(
    drawing: NominalModel, seed: int, share: Share
) -> tuple[JointMuscleMap, dict[str, PaperReport]]:
    """Train the map of every group as the paper does; the same seed gives the same bits."""
    streams = np.random.SeedSequence([seed, 3]).spawn(len(drawing.groups))
    groups, reports = [], {}
    for (name, joints, muscles), stream in zip(drawing.topology(), streams, strict=True):
        rng = np.random.default_rng(stream)
        postures = grid_postures(drawing, joints, share.samples, rng)
        lengths = drawing.lengths(postures)[:, muscles] / METRES
        begin = time.process_time()
        layers, steps, history = _descend(postures[:, joints], lengths, rng, share.least_steps)
        seconds = time.process_time() - begin
        unscaled = np.zeros(len(joints)), np.ones(len(joints))
        groups.append(GroupMap(name, joints, muscles, *unscaled, *layers))
        grid = prod(_parts(drawing, joints))
        reports[name] = PaperReport(grid, len(postures), steps, tuple(history), seconds)
    return JointMuscleMap(drawing.joints, drawing.muscles, tuple(groups)), reports


def grid_postures(
    drawing: NominalModel, joints: Ints, most: int, rng: np.random.Generator
) -> Floats:
    """Different postures (B, n) [rad] of the grid over some joints, in random order, B <= most.

    All other joints stand at zero.
    """
    parts = _parts(drawing, joints)
    count = prod(parts)
    chosen = rng.choice(count, min(count, most), replace=False)
    postures = np.zeros((len(chosen), len(drawing.joints)))
    for joint, size, location in zip(joints, parts, np.unravel_index(chosen, parts), strict=True):
        axis = np.linspace(drawing.lower[joint], drawing.upper[joint], size)
        postures[:, joint] = axis[location]
    return postures


def _parts(drawing: NominalModel, joints: Ints) -> list[int]:
    return [PARTS[drawing.joints[joint]] for joint in joints]


def _descend(
    x: Floats, y: Floats, rng: np.random.Generator, least_steps: int
) -> tuple[Layers, int, Sequence[float]]:
    """Train on x (B, n) [rad] and y (B, k) [mm] but for the first fifth.

    Returns the layers, the steps in an epoch, and the RMSE [m] on the first fifth by epoch.
    """
    held = len(x) // 5
    steps = (len(x) - held) // BATCH
    inputs = np.column_stack([x, np.ones(len(x))]).astype(np.float32)
    targets = y.astype(np.float32)
    network = Network(_plain_layers(x.shape[1], y.shape[1], rng), BATCH)
    test = slice(min(held, VALIDATION))
    history = [rmse(network.layers(), x[test], y[test])]
    for _ in range(max(EPOCHS, ceil(least_steps / steps))):
        order = held + rng.permutation(len(x) - held)[: steps * BATCH]
        for rows in order.reshape(steps, BATCH):
            network.gradient(inputs[rows], targets[rows])
            network.step(RATE)
        history.append(rmse(network.layers(), x[test], y[test]))
    return network.layers(), steps, history


def _plain_layers(inputs: int, outputs: int, rng: np.random.Generator) -> Layers:
    """Weights and biases uniform within 1 / sqrt(inputs of the layer)."""

    def uniform(fan_in: int, *shape: int) -> Floats:
        return rng.uniform(-1.0, 1.0, shape) / np.sqrt(fan_in)

    return Layers(
        uniform(inputs, HIDDEN, inputs),
        uniform(inputs, HIDDEN),
        uniform(HIDDEN, outputs, HIDDEN),
        uniform(HIDDEN, outputs),
    )


def rmse(layers: Layers, x: Floats, y: Floats) -> float:
    """RMSE [m] of a network on x (B, n) [rad] and y (B, k) [mm]."""
    found = sigmoid(x @ layers.W1.T + layers.b1) @ layers.W2.T + layers.b2
    return METRES * float(np.sqrt(np.mean(np.square(found - y))))
