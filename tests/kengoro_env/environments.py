"""Environments for the tests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from kengoro_env.env import KengoroEnv
from kengoro_env.robot.draft import Draft


def make(env_id: str, **arguments: Any) -> KengoroEnv:
    """The environment without Gymnasium's wrappers."""
    env = gym.make(env_id, **arguments).unwrapped
    assert isinstance(env, KengoroEnv)
    return env


@dataclass(frozen=True)
class EveryOtherStretches:
    """Every other tendon stretches and has friction per tension; the others are nominal."""

    def edit(self, draft: Draft) -> None:
        for tendon in list(draft.tendons.values())[::2]:
            tendon.stiffness, tendon.friction_ratio = (8e4, 4e6, 0.0), 0.1


def same(one: Any, other: Any) -> bool:
    """Whether both hold the same bits."""
    if isinstance(one, dict):
        return set(one) == set(other) and all(same(one[k], other[k]) for k in one)
    if one is None or isinstance(one, str):
        return bool(one == other)
    if one.dtype == object:
        return one is other or all(map(same, one, other))
    return one.dtype == other.dtype and np.array_equal(one, other)
