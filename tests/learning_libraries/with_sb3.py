"""Stable-Baselines3: its check, PPO as in its documentation, and SAC."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import stable_baselines3
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.env_util import make_vec_env
from trial import EPISODE, ID, Clock, check_rewards, check_times, make, report

COUNT = 4


class Watch(BaseCallback):
    """Notes rewards and infos, and ends the training with the clock."""

    def __init__(self, clock: Clock | None) -> None:
        super().__init__()
        self.clock, self.rewards, self.times = clock, [], []  # type: ignore[var-annotated]

    def _on_step(self) -> bool:
        self.rewards.append(self.locals["rewards"].copy())
        self.times += [info["time"] for info in self.locals["infos"]]
        assert all("success" in info for info in self.locals["infos"])
        return self.clock is None or self.clock.goes_on()


def check() -> None:
    """Its check of environments, as they are and with observations for a network."""
    for env in (make(), gym.make(ID), gym.make("Kengoro/Posture-v0"), make(dtype="float32")):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            check_env(env)


def trained(model: Any, steps: int, clock: Clock | None) -> int:
    """Learn for a number of steps or as long as the clock goes; number of steps."""
    before = torch.cat([p.detach().flatten().clone() for p in model.policy.parameters()])
    watch = Watch(clock)
    model.learn(steps, callback=watch)
    after = torch.cat([p.detach().flatten() for p in model.policy.parameters()])
    assert after.isfinite().all()
    assert (after - before).abs().max() > 1e-3
    check_rewards(watch.rewards)
    check_times(watch.times)
    assert np.size(watch.rewards) == model.num_timesteps
    return int(model.num_timesteps)


def main() -> None:
    check()
    options = {"max_episode_steps": EPISODE}
    raw = make_vec_env(f"kengoro_env:{ID}", n_envs=2, seed=0, env_kwargs=options)
    trained(PPO("MultiInputPolicy", raw, n_steps=EPISODE, seed=0), 2 * EPISODE, None)
    trained(SAC("MlpPolicy", make(), learning_starts=100, seed=0), EPISODE + 1, None)
    envs = make_vec_env(make, n_envs=COUNT, seed=0)
    model = PPO("MlpPolicy", envs, n_steps=EPISODE, batch_size=250, gamma=0.9, seed=0)
    steps = trained(model, 10**9, Clock())
    report(stable_baselines3, steps, lambda seen: model.predict(seen, deterministic=True)[0])


if __name__ == "__main__":
    main()
