"""Reward that PPO reaches on the elbow with raw, scaled and normalised observations.

PPO of Stable-Baselines3 (extra ``[rl]``) with its default settings learns `STEPS` steps of
``Kengoro/Elbow-v0``, 2048 of 8 environments at a time. Its mean action is then judged in other
episodes, beside policies that do not learn. Medians and ranges are over `SEEDS`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Callable
from time import perf_counter
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.wrappers.vector import FlattenObservation
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from experiments.harness.errors import ExperimentError
from experiments.learn_posture.policies import libraries
from kengoro_env import ScaledVectorObservation

ID = "Kengoro/Elbow-v0"
STEPS, SEEDS = 100_000, (0, 1, 2)
ENVIRONMENTS, ROLLOUT = 8, 256
"""Number of environments, and of their steps before an update: together the default of PPO."""

EPISODES, FIRST = 8, 80
"""Number of episodes of the judgement, and seed of the first."""

Values = NDArray[Any]
Envs = VectorEnv[Any, Any, Any]
Policy = Callable[[Values], Values]

KINDS: dict[str, tuple[Callable[[Envs], Envs], dict[str, bool] | None]] = {
    "raw": (FlattenObservation, None),
    "ScaledVectorObservation": (ScaledVectorObservation, None),
    "VecNormalize": (FlattenObservation, {}),
}
"""Wrapper of the environments, and options of VecNormalize; None: without."""


def judged(wrapper: Callable[[Envs], Envs], policy: Policy) -> float:
    """Mean reward of a step, of a policy on observations (n, k) with actions (n, m)."""
    envs = wrapper(gym.make_vec(ID, EPISODES, threads=1))
    observed, _ = envs.reset(seed=FIRST)
    total, going = [], True
    while going:
        observed, rewards, _, truncated, _ = envs.step(policy(observed))
        total.append(rewards)
        going = not truncated.any()
    envs.close()
    return float(np.mean(total))


def learned(kind: str, seed: int, steps: int = STEPS) -> float:
    """Mean reward of a step after learning.

    Args:
        kind: a key of `KINDS`.
        seed: of weights, exploration and episodes.
        steps: number of steps of all environments together.
    """
    algorithms, torch, normalised = libraries()
    from experiments.learn_posture.sb3_envs import Sb3Envs

    torch.set_num_threads(1)
    wrapper, options = KINDS[kind]
    envs = Sb3Envs(wrapper(gym.make_vec(ID, ENVIRONMENTS, threads=1)), None, np.asarray)
    if options is not None:
        envs = normalised(envs, **options)
    envs.seed(seed * ENVIRONMENTS)
    model = algorithms["ppo"]("MlpPolicy", envs, n_steps=ROLLOUT, seed=seed, device="cpu")
    model.learn(steps)

    def policy(observed: Values) -> Values:
        if options is not None:
            observed = envs.normalize_obs(observed)
        return np.asarray(model.predict(observed, deterministic=True)[0])

    result = judged(wrapper, policy)
    envs.close()
    return result


def fixed() -> dict[str, float]:
    """Mean rewards of a step of random actions, and of holding the first lengths."""
    random = np.random.default_rng(0)
    env: Any = gym.make(ID).unwrapped
    lengths = slice(0, len(env.muscles))  # the first entry of the flat observation
    held: list[Values] = []

    def still(observed: Values) -> Values:
        if not held:
            held.append(env.bounds.to_action(observed[:, lengths]))
        return held[0].astype(np.float32)

    def sampled(observed: Values) -> Values:
        shape = (len(observed), len(env.muscles))
        return random.uniform(-1.0, 1.0, shape).astype(np.float32)

    return {
        "holds still": judged(FlattenObservation, still),
        "random actions": judged(FlattenObservation, sampled),
    }


def main() -> None:
    """Print the table.

    Raises:
        SystemExit: Stable-Baselines3 is not installed.
    """
    try:
        libraries()
    except ExperimentError as error:
        raise SystemExit(str(error)) from None
    table = Table(title=f"{ID}, PPO after {STEPS:,} steps")
    for column in ("observations", "reward of a step", "training [s]"):
        table.add_column(column, justify="left" if column == "observations" else "right")
    for kind in KINDS:
        begin = perf_counter()
        rewards = [learned(kind, seed) for seed in SEEDS]
        each = (perf_counter() - begin) / len(SEEDS)
        spread = f"({min(rewards):.2f} to {max(rewards):.2f})"
        table.add_row(kind, f"{np.median(rewards):.2f} {spread}", f"{each:.0f}")
    for name, reward in fixed().items():
        table.add_row(name, f"{reward:.2f}", "")
    Console().print(table)


if __name__ == "__main__":
    main()
