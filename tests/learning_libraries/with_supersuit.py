"""SuperSuit: its wrappers of single environments, and its vector environments."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import supersuit
from trial import EPISODE, ID, Clock, check_rewards, check_times, make, report

COUNT, FRAMES = 4, 3


def wrapped() -> gym.Env:
    """An elbow with the last observations, actions that stick, and steps that are held."""
    env = supersuit.clip_actions_v0(make())
    env = supersuit.sticky_actions_v0(env, repeat_action_probability=0.1)
    env = supersuit.delay_observations_v0(env, 1)
    return supersuit.frame_stack_v1(env, FRAMES)


def check_single() -> None:
    """Each observation is of the space, and the newest one of the stack is the environment's."""
    env, plain = supersuit.frame_stack_v1(make(), FRAMES), make()
    assert env.observation_space.shape == (7 * FRAMES,)
    first, _ = env.reset(seed=0)
    expected, _ = plain.reset(seed=0)
    np.testing.assert_array_equal(first[-7:], expected)
    env.action_space.seed(0)
    for _ in range(EPISODE):
        action = env.action_space.sample()
        found, reward, *ends, info = env.step(action)
        expected, same, *same_ends, _ = plain.step(action)
        assert env.observation_space.contains(found)
        np.testing.assert_array_equal(found[-7:], expected)
        assert (reward, ends) == (same, same_ends)
    assert ends == [False, True]
    assert "success" in info
    env = supersuit.dtype_v0(supersuit.flatten_v0(make()), np.float16)
    assert env.reset(seed=0)[0].dtype == np.float16


def check_raw() -> None:
    """Environments with dict observations, each a copy of one, in processes and without."""
    for multiprocessing in (False, True):
        raw = gym.make(ID, max_episode_steps=EPISODE)
        envs = supersuit.gym_vec_env_v0(raw, COUNT, multiprocessing)
        observations, infos = envs.reset(seed=0)
        assert observations["lengths"].shape == (COUNT, 3)
        for _ in range(EPISODE):
            observations, rewards, _, truncated, infos = envs.step(envs.action_space.sample())
            check_rewards(rewards)
        assert truncated.all()
        assert infos["success"].shape == infos["time"].shape == (COUNT,)
        check_times(infos["time"])
        envs.close()


def collect() -> int:
    """Random actions in many wrapped environments; number of steps."""
    envs = supersuit.gym_vec_env_v0(wrapped(), COUNT)
    envs.action_space.seed(0)
    observations, _ = envs.reset(seed=0)
    clock, rewards, times = Clock(), [], []
    while clock.goes_on() or len(rewards) <= EPISODE:
        observations, reward, _, _, infos = envs.step(envs.action_space.sample())
        assert observations.shape == (COUNT, 7 * FRAMES)
        assert observations.dtype == np.float32
        assert envs.observation_space.contains(observations)
        rewards.append(reward)
        times.append(infos["time"])
    assert len(np.unique(observations[:, -7:], axis=0)) == COUNT
    check_rewards(rewards)
    check_times(times)
    return np.size(rewards)


if __name__ == "__main__":
    check_single()
    check_raw()
    report(supersuit, collect())
