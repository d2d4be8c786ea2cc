"""Training of one policy by PPO, and its judgement on a robot.

A policy is linear, from target joint angles to commanded lengths, as in `experiments.learn_posture`
whose settings PPO has. Observations are scaled by the joint ranges (`ScaledVectorObservation`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from gymnasium import spaces
from gymnasium.wrappers.vector import FilterObservation

from experiments.gap_to_skill.run import Sizes as Log
from experiments.learn_posture.policies import (
    COMMON,
    HELD,
    SHORT,
    STARTS,
    WHOLE,
    Actions,
    Observations,
    Policy,
    about,
    judge,
    libraries,
    many_arms,
    one_arm,
    settings_of,
)
from experiments.posterior_policy.models import TRUE, models_of
from jmm_agent.types import Floats
from kengoro_env import ScaledVectorObservation
from kengoro_env.vector import KengoroVectorEnv


@dataclass(frozen=True)
class Sizes:
    """Amount of work.

    Attributes:
        steps: number of training steps of the environments of each policy.
        environments: number of arms that are stepped at once, each with a model of its own.
        episodes: number of episodes in which a policy is judged on a robot.
        length: steps of these episodes.
        causes: ids of the causes that a diagnosis considers; None: the catalogue.
        log: postures that a robot visits in its log, and durations.
    """

    steps: int = 300_000
    environments: int = 64
    episodes: int = 8
    length: int = WHOLE
    causes: tuple[str, ...] | None = None
    log: Log = field(default_factory=Log)


Linear: TypeAlias = dict[str, Any]
"""A policy for JSON: ``centre`` (m,), ``weights`` (m, n) [1/rad] and ``bias`` (m,)."""
Learn: TypeAlias = Callable[[KengoroVectorEnv, int, Sizes], Linear]
"""Trains a policy in environments, by a seed."""


class Training(NamedTuple):
    """One policy to train.

    Attributes:
        condition: what it is trained on.
        robot: seed of the robot that is trained for; None if it is the same for all.
        seed: of training, guesses and samples.
        folder: of the robot's diagnosis, where the condition needs one.
    """

    condition: str
    robot: int | None
    seed: int
    folder: Path | None

    @property
    def name(self) -> str:
        """For messages."""
        robot = "" if self.robot is None else f", robot {self.robot}"
        return f"{self.condition}{robot}, seed {self.seed}"


def train(training: Training, sizes: Sizes, learn: Learn) -> dict[str, Any]:
    """Train one policy.

    Returns:
        ``policy``, None if no model fits the environments; ``refused`` and ``beside``, see
        `experiments.posterior_policy.models.Models`.
    """
    begin, count = time.perf_counter(), sizes.environments
    condition, robot, seed, folder = training
    models = models_of(condition, folder, count, seed)
    refused, beside = ([], []) if models is None else (models.refused, models.beside)
    if models is not None and not models.specs:
        print(f"{training.name}: not trained: {refused[0]}", flush=True)
        return {"policy": None, "refused": refused, "beside": beside}
    own = robot if condition == TRUE else None
    arms = many_arms(own, count, SHORT, None if models is None else models.specs)
    policy = learn(arms, seed, sizes)
    arms.close()
    print(f"{training.name}: trained in {time.perf_counter() - begin:.0f} s", flush=True)
    return {"policy": policy, "refused": refused, "beside": beside}


def learn_by_ppo(arms: KengoroVectorEnv, seed: int, sizes: Sizes) -> Linear:
    """Train a linear policy by PPO of Stable-Baselines3."""
    algorithms, torch, normalised = libraries()
    torch.set_num_threads(1)
    from experiments.learn_posture.sb3_envs import Sb3Envs

    centre = rest_of(arms)
    scaled = ScaledVectorObservation(FilterObservation(arms, ["target"]))
    adapted = Sb3Envs(scaled, None, about(centre), HELD)
    envs = normalised(adapted, norm_obs=False, gamma=COMMON["gamma"])
    envs.seed(seed * sizes.environments)
    settings = settings_of("ppo", torch)
    model = algorithms["ppo"]("MlpPolicy", envs, seed=seed, device="cpu", **settings)
    model.learn(ceil(sizes.steps / HELD))
    layer = model.policy.action_net
    weights, bias = (part.detach().numpy().astype(float) for part in (layer.weight, layer.bias))
    return linear(arms, centre, weights, bias)


def rest_of(arms: KengoroVectorEnv) -> Floats:
    """Action of the mean lengths of starting postures in the environments, shape (m,)."""
    env = one_arm(None)
    rounds = ceil(STARTS / arms.num_envs)
    lengths = [arms.reset(seed=arms.num_envs * i)[0]["lengths"].mean(axis=0) for i in range(rounds)]
    return env.lengths_to_action(np.mean(lengths, axis=0)).astype(float)


def linear(arms: KengoroVectorEnv, centre: Floats, weights: Floats, bias: Floats) -> Linear:
    """Policy of targets [rad], from weights (m, n) of scaled targets and a bias (m,)."""
    observations = arms.single_observation_space
    assert isinstance(observations, spaces.Dict)
    targets = observations["target"]
    assert isinstance(targets, spaces.Box)
    low, high = targets.low.astype(float), targets.high.astype(float)
    own = weights / ((high - low) / 2)
    shift = bias - own @ ((low + high) / 2)
    return {"centre": centre.tolist(), "weights": own.tolist(), "bias": shift.tolist()}


def acting(found: Linear) -> Policy:
    """The policy of a trained one's numbers."""
    weights, bias = np.array(found["weights"]), np.array(found["bias"])
    commanded = about(np.array(found["centre"]))

    def act(observed: Observations) -> Actions:
        return commanded(np.clip(observed["target"] @ weights.T + bias, -1.0, 1.0))

    return act


def judged(name: str, policy: Linear, robot: int, sizes: Sizes) -> dict[str, float]:
    """Means over episodes on a robot: ``reward`` of a step, ``success``, ``tension`` [N]."""
    score = judge(acting(policy), robot, sizes.episodes, sizes.length)
    found = {key: float(np.mean(values)) for key, values in score._asdict().items()}
    print(f"{name}: reward {found['reward']:.3f}", flush=True)
    return found
