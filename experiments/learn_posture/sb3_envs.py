"""Adapter of vector environments to Stable-Baselines3; needs the extra ``[rl]``.

`gymnasium.make_vec` steps all arms in one call. Stable-Baselines3 has its own interface of vector
environments, in which an episode that ends is reset within the same step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

Values = NDArray[Any]


class Sb3Envs(VecEnv):
    """A `KengoroVectorEnv` for Stable-Baselines3, perhaps with one entry of the observation.

    Args:
        envs: made by ``gymnasium.make_vec``, perhaps in a wrapper.
        observed: name of the entry of the observation, of shape (k,); None: observations are not a
            dict but an array, as those of `ScaledVectorObservation`.
        commanded: maps a policy's actions, shape (num_envs, m) in [-1, 1], to those of ``envs``.
        held: number of steps of ``envs`` for which an action is held; rewards are their sums. The
            length of episodes must be a multiple of it.
    """

    def __init__(
        self,
        envs: VectorEnv[Any, Any, Any],
        observed: str | None,
        commanded: Callable[[Values], Values],
        held: int = 1,
    ) -> None:
        self.envs, self._observed, self._commanded = envs, observed, commanded
        self._held = held
        self._actions = np.zeros(envs.action_space.shape or ())
        observations = envs.single_observation_space
        if observed is not None:
            assert isinstance(observations, spaces.Dict)
            observations = observations[observed]
        super().__init__(envs.num_envs, observations, envs.single_action_space)

    def reset(self) -> Values:
        """Start an episode in each environment, with the seeds that `seed` set."""
        observations, _ = self.envs.reset(seed=self._seeds)
        self._reset_seeds()
        return self._entry(observations)

    def step_async(self, actions: Values) -> None:
        """Store the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[Values, Values, Values, list[dict[str, Any]]]:
        """Hold the actions; ended episodes are reset and return their first observation."""
        commanded = self._commanded(self._actions)
        total, ended = np.zeros(self.num_envs), np.zeros(self.num_envs, dtype=bool)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for _ in range(self._held):
            observations, rewards, terminated, truncated, info = self.envs.step(commanded)
            total += np.where(ended, 0.0, rewards)
            ends = (terminated | truncated) & ~ended
            for i in np.flatnonzero(~ended):
                infos[i]["success"] = bool(info["success"][i])
            for i in np.flatnonzero(ends):
                infos[i]["terminal_observation"] = self._entry(observations)[i]
                infos[i]["TimeLimit.truncated"] = bool(truncated[i])
            ended |= ends
        if ended.any():
            observations, _ = self.envs.reset(options={"reset_mask": ended})
        return self._entry(observations), total, ended, infos

    def _entry(self, observations: Any) -> Values:
        entry: Values = observations if self._observed is None else observations[self._observed]
        return entry

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Value of an attribute, which is the same in all environments."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not available, because all environments are one object."""
        raise NotImplementedError(
            "The environments of Sb3Envs have no own attributes: use Sb3Envs.envs."
        )

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> Any:
        """Not available, because all environments are one object."""
        raise NotImplementedError(
            "The environments of Sb3Envs have no own methods: use Sb3Envs.envs."
        )

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """False for every environment."""
        return [False for _ in self._get_indices(indices)]
