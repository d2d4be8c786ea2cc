"""A cloned policy, computed by NumPy, and episodes in which it moves a robot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.clone_grasp.features import STRIDE, features
from jmm_agent.types import Floats
from kengoro.demonstrations.robot import episode_seed
from kengoro.hand_search import READY
from kengoro.robots import make_env
from kengoro_env.env import KengoroEnv

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
        path: npz file that `experiments.clone_grasp.training` wrote.
        history: whether its inputs hold earlier readings.
    """

    def __init__(self, path: Path, history: bool) -> None:
        self.history = history
        with np.load(path, allow_pickle=False) as stored:
            self._arrays = {name: stored[name].astype(float) for name in stored.files}

    def __call__(self, inputs: Floats) -> NDArray[np.float32]:
        """Command at the end of the present row, shape (m + 1,), for inputs (D,)."""
        own = self._arrays
        values = standardised(inputs, own["input_mean"], own["input_scale"])
        for layer in LAYERS:
            values = own[f"{layer}_weight"] @ values + own[f"{layer}_bias"]
            if layer != LAYERS[-1]:
                values = np.maximum(values, 0.0)
        command = own["output_mean"] + own["output_scale"] * values
        command[-1] = 1.0 if command[-1] > 0.0 else -1.0  # the fingers open or close
        return np.clip(command, -1.0, 1.0).astype(np.float32)


def lifts(
    policy: ClonedPolicy, robot: int | None, seeds_of: int, count: int, rows: int
) -> list[bool]:
    """Whether a policy lifts the can, in some episodes.

    Args:
        policy: moves the robot.
        robot: seed of the actual robot; None: the drawing.
        seeds_of: robot whose episodes' seeds are taken, from which the can's positions follow.
        count: number of episodes.
        rows: longest duration of an episode, in periods of the camera.
    """
    env = make_env("CanGrasp", robot, camera=False)
    world = env.unwrapped
    assert isinstance(world, KengoroEnv)
    found = [_lifts(policy, world, episode_seed(seeds_of, number), rows) for number in range(count)]
    env.close()
    return found


def _lifts(policy: ClonedPolicy, world: KengoroEnv, seed: int, rows: int) -> bool:
    observation, info = world.reset(seed=seed, options={"posture": np.array(READY)})
    can = info["can_pose"][:2, 3].copy()
    readings: list[Floats] = []
    command = world.lengths_to_action(observation["lengths"])
    for _ in range(rows):
        readings.append(np.append(observation["lengths"], observation["tensions"]))
        before, command = command, policy(features(readings, can, policy.history))
        for step in range(1, STRIDE + 1):
            action = before + (command - before) * np.float32(step / STRIDE)
            action[-1] = command[-1]
            observation, _, ended, _, info = world.step(np.clip(action, -1.0, 1.0))
            if info["success"] or ended:
                return bool(info["success"])
    return False
