"""A cloned policy, computed by NumPy, and whether it lifts the can."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from experiments.cloning.can_camera import CanSource
from experiments.cloning.rows import RowArm
from jmm_agent.types import Floats

LARGEST = 5.0
"""Standardised inputs are clipped to this, so that a strange reading does no harm."""
LAYERS = (0, 2, 4)
"""Numbers of the linear layers."""


def standardised(values: Floats, mean: Floats, scale: Floats) -> Floats:
    """Inputs (..., D) of mean 0 and deviation 1, clipped to `LARGEST`."""
    return np.clip((values - mean) / scale, -LARGEST, LARGEST)


class ClonedPolicy:
    """Commands from inputs.

    Args:
        path: npz file that `experiments.cloning.training` wrote.
        history: whether its inputs hold the readings of the start.
    """

    def __init__(self, path: Path, history: bool) -> None:
        self.history = history
        with np.load(path, allow_pickle=False) as stored:
            self._arrays = {name: stored[name].astype(float) for name in stored.files}

    def __call__(self, inputs: Floats, origin: Floats) -> NDArray[np.float32]:
        """Command at the end of the present row, shape (m + 1,).

        Args:
            inputs: shape (D,), see `features`.
            origin: command from which those of the policy count, shape (m + 1,).
        """
        own = self._arrays
        values = standardised(inputs, own["input_mean"], own["input_scale"])
        for layer in LAYERS:
            values = own[f"{layer}_weight"] @ values + own[f"{layer}_bias"]
            if layer != LAYERS[-1]:
                values = np.maximum(values, 0.0)
        command = origin + own["output_mean"] + own["output_scale"] * values
        command[-1] = 1.0 if command[-1] > 0.0 else -1.0  # the fingers open or close
        return np.clip(command, -1.0, 1.0).astype(np.float32)


class Lifts(NamedTuple):
    """What a policy reached in some episodes; each list has an entry for each of them.

    Attributes:
        lifted: whether it lifted the can.
        seen: whether the can was seen; where it was not, its position is `MIDDLE`.
        errors: distance of the position that the policy was given from the true one [m].
    """

    lifted: list[bool]
    seen: list[bool]
    errors: list[float]


def lifts(
    policy: ClonedPolicy,
    robot: int | None,
    seeds: Iterable[int],
    rows: int,
    can: CanSource = "state",
) -> Lifts:
    """Whether a policy lifts the can, in some episodes.

    Args:
        policy: moves the robot.
        robot: seed of the actual robot; None: the drawing.
        seeds: of the episodes, from which the can's positions follow.
        rows: longest duration of an episode, in periods of the camera.
        can: where the can's position comes from.
    """
    arm = RowArm(robot, can)
    found = Lifts([], [], [])
    for seed in seeds:
        arm.reset(seed)
        start = arm.origin(policy.history)
        for _ in range(rows):
            _, ended, info = arm.step(policy(arm.inputs(policy.history), start))
            if info["success"] or ended:
                break
        found.lifted.append(bool(info["success"]))
        found.seen.append(arm.can_seen)
        found.errors.append(arm.can_error)
    arm.close()
    return found
