"""TorchRL: checks, rollouts with infos, and PPO with a collector, as in its tutorial."""

from __future__ import annotations

import gymnasium as gym
import torch
import torchrl
from gymnasium.vector import AutoresetMode
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, GymWrapper
from torchrl.envs.utils import ExplorationType, check_env_specs, set_exploration_type
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE
from trial import EPISODE, ID, Clock, check_rewards, check_times, make, make_many, report

COUNT, BATCH = 4, 1000
MODE = AutoresetMode.DISABLED
"""TorchRL resets environments itself."""

torch.manual_seed(0)


def check_single() -> None:
    """Raw observations and infos of a single environment, by its id and by itself."""
    for env in (
        GymEnv(f"kengoro_env:{ID}", max_episode_steps=EPISODE),
        GymWrapper(gym.make("Kengoro/Posture-v0")),
        GymWrapper(make()),
    ):
        check_env_specs(env)
    env = GymEnv(ID, max_episode_steps=EPISODE).auto_register_info_dict()
    check_env_specs(env)
    found = env.rollout(2 * EPISODE, break_when_any_done=False)
    assert found.shape == (2 * EPISODE,)
    for name, size in (("lengths", 3), ("tensions", 3), ("target", 1)):
        assert found["next", name].shape == (2 * EPISODE, size)
        assert found["next", name].dtype == torch.float64
    check_rewards(found["next", "reward"])
    check_times(found["next", "time"])
    assert found["next", "success"].dtype == torch.bool
    assert found["next", "joint_angles"].shape == (2 * EPISODE, 1)
    assert found["next", "truncated"].sum() == 2


def check_many(mode: AutoresetMode) -> None:
    """Raw observations of many environments, which TorchRL resets or which reset themselves."""
    many = gym.make_vec(ID, COUNT, max_episode_steps=EPISODE, autoreset_mode=mode)
    env = GymWrapper(many)
    check_env_specs(env)
    found = env.rollout(2 * EPISODE + 1, break_when_any_done=False)
    assert found.shape == (COUNT, 2 * EPISODE + 1)
    assert found["next", "lengths"].shape == (COUNT, 2 * EPISODE + 1, 3)
    check_rewards(found["next", "reward"])
    assert found["next", "truncated"].sum() == 2 * COUNT
    if mode is AutoresetMode.SAME_STEP:  # only then it reads infos
        assert found["next", "success"].dtype == torch.bool
        check_times(found["next", "time"])


def train() -> None:
    """PPO on many environments."""
    env = GymWrapper(make_many(COUNT, autoreset_mode=MODE))
    body = nn.Sequential(nn.Linear(7, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh())
    network = nn.Sequential(body, nn.Linear(64, 6), NormalParamExtractor())
    actor = ProbabilisticActor(
        TensorDictModule(network, ["observation"], ["loc", "scale"]),
        in_keys=["loc", "scale"], spec=env.action_spec, distribution_class=TanhNormal,
        return_log_prob=True,
    )  # fmt: skip
    value = nn.Sequential(nn.Linear(7, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh())
    critic = ValueOperator(nn.Sequential(value, nn.Linear(64, 1)), in_keys=["observation"])
    advantage, loss = GAE(gamma=0.9, lmbda=0.95, value_network=critic), ClipPPOLoss(actor, critic)
    optimiser = torch.optim.Adam(loss.parameters(), lr=1e-3)
    before = torch.cat([p.detach().flatten().clone() for p in actor.parameters()])
    clock, steps, rewards = Clock(), 0, []
    collector = Collector(env, actor, frames_per_batch=BATCH, total_frames=-1)
    for batch in collector:
        assert batch.shape == (COUNT, BATCH // COUNT)
        assert batch["observation"].dtype == torch.float32
        steps += batch.numel()
        rewards.append(batch["next", "reward"].flatten())
        for _ in range(8):
            advantage(batch)
            data = batch.reshape(-1)
            for part in data[torch.randperm(len(data))].split(250):
                losses = loss(part)
                total = sum(losses[f"loss_{name}"] for name in ("objective", "critic", "entropy"))
                optimiser.zero_grad()
                total.backward()
                optimiser.step()
        if not clock.goes_on():
            break
    collector.shutdown()
    check_rewards(torch.cat(rewards))
    after = torch.cat([p.detach().flatten() for p in actor.parameters()])
    assert after.isfinite().all()
    assert (after - before).abs().max() > 1e-3

    def act(observation: object) -> object:
        with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
            return actor(torch.as_tensor(observation))[2]

    report(torchrl, steps, act)


if __name__ == "__main__":
    check_single()
    for mode in (AutoresetMode.DISABLED, AutoresetMode.SAME_STEP):
        check_many(mode)
    train()
