"""An environment as its tests want it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from kengoro_env.env import KengoroEnv


def make(env_id: str, **arguments: Any) -> KengoroEnv:
    """The environment itself, without Gymnasium's wrappers."""
    env = gym.make(env_id, **arguments).unwrapped
    assert isinstance(env, KengoroEnv)
    return env
