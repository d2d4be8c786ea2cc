"""Environments for the tests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium as gym

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
