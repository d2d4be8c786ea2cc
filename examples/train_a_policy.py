"""Train a policy: PPO learns to reach elbow angles on actual robots, from the reward alone.

Needs `pip install 'kengoro[rl]'`. Prints the mean reward of random actions and of the policy.
"""

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

from kengoro_env import ScaledObservation

STEPS = 20_000


def make() -> gym.Env:
    """An elbow with the departures of robot 1."""
    return gym.make("kengoro_env:Kengoro/Elbow-v0", robot_seed=1)


def mean_reward(policy: PPO | None, episodes: int = 3) -> float:
    """Mean reward of a step, of a policy or of random actions."""
    env, rewards = ScaledObservation(make()), []
    env.action_space.seed(0)
    for episode in range(episodes):
        observation, _ = env.reset(seed=episode)
        over = False
        while not over:
            action = env.action_space.sample() if policy is None else policy.predict(observation)[0]
            observation, reward, terminated, truncated, _ = env.step(action)
            rewards.append(reward)
            over = terminated or truncated
    return float(np.mean(rewards))


envs = make_vec_env(lambda: ScaledObservation(make()), n_envs=4, seed=0)
policy = PPO("MlpPolicy", envs, n_steps=256, seed=0)
before = mean_reward(None)
policy.learn(STEPS)
print(f"mean reward in a step: {before:.2f} by random actions, {mean_reward(policy):.2f} learned")
