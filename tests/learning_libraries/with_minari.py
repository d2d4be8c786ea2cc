"""Minari: its collector records episodes, and its data set gives them and the environment back."""

from __future__ import annotations

import os
import tempfile
from typing import Any

os.environ["MINARI_DATASETS_PATH"] = tempfile.mkdtemp()  # read when it is imported

import gymnasium as gym
import minari
import numpy as np
from trial import EPISODE, ID, Clock, check_rewards, check_times, make, report

NAME, SCALED = "kengoro/elbow/random-v0", "kengoro/elbow/scaled-v0"


def collected(env: gym.Env[Any, Any], name: str, clock: Clock | None) -> tuple[Any, list[Any]]:
    """The data set of random actions in two or more episodes, and their rewards."""
    env = minari.DataCollector(env, record_infos=True)
    env.action_space.seed(0)
    rewards: list[Any] = []
    while len(rewards) < 2 or (clock is not None and clock.goes_on()):
        env.reset(seed=len(rewards))
        own, truncated = [], False
        while not truncated:
            _, reward, _, truncated, _ = env.step(env.action_space.sample())
            own.append(reward)
        rewards.append(own)
    dataset = env.create_dataset(name, algorithm_name="random", requirements=["kengoro"])
    env.close()
    assert dataset.total_episodes == len(rewards)
    return minari.load_dataset(name), rewards


def check_raw(clock: Clock) -> int:
    """Dict observations, actions, rewards and infos as they were; number of steps."""
    dataset, rewards = collected(gym.make(ID, max_episode_steps=EPISODE), NAME, clock)
    assert dataset.total_steps == len(rewards) * EPISODE
    for own, episode in zip(rewards, dataset, strict=True):
        for name, size in (("lengths", 3), ("tensions", 3), ("target", 1)):
            assert episode.observations[name].shape == (EPISODE + 1, size)
            assert episode.observations[name].dtype == np.float64
        assert episode.actions.shape == (EPISODE, 3)
        assert episode.actions.dtype == np.float32
        np.testing.assert_array_equal(episode.rewards, own)
        check_rewards(episode.rewards)
        check_times(episode.infos["time"])
        assert episode.infos["success"].dtype == bool
        assert list(episode.truncations) == [False] * (EPISODE - 1) + [True]
    return int(dataset.total_steps)


def check_recovered() -> None:
    """The data set makes its environment again, which repeats its first episode."""
    dataset = minari.load_dataset(NAME)
    episode = dataset[0]
    env = dataset.recover_environment()
    first, _ = env.reset(seed=0)
    np.testing.assert_array_equal(first["lengths"], episode.observations["lengths"][0])
    for action, reward in zip(episode.actions, episode.rewards, strict=True):
        assert env.step(action)[1] == reward
    env.close()


def check_scaled() -> None:
    """Observations for a network can be recorded, too."""
    dataset, _ = collected(make(), SCALED, None)
    assert dataset[1].observations.shape == (EPISODE + 1, 7)
    assert dataset[1].observations.dtype == np.float32
    assert dataset.recover_environment().observation_space == make().observation_space


if __name__ == "__main__":
    found = check_raw(Clock())
    check_recovered()
    check_scaled()
    report(minari, found)
