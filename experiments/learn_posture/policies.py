"""Policies for ``Kengoro/Posture-v0`` that learn from its reward, and those that do not.

What is learned is the command of a posture: from target joint angles to target lengths of all
wires. The policy sees nothing else, so it steers without feedback, as a joint-muscle map does. Its
actions are changes about a rest, the mean of the wires' lengths in some starting postures: in most
of the whole range of commands the wires fight each other.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from math import ceil
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from experiments.harness.errors import ExperimentError
from jmm_agent.types import Floats
from kengoro.trained_maps import nominal_model
from kengoro_env.env import KengoroEnv
from kengoro_env.vector import KengoroVectorEnv

ID = "Kengoro/Posture-v0"
REACH = 0.3
"""How far an action of 1 goes from the rest, in parts of half the whole range."""

STARTS = 20
"""Starting postures of which the rest is the mean."""

SHORT, WHOLE = 50, 1000
"""Steps of an episode to learn from, and of a whole one. The arm settles in 15 steps, and more
targets teach more."""

HELD_OUT = 10**9
"""Seed of the first episode for judging; what is learned from has smaller ones."""

HELD = 5
"""Steps for which a policy holds a command, and of which its reward is the sum. The arm is most of
the way there by then, so that what a command is worth shows at once."""

COMMON: dict[str, Any] = {
    "gamma": 0.0,
    "learning_rate": 3e-3,
    "batch_size": 256,
    "ent_coef": 1e-3,
    "policy_kwargs": {
        "net_arch": {"pi": [], "vf": [64, 64], "qf": [256, 256]},
        "log_std_init": -1.5,
    },
}
"""What differs from the defaults of Stable-Baselines3; the same for both algorithms. A policy
without hidden layers is linear in the target, as commands nearly are."""

MANY: dict[str, dict[str, Any]] = {"ppo": {"n_steps": 32}, "sac": {"gradient_steps": 16}}
"""What learns from 64 arms at once as the defaults do from one; of SAC, by a quarter of its
updates."""

Observations = dict[str, NDArray[Any]]
Actions = NDArray[np.floating[Any]]
Policy = Callable[[Observations], Actions]
"""From the observations of many environments to their actions (num_envs, m) in [-1, 1]."""


@dataclass(frozen=True)
class Sizes:
    """How much is done.

    Attributes:
        steps: of environments, to learn from.
        robot: seed of the actual robot; None for the drawing.
        environments: arms stepped at once.
        checks: how many times the policy is judged while it learns, beside before it learns.
        short: held-out episodes of `SHORT` steps each time.
        whole: held-out episodes of `WHOLE` steps, five targets each, at the end.
    """

    steps: int = 300_000
    robot: int | None = None
    environments: int = 64
    checks: int = 10
    short: int = 32
    whole: int = 8


class Score(NamedTuple):
    """Of each of some episodes: mean reward of a step, share of steps with success (K,)."""

    reward: list[float]
    success: list[float]


def one_arm(robot: int | None) -> KengoroEnv:
    """A single environment, for what all have in common."""
    env = gym.make(ID, robot_seed=robot, camera=False).unwrapped
    assert isinstance(env, KengoroEnv)
    return env


def many_arms(robot: int | None, count: int, steps: int) -> KengoroVectorEnv:
    """``count`` environments with episodes of ``steps``, stepped by one thread."""
    envs = gym.make_vec(ID, count, robot_seed=robot, max_episode_steps=steps, threads=1)
    assert isinstance(envs, KengoroVectorEnv)
    return envs


def rest(env: KengoroEnv) -> Floats:
    """The action (m,) that commands the mean lengths of some starting postures."""
    lengths = [env.reset(seed=seed)[0]["lengths"] for seed in range(STARTS)]
    return env.lengths_to_action(np.mean(lengths, axis=0)).astype(float)


def about(centre: Floats) -> Callable[[Actions], NDArray[np.float32]]:
    """From changes in [-1, 1] to actions about ``centre`` (m,)."""
    return lambda changes: np.clip(centre + REACH * changes, -1.0, 1.0).astype(np.float32)


def random_policy(env: KengoroEnv) -> Policy:
    """Any action in each step."""
    rng = np.random.default_rng(0)
    return lambda observed: rng.uniform(-1.0, 1.0, (len(observed["lengths"]), len(env.muscles)))


def still_policy(env: KengoroEnv) -> Policy:
    """Hold the lengths that are felt in the first step, for one run of `judge`."""
    held: list[Floats] = []

    def act(observed: Observations) -> Actions:
        if not held:
            held.append(env.bounds.to_action(observed["lengths"]).astype(float))
        return held[0]

    return act


def rest_policy(env: KengoroEnv) -> Policy:
    """The rest, whatever the target: what a policy does that has not learned."""
    centre = rest(env)
    return lambda observed: np.tile(centre, (len(observed["target"]), 1))


def drawing_policy(env: KengoroEnv) -> Policy:
    """The lengths that the drawing has in the target posture: what is there to be learned."""
    drawing = nominal_model()
    return lambda observed: env.bounds.to_action(drawing.lengths(observed["target"])).astype(float)


OTHERS: dict[str, Callable[[KengoroEnv], Policy]] = {
    "random": random_policy,
    "still": still_policy,
    "rest": rest_policy,
    "nominal": drawing_policy,
}
"""Policies that learn nothing, by name."""


def judge(policy: Policy, robot: int | None, episodes: int, steps: int) -> Score:
    """What ``policy`` gets in held-out episodes of ``steps``, the same for every policy."""
    envs = many_arms(robot, episodes, steps)
    observed, _ = envs.reset(seed=HELD_OUT)
    rewards, successes = np.zeros(episodes), np.zeros(episodes)
    going = np.ones(episodes, dtype=bool)
    for _ in range(steps):
        actions = policy(observed).astype(np.float32)
        observed, reward, terminated, _, told = envs.step(actions)
        rewards += np.where(going, reward, 0.0)
        successes += going & told["success"]
        going &= ~terminated
    envs.close()
    return Score((rewards / steps).tolist(), (successes / steps).tolist())


def judge_others(robot: int | None, sizes: Sizes) -> dict[str, Any]:
    """Scores of the policies that learn nothing, in short episodes and in whole ones."""
    env = one_arm(robot)
    return {
        name: {
            "short": judge(make(env), robot, sizes.short, SHORT)._asdict(),
            "whole": judge(make(env), robot, sizes.whole, WHOLE)._asdict(),
        }
        for name, make in OTHERS.items()
    }


def learn(algorithm: str, seed: int, sizes: Sizes) -> dict[str, Any]:
    """Let one policy learn.

    Args:
        algorithm: a key of `MANY`.
        seed: of its first weights, of what it tries and of its episodes.
        sizes: how much.

    Returns:
        ``steps`` done and rewards in ``short`` episodes at each check, and the score in ``whole``
        episodes at the end.
    """
    algorithms, torch, normalised = libraries()
    torch.set_num_threads(1)
    from experiments.learn_posture.sb3_envs import Sb3Envs

    commanded = about(rest(one_arm(sizes.robot)))
    arms = many_arms(sizes.robot, sizes.environments, SHORT)
    envs = normalised(Sb3Envs(arms, "target", commanded, HELD), gamma=COMMON["gamma"])
    envs.seed(seed * sizes.environments)
    settings = deepcopy({**COMMON, **MANY[algorithm]})  # Stable-Baselines3 writes into them
    settings["policy_kwargs"]["activation_fn"] = torch.nn.Tanh
    model = algorithms[algorithm]("MlpPolicy", envs, seed=seed, device="cpu", **settings)

    def policy(observed: Observations) -> Actions:
        actions, _ = model.predict(envs.normalize_obs(observed["target"]), deterministic=True)
        return commanded(actions)

    steps, rewards = [0], [judge(policy, sizes.robot, sizes.short, SHORT).reward]
    for check in range(1, sizes.checks + 1):
        more = ceil(sizes.steps * check / (HELD * sizes.checks)) - model.num_timesteps
        if more > 0:
            model.learn(more, reset_num_timesteps=False)
        steps.append(HELD * model.num_timesteps)
        rewards.append(judge(policy, sizes.robot, sizes.short, SHORT).reward)
    whole = judge(policy, sizes.robot, sizes.whole, WHOLE)
    envs.close()
    return {"steps": steps, "short": rewards, "whole": whole._asdict()}


def libraries() -> tuple[dict[str, Any], Any, Any]:
    """The algorithms by name, torch, and what normalises observations and rewards.

    Raises:
        ExperimentError: they are not installed.
    """
    try:
        import torch
        from stable_baselines3 import PPO, SAC
        from stable_baselines3.common.vec_env import VecNormalize
    except ImportError:
        raise ExperimentError(
            "Learning needs Stable-Baselines3 and torch, which are not installed: "
            "pip install 'kengoro[rl]'."
        ) from None
    return {"ppo": PPO, "sac": SAC}, torch, VecNormalize
