"""Initial training of the paper: a grid of postures, and Adam with batches of five (sec. IV-A).

The range of each joint is divided into 5 to 9 parts; the shoulder's 8 joints then have the paper's
2,646,000 postures. One fifth is held out for validation. The network maps radians to millimetres
without scaling, is initialised like a linear layer of PyTorch, and is trained on the rest for 20
epochs in minibatches of five.

Here a random share of the grid is used, because the whole grid takes millions of steps. The grids
of the other groups are so small that 20 epochs have few steps; training continues beyond them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np

from jmm_agent.mapping.group_map import METRES, GroupMap, Layers
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.torch_process import TorchProcess
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
"""Number of values of each joint in the grid. The paper states the range 5 to 9 and the product for
the shoulder; the assignment is ours, with more values for a wider range."""

EPOCHS = 20
BATCH = 5
HIDDEN = 1000


@dataclass(frozen=True)
class Share:
    """Amount of the paper's training.

    Attributes:
        samples: number of postures of a group's grid that are used, including validation.
        least_steps: least number of steps; a group trains beyond 20 epochs to reach it.
    """

    samples: int
    least_steps: int


@dataclass(frozen=True)
class PaperReport:
    """Report on the paper's training of one group.

    Attributes:
        grid: number of postures in the whole grid.
        samples: number of these that were used, including validation.
        epoch_steps: Adam steps in an epoch.
        history: validation RMSE [m] before the first epoch and after each.
        seconds: processor time of the training [s].
    """

    grid: int
    samples: int
    epoch_steps: int
    history: tuple[float, ...]
    seconds: float

    @property
    def validation_rmse(self) -> float:
        """RMSE after the paper's 20 epochs on the postures held out [m]."""
        return self.history[EPOCHS]

    @property
    def full_steps(self) -> int:
        """Adam steps of the paper's 20 epochs over the whole grid."""
        return EPOCHS * ((self.grid - self.grid // 5) // BATCH)

    @property
    def full_seconds(self) -> float:
        """Time of `full_steps`, from the time of a step here [s]."""
        steps = self.epoch_steps * (len(self.history) - 1)
        return self.full_steps * self.seconds / steps


def train_as_paper(
    nominal: NominalModel, seed: int, share: Share
) -> tuple[JointMuscleMap, dict[str, PaperReport]]:
    """Train the map of every group like the paper.

    Args:
        nominal: model of the arm.
        seed: of the training; equal seeds have bitwise equal results.
        share: amount of training.
    """
    streams = np.random.SeedSequence([seed, 3]).spawn(len(nominal.groups))
    groups, reports = [], {}
    with TorchProcess() as process:
        for (name, joints, muscles), stream in zip(nominal.topology(), streams, strict=True):
            rng = np.random.default_rng(stream)
            postures = grid_postures(nominal, joints, share.samples, rng)
            lengths = nominal.lengths(postures)[:, muscles] / METRES
            start = _plain_layers(len(joints), len(muscles), rng)
            layers, steps, history, seconds = process.call(
                "experiments.initial_training.paper_descent:descend",
                start,
                postures[:, joints],
                lengths,
                rng,
                share.least_steps,
            )
            unscaled = np.zeros(len(joints)), np.ones(len(joints))
            groups.append(GroupMap(name, joints, muscles, *unscaled, *layers))
            grid = prod(_parts(nominal, joints))
            reports[name] = PaperReport(grid, len(postures), steps, tuple(history), seconds)
    return JointMuscleMap(nominal.joints, nominal.muscles, tuple(groups)), reports


def grid_postures(
    nominal: NominalModel, joints: Ints, most: int, rng: np.random.Generator
) -> Floats:
    """Different postures of the grid over some joints, in random order.

    Args:
        nominal: model of the arm.
        joints: indices of the joints; all others are at zero.
        most: largest number of postures.
        rng: chooses the postures.

    Returns:
        Joint angles, shape (B, n) [rad], B <= most.
    """
    parts = _parts(nominal, joints)
    count = prod(parts)
    chosen = rng.choice(count, min(count, most), replace=False)
    postures = np.zeros((len(chosen), len(nominal.joints)))
    for joint, size, location in zip(joints, parts, np.unravel_index(chosen, parts), strict=True):
        axis = np.linspace(nominal.lower[joint], nominal.upper[joint], size)
        postures[:, joint] = axis[location]
    return postures


def _parts(nominal: NominalModel, joints: Ints) -> list[int]:
    return [PARTS[nominal.joints[joint]] for joint in joints]


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
