"""What the programs beside this file share; each is run by an interpreter that has its library."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from time import monotonic
from typing import Any

import gymnasium as gym
import numpy as np

from kengoro_env import ScaledObservation, ScaledVectorObservation

ID = "Kengoro/Elbow-v0"
EPISODE = 250
"""Steps of an episode of the training."""
SECONDS = float(os.environ.get("KENGORO_LIBRARY_SECONDS", "60"))
"""Time of the training [s]."""
LEAST, MOST = -0.05, 1.0
"""Range of the rewards."""


def make(**options: Any) -> ScaledObservation:
    """An elbow with observations for a network."""
    return ScaledObservation(gym.make(ID, max_episode_steps=EPISODE, **options))


def make_many(count: int, **options: Any) -> ScaledVectorObservation:
    """Many elbows at once with observations for a network."""
    return ScaledVectorObservation(gym.make_vec(ID, count, max_episode_steps=EPISODE, **options))


class Clock:
    """Counts the time of a training."""

    def __init__(self) -> None:
        self._begin = monotonic()

    def goes_on(self) -> bool:
        """Whether there is time left."""
        return monotonic() - self._begin < SECONDS


def check_rewards(rewards: Any) -> None:
    """Rewards must be of the environment's range, and not all the same."""
    array = np.asarray(rewards, dtype=float)
    assert np.isfinite(array).all()
    assert LEAST <= array.min() < array.max() <= MOST, (array.min(), array.max())


def check_times(times: Any) -> None:
    """Times in infos must be multiples of a control step of 20 ms within an episode."""
    steps = np.asarray(times, dtype=float) / 0.02
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    assert steps.min() >= 0
    assert round(steps.max()) == EPISODE, steps.max()


def mean_reward(act: Callable[[Any], Any]) -> float:
    """Mean reward of a step in whole episodes of a policy, from observation to action."""
    env, rewards = ScaledObservation(gym.make(ID)), []
    for seed in (50, 51, 52):
        observation, _ = env.reset(seed=seed)
        truncated = False
        while not truncated:
            action = np.asarray(act(observation), dtype=np.float32).reshape(3).clip(-1.0, 1.0)
            observation, reward, _, truncated, _ = env.step(action)
            rewards.append(reward)
    return float(np.mean(rewards))


def random_reward() -> float:
    """The same of random actions."""
    random = np.random.default_rng(0)
    return mean_reward(lambda _: random.uniform(-1.0, 1.0, 3))


def report(library: Any, steps: int, act: Callable[[Any], Any] | None = None) -> None:
    """Print what the test reads: version, steps, and rewards if something was trained."""
    found = {"version": library.__version__, "gymnasium": gym.__version__, "steps": int(steps)}
    if act is not None:
        found |= {"random": random_reward(), "learned": mean_reward(act)}
    print(json.dumps(found))
