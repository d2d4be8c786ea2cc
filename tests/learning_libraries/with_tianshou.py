"""Tianshou: its collector on its vector environments, and PPO by its trainer."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import tianshou
import torch
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, CollectStats, VectorReplayBuffer
from tianshou.env import DummyVectorEnv, SubprocVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic
from torch.distributions import Independent, Normal
from trial import EPISODE, ID, Clock, check_rewards, check_times, make, report

COUNT, ROLLOUT = 4, 1000


def raw() -> gym.Env:
    """An elbow with its own observations."""
    return gym.make(ID, max_episode_steps=EPISODE)


def check_raw() -> None:
    """Dict observations and infos of whole episodes, in processes and without."""
    unused = learner(make().observation_space, make().action_space)
    for kind in (DummyVectorEnv, SubprocVectorEnv):
        envs = kind([raw] * COUNT)
        envs.seed(0)
        buffer = VectorReplayBuffer(2 * COUNT * EPISODE, COUNT)
        collector = Collector(unused, envs, buffer)
        collector.reset()
        found = collector.collect(n_episode=COUNT, random=True)
        assert (found.n_collected_steps, found.n_collected_episodes) == (COUNT * EPISODE, COUNT)
        assert list(found.lens) == [EPISODE] * COUNT
        batch = buffer.sample_indices(0)
        seen = buffer[batch]
        for name, size in (("lengths", 3), ("tensions", 3), ("target", 1)):
            assert seen.obs[name].shape == (COUNT * EPISODE, size)
            assert seen.obs[name].dtype == np.float64
        check_rewards(seen.rew)
        check_times(seen.info["time"])
        assert seen.info["success"].dtype == bool
        assert seen.truncated.sum() == COUNT
        envs.close()


def learner(space: Any, actions: Any) -> PPO:
    """PPO with small networks."""
    layers = {"state_shape": space.shape, "hidden_sizes": [64, 64], "activation": torch.nn.Tanh}
    actor = ContinuousActorProbabilistic(
        preprocess_net=Net(**layers), action_shape=actions.shape, unbounded=True
    )
    critic = ContinuousCritic(preprocess_net=Net(**layers))
    policy = ProbabilisticActorPolicy(
        actor=actor,
        dist_fn=lambda located: Independent(Normal(*located), 1),
        action_space=actions,
        action_bound_method="clip",
    )
    optim = AdamOptimizerFactory(lr=1e-3)
    return PPO(policy=policy, critic=critic, optim=optim, gamma=0.9, ent_coef=0.0)


class Watched(Collector[CollectStats]):
    """A collector that counts what it collects."""

    steps = 0
    rewards: list[Any]

    def collect(self, *args: Any, **options: Any) -> CollectStats:
        found = super().collect(*args, **options)
        self.steps += found.n_collected_steps
        self.rewards.append(self.buffer[self.buffer.sample_indices(0)].rew)
        return found


def main() -> None:
    torch.manual_seed(0)
    check_raw()
    envs = DummyVectorEnv([make] * COUNT)
    envs.seed(0)
    ppo = learner(make().observation_space, make().action_space)
    before = torch.cat([p.detach().flatten().clone() for p in ppo.policy.parameters()])
    collector = Watched(ppo, envs, VectorReplayBuffer(2 * ROLLOUT, COUNT))
    collector.rewards = []
    clock = Clock()
    ppo.run_training(
        OnPolicyTrainerParams(
            training_collector=collector, max_epochs=10**6, epoch_num_steps=ROLLOUT,
            collection_step_num_env_steps=ROLLOUT, update_step_num_repetitions=8, batch_size=250,
            test_collector=Collector(ppo, DummyVectorEnv([make])),
            stop_fn=lambda _: not clock.goes_on(), verbose=False, show_progress=False,
        )
    )  # fmt: skip
    after = torch.cat([p.detach().flatten() for p in ppo.policy.parameters()])
    assert after.isfinite().all()
    assert (after - before).abs().max() > 1e-3
    check_rewards(np.concatenate(collector.rewards))
    report(tianshou, collector.steps, ppo.policy.compute_action)


if __name__ == "__main__":
    main()
