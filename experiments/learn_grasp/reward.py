"""PPO of Stable-Baselines3 from the reward of ``Kengoro/CanGrasp-v0`` alone.

The policy moves as cloned policies do: a command for each period of the camera, from the present
lengths and tensions, the time and the can's position, scaled by fixed middles and units. An action
is a change of the command of the row before. The reward is that of the environment, the mean over
the control steps of a row; it is not shaped, for its first third falls with the distance to the can
everywhere.

A policy is trained on the drawing, or on models within 20 % of it, another one in each episode.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from math import ceil
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from experiments.cloning.features import EXACT
from experiments.cloning.rows import RowArm
from experiments.harness.runner import core_seconds, run_tasks
from experiments.learn_grasp.episodes import LEARNED, ROWS, Learned, Run, judged
from experiments.learn_posture.policies import libraries
from experiments.robots.guessed_models import guessed_models
from jmm_agent.types import Floats
from kengoro.study_model import study_model
from kengoro_env.assets import asset_path
from kengoro_env.robot.own_model import Model
from kengoro_env.tasks.can_grasp import CAN_AREA, CanGrasp
from kengoro_env.wrappers import TENSION

Models = Literal["drawing", "guessed"]
"""What a policy is trained on: the drawing, or guessed randomisation of it."""
GUESSES = 64
"""Number of guessed models, each in an environment of its own."""
Act = Callable[[NDArray[np.float32]], NDArray[np.float32]]
LENGTH = 0.05
"""Unit of lengths [m]."""
CHANGE = 0.1
"""Largest change of a command in a row, as share of half the range of commands. The agent changes
none by more than 0.06 in its grasps on the drawing."""
SETTINGS: dict[str, Any] = {
    "n_steps": 1024,
    "batch_size": 256,
    "gamma": 0.98,
    "policy_kwargs": {"net_arch": [128, 128], "log_std_init": -1.0},
}
"""Settings of PPO that differ from the defaults."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work for each seed.

    Attributes:
        rows: number of rows of the training, 0.2 s each.
        checks: number of times that the policy is judged in training.
        episodes: judged episodes on the drawing.
        episodes_robot: judged episodes on each other robot, of the last policy.
    """

    rows: int = 100_000
    checks: int = 10
    episodes: int = 10
    episodes_robot: int = 5


QUICK = Sizes(1024, 1, 1, 1)


def learn(
    run: Run,
    seeds: Sequence[int],
    robots: Sequence[int],
    sizes: Sizes,
    models: Models = "drawing",
) -> Learned:
    """Train and judge a policy for each seed.

    Args:
        run: where and how.
        seeds: of the training.
        robots: further robots on which the last policy is judged.
        sizes: amount of work.
        models: what is trained on.
    """
    tasks = {f"{seed:03d}": (seed, list(robots), sizes, models) for seed in seeds}
    folder = run.out / f"reward-{models}"
    found = run_tasks(train, tasks, run.jobs, folder, f"{run.key} {list(robots)}")
    results = {seed: found[f"{seed:03d}"] for seed in seeds}
    return results, core_seconds(folder, tasks)


def train(
    seed: int, robots: Sequence[int], sizes: Sizes, models: Models = "drawing"
) -> dict[str, Any]:
    """Train one policy; entries as `Learned` tells, and those of `judge` in the episodes.

    ``robots_distance`` has the smallest distances in the episodes on each robot.
    """
    algorithms, torch, _ = libraries()
    torch.set_num_threads(1)
    env = RowEnv(None, trained_on(models, seed))
    model = algorithms["ppo"]("MlpPolicy", env, seed=seed, device="cpu", **deepcopy(SETTINGS))

    def act(observation: NDArray[np.float32]) -> NDArray[np.float32]:
        action: NDArray[np.float32] = model.predict(observation, deterministic=True)[0]
        return action

    found: dict[str, Any] = {"at": []}
    for check in range(sizes.checks + 1):
        more = ceil(sizes.rows * check / sizes.checks) - model.num_timesteps
        if more > 0:
            model.learn(more, reset_num_timesteps=False)
        found["at"].append(model.num_timesteps)
        for name, values in judge(act, None, sizes.episodes).items():
            found.setdefault(name, []).append(values)
    found |= {"robots": {}, "robots_distance": {}}
    for robot in robots:
        own, name = judge(act, robot, sizes.episodes_robot), f"{robot:03d}"
        found["robots"][name], found["robots_distance"][name] = own["lifted"], own["distance"]
    env.close()
    return found


def trained_on(models: Models, seed: int) -> list[Model] | None:
    """Guessed models of a seed of the training; None: the drawing."""
    if models == "drawing":
        return None
    nominal = study_model(asset_path(CanGrasp.scene), fingers=True)
    return list(guessed_models(nominal, GUESSES, seed))


def judge(act: Act, robot: int | None, episodes: int) -> dict[str, list[Any]]:
    """Judge a policy in some episodes.

    Args:
        act: from observation to action.
        robot: seed of the actual robot; None: the drawing.
        episodes: number of episodes.

    Returns:
        For each episode ``reward``, its mean; ``distance``, the smallest of the grip point from the
        can [m]; ``grasped``, whether the hand ever held the can; ``lifted``.
    """
    env = RowEnv(robot)
    found: dict[str, list[Any]] = {"reward": [], "distance": [], "grasped": [], "lifted": []}
    for seed in judged(robot, episodes):
        observation, info = env.begin(seed)
        rewards, distances, grasped, ended, cut = [], [], False, False, False
        while not (ended or cut):
            observation, reward, ended, cut, info = env.step(act(observation))
            rewards.append(reward)
            gap = info["hand_pose"][:3, 3] - info["can_pose"][:3, 3]
            distances.append(float(np.linalg.norm(gap)))
            grasped = grasped or bool(info["grasped"])
        found["reward"].append(float(np.mean(rewards)))
        found["distance"].append(min(distances))
        found["grasped"].append(grasped)
        found["lifted"].append(bool(info["success"]))
    env.close()
    return found


def scaled(inputs: Floats) -> NDArray[np.float32]:
    """Inputs (D,) of a policy without a history, see `features`, in numbers of about unit size."""
    readings, exact = inputs[:-EXACT], inputs[-EXACT:]
    lengths, tensions = np.split(readings, 2)
    low, high = CAN_AREA.T
    parts = (
        lengths / LENGTH,
        (tensions - TENSION) / TENSION,
        exact[:1] / ROWS,
        (exact[1:3] - (low + high) / 2) / ((high - low) / 2),
        exact[3:],
    )
    return np.concatenate(parts).astype(np.float32)


class RowEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """Episodes of `RowArm` for a learner: a step is a row.

    Args:
        robot: seed of the actual robot; None: the drawing.
        models: in place of the drawing, one of them in each episode to learn from; None: none.
    """

    def __init__(self, robot: int | None, models: Sequence[Model] | None = None) -> None:
        self._arms = [RowArm(robot, model=model) for model in models or [None]]
        self._arm = self._arms[0]
        self._arm.reset(0)
        size = len(self._arm.inputs(history=False))
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, self._arm.command.shape, np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode to learn from, sampled by the generator of ``seed``."""
        super().reset(seed=seed)
        episode = int(self.np_random.integers(LEARNED, 2**31))
        self._arm = self._arms[self.np_random.integers(len(self._arms))]
        return self.begin(episode)

    def begin(self, seed: int) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin the episode of a seed, see `RowArm.reset`."""
        info = self._arm.reset(seed)
        self._row = 0
        return self._observation(), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Carry out one row."""
        reward, ended, info = self._arm.step(commanded(self._arm.command, action))
        self._row += 1
        return self._observation(), reward, ended, self._row >= ROWS, info

    def _observation(self) -> NDArray[np.float32]:
        return scaled(self._arm.inputs(history=False))

    def close(self) -> None:
        """Close the environments of the arms."""
        for arm in self._arms:
            arm.close()


def commanded(before: Floats, action: NDArray[Any]) -> Floats:
    """Command (m + 1,) after that of the row before; the fingers' action is their command."""
    command = np.clip(before + CHANGE * action, -1.0, 1.0)
    command[-1] = action[-1]
    return command
