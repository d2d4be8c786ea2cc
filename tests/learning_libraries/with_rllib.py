"""RLlib: PPO on one environment at a time, on many, and in processes of Ray."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import ray
import torch
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.connectors.env_to_module import FlattenObservations
from ray.rllib.core.columns import Columns
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune.registry import register_env
from trial import EPISODE, ID, LEAST, MOST, Clock, make, make_many, report

import kengoro_env

COUNT, BATCH = 4, 1000


def config() -> PPOConfig:
    """PPO with a small network, in this process."""
    return (
        PPOConfig()
        .env_runners(num_env_runners=0, num_envs_per_env_runner=COUNT)
        .learners(num_learners=0)
        .training(
            train_batch_size_per_learner=BATCH, minibatch_size=250, num_epochs=8, lr=1e-3, gamma=0.9
        )
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[64, 64]))
        .debugging(seed=0)
    )


def trained(settings: PPOConfig, clock: Clock | None) -> tuple[Any, int]:
    """An algorithm after some updates, as long as the clock goes, and its number of steps."""
    algorithm = settings.build_algo()
    module = algorithm.get_module()
    before = torch.cat([p.detach().flatten().clone() for p in module.parameters()])
    steps, returns = 0, []
    while not returns or (clock is not None and clock.goes_on()):
        found = algorithm.train()["env_runners"]
        steps += int(found["num_env_steps_sampled"])
        if "episode_return_mean" in found:
            assert found["episode_len_max"] == EPISODE
            returns += [found["episode_return_min"], found["episode_return_max"]]
    after = torch.cat([p.detach().flatten() for p in algorithm.get_module().parameters()])
    assert after.isfinite().all()
    assert (after - before).abs().max() > 1e-3
    assert LEAST <= min(returns) / EPISODE < max(returns) / EPISODE <= MOST
    return algorithm, steps


def main() -> None:
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    # By the id, with dict observations that RLlib flattens, in processes of Ray.
    raw = config().environment(f"kengoro_env:{ID}", env_config={"max_episode_steps": EPISODE})
    raw.env_runners(
        num_env_runners=1, env_to_module_connector=lambda env, spaces, device: FlattenObservations()
    )
    trained(raw, None)[0].stop()
    register_env("elbow", lambda context: make())
    trained(config().environment("elbow"), None)[0].stop()
    # Many environments at once: the creator is asked for as many as there are to be.
    register_env("elbows", lambda context: make_many(context["num_envs"]))
    many = config().environment("elbows")
    many.env_runners(gym_env_vectorize_mode=gym.VectorizeMode.VECTOR_ENTRY_POINT)
    algorithm, steps = trained(many, Clock())
    assert isinstance(algorithm.env_runner.env.unwrapped, kengoro_env.KengoroVectorEnv)
    module = algorithm.get_module()

    def act(observation: Any) -> Any:
        batch = {Columns.OBS: torch.as_tensor(observation)[None]}
        with torch.no_grad():
            logits = module.forward_inference(batch)[Columns.ACTION_DIST_INPUTS]
        return logits[0, :3]

    report(ray, steps, act)
    algorithm.stop()
    ray.shutdown()


if __name__ == "__main__":
    main()
