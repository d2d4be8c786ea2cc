"""Policies for ``Kengoro/Posture-v0``: learned from its reward, and fixed ones for comparison.

A policy maps target joint angles to target lengths of all muscles. It observes nothing else, so it
is open-loop control, like a joint-muscle map. Its actions are changes from a rest command, the mean
of the muscle lengths in some starting postures, because most of the range of commands causes
antagonistic muscles to pull against each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from kengoro_env.robot.own_model import Model
from kengoro_env.vector import KengoroVectorEnv

ID = "Kengoro/Posture-v0"
REACH = 0.3
"""Change by an action of 1, as share of half the range of commands."""

STARTS = 20
"""Number of starting postures whose mean is the rest command."""

SHORT, WHOLE = 50, 1000
"""Steps of a training episode and of a whole one. The arm settles in 15 steps, and short episodes
have more targets."""

HELD_OUT = 10**9
"""Seed of the first evaluation episode; training episodes have smaller seeds."""

HELD = 5
"""Number of steps for which a command is held and rewards are summed. The arm is close to rest by
then, so the reward follows the command immediately."""

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
"""Settings of both algorithms that differ from the defaults of Stable-Baselines3. A policy without
hidden layers is linear in the target, which approximates the commands well."""

MANY: dict[str, dict[str, Any]] = {"ppo": {"n_steps": 32}, "sac": {"gradient_steps": 16}}
"""Settings for 64 arms at once that match the defaults for one, with a quarter of SAC's updates."""

Observations = dict[str, NDArray[Any]]
Actions = NDArray[np.floating[Any]]
Policy = Callable[[Observations], Actions]
"""From the observations of many environments to their actions (num_envs, m) in [-1, 1]."""


@dataclass(frozen=True)
class Sizes:
    """Amount of training and evaluation.

    Attributes:
        steps: number of training steps of the environments.
        robot: seed of the actual robot; None for the nominal model.
        environments: number of arms that are stepped at once.
        checks: number of evaluations during training, in addition to the one before it.
        short: number of evaluation episodes of `SHORT` steps in each evaluation.
        whole: number of evaluation episodes of `WHOLE` steps, with five targets each, at the end.
    """

    steps: int = 300_000
    robot: int | None = None
    environments: int = 64
    checks: int = 10
    short: int = 32
    whole: int = 8


class Score(NamedTuple):
    """Scores of K episodes: mean reward of a step, share of steps with success, and mean of the
    measured tensions [N]."""

    reward: list[float]
    success: list[float]
    tension: list[float]


def one_arm(robot: int | None) -> KengoroEnv:
    """A single environment, for its spaces and limits."""
    env = gym.make(ID, robot_seed=robot, camera=False).unwrapped
    assert isinstance(env, KengoroEnv)
    return env


def many_arms(
    robot: int | None, count: int, steps: int, models: Sequence[Model] | None = None
) -> KengoroVectorEnv:
    """``count`` environments with episodes of ``steps``, stepped by one thread.

    Each is a clone of the robot, or has its own one of ``models``, as many as environments.
    """
    envs = gym.make_vec(
        ID, count, robot_seed=robot, max_episode_steps=steps, threads=1, models=models
    )
    assert isinstance(envs, KengoroVectorEnv)
    return envs


def rest(env: KengoroEnv) -> Floats:
    """Action of the rest command, the mean lengths of some starting postures, shape (m,)."""
    lengths = [env.reset(seed=seed)[0]["lengths"] for seed in range(STARTS)]
    return env.lengths_to_action(np.mean(lengths, axis=0)).astype(float)


def about(centre: Floats) -> Callable[[Actions], NDArray[np.float32]]:
    """Function from changes in [-1, 1] to actions about ``centre``, shape (m,)."""
    return lambda changes: np.clip(centre + REACH * changes, -1.0, 1.0).astype(np.float32)


def random_policy(env: KengoroEnv) -> Policy:
    """Policy with uniform random actions."""
    rng = np.random.default_rng(0)
    return lambda observed: rng.uniform(-1.0, 1.0, (len(observed["lengths"]), len(env.muscles)))


def still_policy(env: KengoroEnv) -> Policy:
    """Policy that holds the lengths measured in the first step, for one run of `judge`."""
    held: list[Floats] = []

    def act(observed: Observations) -> Actions:
        if not held:
            held.append(env.bounds.to_action(observed["lengths"]).astype(float))
        return held[0]

    return act


def rest_policy(env: KengoroEnv) -> Policy:
    """Policy with the rest command for every target, like an untrained policy."""
    centre = rest(env)
    return lambda observed: np.tile(centre, (len(observed["target"]), 1))


def nominal_policy(env: KengoroEnv) -> Policy:
    """Policy with the nominal lengths of the target posture."""
    nominal = nominal_model()
    return lambda observed: env.bounds.to_action(nominal.lengths(observed["target"])).astype(float)


OTHERS: dict[str, Callable[[KengoroEnv], Policy]] = {
    "random": random_policy,
    "still": still_policy,
    "rest": rest_policy,
    "nominal": nominal_policy,
}
"""Policies that do not learn, by name."""


def judge(policy: Policy, robot: int | None, episodes: int, steps: int) -> Score:
    """Score of a policy in evaluation episodes, which are the same for every policy."""
    envs = many_arms(robot, episodes, steps)
    observed, _ = envs.reset(seed=HELD_OUT)
    rewards, successes, tensions = np.zeros((3, episodes))
    going = np.ones(episodes, dtype=bool)
    for _ in range(steps):
        actions = policy(observed).astype(np.float32)
        observed, reward, terminated, _, info = envs.step(actions)
        rewards += np.where(going, reward, 0.0)
        successes += going & info["success"]
        tensions += observed["tensions"].mean(axis=1)
        going &= ~terminated
    envs.close()
    return Score(*((sums / steps).tolist() for sums in (rewards, successes, tensions)))


def judge_others(robot: int | None, sizes: Sizes) -> dict[str, Any]:
    """Scores of the policies that do not learn, in short and whole episodes."""
    env = one_arm(robot)
    return {
        name: {
            "short": judge(make(env), robot, sizes.short, SHORT)._asdict(),
            "whole": judge(make(env), robot, sizes.whole, WHOLE)._asdict(),
        }
        for name, make in OTHERS.items()
    }


def learn(algorithm: str, seed: int, sizes: Sizes) -> dict[str, Any]:
    """Train one policy.

    Args:
        algorithm: a key of `MANY`.
        seed: of initial weights, exploration and episodes.
        sizes: amount of training.

    Returns:
        ``steps`` of training and rewards in ``short`` episodes at each evaluation, and the score
        in ``whole`` episodes at the end.
    """
    algorithms, torch, normalised = libraries()
    torch.set_num_threads(1)
    from experiments.learn_posture.sb3_envs import Sb3Envs

    commanded = about(rest(one_arm(sizes.robot)))
    arms = many_arms(sizes.robot, sizes.environments, SHORT)
    envs = normalised(Sb3Envs(arms, "target", commanded, HELD), gamma=COMMON["gamma"])
    envs.seed(seed * sizes.environments)
    settings = settings_of(algorithm, torch)
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


def settings_of(algorithm: str, torch: Any) -> dict[str, Any]:
    """Settings of an algorithm, a key of `MANY`, which Stable-Baselines3 may write into."""
    settings = deepcopy({**COMMON, **MANY[algorithm]})
    settings["policy_kwargs"]["activation_fn"] = torch.nn.Tanh
    return settings


def libraries() -> tuple[dict[str, Any], Any, Any]:
    """Algorithms by name, torch, and the wrapper that normalises observations and rewards.

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
