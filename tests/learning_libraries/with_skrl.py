"""skrl: PPO with the sequential trainer, on one environment and on many."""

from __future__ import annotations

from typing import Any

import skrl
import torch
from skrl.agents.torch.ppo import PPO, PPO_CFG
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.models.torch import DeterministicMixin, GaussianMixin, Model
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from torch import nn
from trial import EPISODE, Clock, check_rewards, check_times, make, make_many, report

COUNT, ROLLOUT = 4, 256


def body(outputs: int) -> nn.Module:
    return nn.Sequential(
        nn.Linear(7, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs)
    )


class Policy(GaussianMixin, Model):
    def __init__(self, env: Any) -> None:
        Model.__init__(
            self, observation_space=env.observation_space, action_space=env.action_space,
            device=env.device,
        )  # fmt: skip
        GaussianMixin.__init__(self, clip_actions=True)
        # Actions that are clipped far from an unbounded mean have a probability of 0: then skrl's
        # ratio of probabilities is not finite.
        self.network = nn.Sequential(body(self.num_actions), nn.Tanh())
        self.log_std_parameter = nn.Parameter(torch.zeros(self.num_actions))

    def compute(self, inputs: dict[str, Any], role: str = "") -> tuple[Any, dict[str, Any]]:
        return self.network(inputs["observations"]), {"log_std": self.log_std_parameter}


class Value(DeterministicMixin, Model):
    def __init__(self, env: Any) -> None:
        Model.__init__(
            self, observation_space=env.observation_space, action_space=env.action_space,
            device=env.device,
        )  # fmt: skip
        DeterministicMixin.__init__(self)
        self.network = body(1)

    def compute(self, inputs: dict[str, Any], role: str = "") -> tuple[Any, dict[str, Any]]:
        return self.network(inputs["observations"]), {}


class Watch(PPO):
    """PPO that notes what it is given."""

    rewards: list[Any]
    times: list[Any]

    def record_transition(self, **given: Any) -> None:
        super().record_transition(**given)
        self.rewards.append(given["rewards"].flatten().clone())
        assert given["observations"].shape[1:] == (7,)
        assert given["observations"].dtype == torch.float32
        self.times.append(torch.as_tensor(given["infos"]["time"]).flatten())
        assert "success" in given["infos"]


def trained(env: Any, clock: Clock | None) -> tuple[Watch, int]:
    """An agent after some rollouts, as long as the clock goes, and its number of steps."""
    policy, value = Policy(env), Value(env)
    agent = Watch(
        models={"policy": policy, "value": value},
        memory=RandomMemory(memory_size=ROLLOUT, num_envs=env.num_envs, device=env.device),
        observation_space=env.observation_space, action_space=env.action_space,
        device=env.device, cfg=PPO_CFG(rollouts=ROLLOUT, mini_batches=4, discount_factor=0.9),
    )  # fmt: skip
    agent.cfg.experiment.write_interval = agent.cfg.experiment.checkpoint_interval = 0
    agent.rewards, agent.times = [], []
    before = torch.cat([p.detach().flatten().clone() for p in policy.parameters()])
    settings = {
        "timesteps": ROLLOUT, "disable_progressbar": True, "close_environment_at_exit": False,
        "headless": env.num_envs > 1,  # it draws many environments by `call`, which not all have
    }  # fmt: skip
    trainer = SequentialTrainer(env=env, agents=agent, cfg=settings)
    while True:
        trainer.train()
        if clock is None or not clock.goes_on():
            break
    after = torch.cat([p.detach().flatten() for p in policy.parameters()])
    assert after.isfinite().all()
    assert (after - before).abs().max() > 1e-3
    rewards = torch.cat(agent.rewards)
    check_rewards(rewards)
    assert len(agent.rewards) % ROLLOUT == 0
    return agent, len(rewards)


def main() -> None:
    set_seed(0)
    agent, steps = trained(wrap_env(make()), None)
    assert steps == ROLLOUT > EPISODE
    check_times(torch.cat(agent.times))
    agent, steps = trained(wrap_env(make_many(COUNT)), Clock())
    check_times(torch.cat(agent.times))

    def act(observation: Any) -> Any:
        with torch.no_grad():
            return agent.policy.network(torch.as_tensor(observation))

    report(skrl, steps, act)


if __name__ == "__main__":
    main()
