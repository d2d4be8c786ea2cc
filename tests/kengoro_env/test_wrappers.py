"""Gymnasium's wrappers on all environments: limits, statistics, flat observations, copies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import (
    FilterObservation,
    FlattenObservation,
    RecordEpisodeStatistics,
    RecordVideo,
    TimeLimit,
    TransformAction,
)

import kengoro_env  # noqa: F401  registers the environments

IDS = ("Kengoro/CanGrasp-v0", "Kengoro/Posture-v0", "Kengoro/Elbow-v0")


def wrapped(env_id: str, steps: int) -> gym.Env[Any, Any]:
    """An environment without camera in wrappers that learning libraries use."""
    env = gym.make(env_id, camera=False, max_episode_steps=None, disable_env_checker=True)
    env = TransformAction(env, lambda action: 0.5 * action, env.action_space)
    return RecordEpisodeStatistics(TimeLimit(FlattenObservation(env), steps))


@pytest.mark.parametrize("env_id", IDS)
def test_an_episode_through_all_wrappers(env_id: str) -> None:
    env, bare = wrapped(env_id, 5), gym.make(env_id, camera=False)
    assert isinstance(env.observation_space, gym.spaces.Box)
    observation, _ = env.reset(seed=1)
    assert env.observation_space.contains(observation)
    known, _ = bare.reset(seed=1)
    flat = gym.spaces.flatten(bare.observation_space, known)
    np.testing.assert_array_equal(observation, flat)
    action, rewards = np.full(env.action_space.shape, 0.4, dtype=np.float32), []
    for step in range(1, 6):
        observation, reward, terminated, truncated, info = env.step(action)
        known, same, *_ = bare.step(0.5 * action)
        np.testing.assert_array_equal(
            observation, gym.spaces.flatten(bare.observation_space, known)
        )
        assert reward == same
        assert (terminated, truncated) == (False, step == 5)
        rewards.append(float(reward))
    assert info["episode"]["l"] == 5
    assert info["episode"]["r"] == pytest.approx(sum(rewards))


@pytest.mark.parametrize("env_id", IDS)
def test_a_wrapped_environment_is_pickled_as_it_stands(env_id: str) -> None:
    # As Gymnasium and Stable-Baselines3 do for their processes: FlattenObservation has a lambda.
    env = wrapped(env_id, 4)
    env.reset(seed=2)
    action = np.full(env.action_space.shape, -0.2, dtype=np.float32)
    env.step(action)
    twin = cloudpickle.loads(cloudpickle.dumps(env))
    for _ in range(3):
        ours, theirs = env.step(action), twin.step(action)
        np.testing.assert_array_equal(ours[0], theirs[0])
        assert ours[1:4] == theirs[1:4]
    assert ours[3]
    assert ours[4]["episode"]["r"] == theirs[4]["episode"]["r"]


@pytest.mark.parametrize("env_id", IDS[1:])
def test_a_policy_may_see_the_target_alone(env_id: str) -> None:
    env = FlattenObservation(FilterObservation(gym.make(env_id, camera=False), ["target"]))
    target = np.full(env.observation_space.shape, 0.05)
    observation, _ = env.reset(seed=0, options={"target": target})
    np.testing.assert_array_equal(observation, target)


@pytest.mark.slow  # moviepy comes with the extra [rl]
def test_an_episode_is_filmed(tmp_path: Path) -> None:
    env = gym.make("Kengoro/Elbow-v0", render_mode="rgb_array", max_episode_steps=10)
    env = RecordVideo(env, str(tmp_path / "films"))
    env.reset(seed=0)
    for _ in range(10):
        env.step(np.zeros(3, dtype=np.float32))
    env.close()
    [film] = tmp_path.glob("films/*.mp4")
    assert film.stat().st_size > 1000
