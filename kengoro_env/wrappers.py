"""Wrappers that make observations ready for a network: flat, and of about unit size.

Raw observations are lengths of some centimetres beside tensions of hundreds of newtons. A network
hardly learns from them. The wrappers scale each number by a middle and a unit that never change, so
that a policy needs no statistics of the run it was trained in:

    scaled = (number - middle) / unit

============  ==================================  ===================================
entry         middle                              unit
============  ==================================  ===================================
lengths       middle of the nominal range [m]     half of the nominal range [m]
target        middle of the joint's range [rad]   half of the joint's range [rad]
tensions      `TENSION`, 100 N                    `TENSION`, 100 N
temperatures  `TEMPERATURE`, 50 degC              `TEMPERATURE_UNIT`, 25 K
============  ==================================  ===================================

Ranges are those of the observation space; that of a length is `MARGIN` wider at both ends than the
nominal range. Entries follow each other in the order of the space, which is alphabetical.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from kengoro_env.errors import ArgumentError
from kengoro_env.spaces import MARGIN
from kengoro_env.types import Floats

Flat = NDArray[np.float32]

TENSION = 100.0
"""Middle and unit of tensions [N]; muscle stiffness control begins at 30 N and ends at 500 N."""

TEMPERATURE, TEMPERATURE_UNIT = 50.0, 25.0
"""Middle [degC] and unit [K] of temperatures: from that of a room to that of a hot motor."""


class _Scales:
    """The scaling of the entries of a space.

    Args:
        space: observation space of a single environment.

    Attributes:
        space: the box of the flat, scaled observations.

    Raises:
        ArgumentError: an entry has no scale.
    """

    def __init__(self, space: spaces.Space[Any]) -> None:
        if not isinstance(space, spaces.Dict):
            raise ArgumentError(
                "the observations must be a dict of Kengoro's arm, not a "
                f"{type(space).__name__}: scale them before any wrapper that flattens them"
            )
        self._scales = {name: _scale(name, entry) for name, entry in space.spaces.items()}
        low, high = (
            self.flat({name: getattr(entry, bound) for name, entry in space.spaces.items()})
            for bound in ("low", "high")
        )
        self.space = spaces.Box(low, high, dtype=np.float32)

    def flat(self, observation: dict[str, NDArray[Any]]) -> Flat:
        """Scaled observations, entries (..., k) one after the other."""
        entries = [
            (np.asarray(observation[name], dtype=float) - middle) / unit
            for name, (middle, unit) in self._scales.items()
        ]
        return np.concatenate(entries, axis=-1).astype(np.float32)


def _scale(name: str, entry: spaces.Space[Any]) -> tuple[Floats | float, Floats | float]:
    """Middle and unit of an entry."""
    if name == "tensions":
        return TENSION, TENSION
    if name == "temperatures":
        return TEMPERATURE, TEMPERATURE_UNIT
    if name not in ("lengths", "target") or not isinstance(entry, spaces.Box):
        raise ArgumentError(
            f"the observation {name!r} has no scale: leave it out, such as by camera=False or by "
            "gymnasium.wrappers.FilterObservation"
        )
    low, high = entry.low.astype(float), entry.high.astype(float)
    return (low + high) / 2, (high - low) / 2 - (MARGIN if name == "lengths" else 0.0)


class ScaledObservation(
    gym.ObservationWrapper[Flat, Any, dict[str, NDArray[Any]]], gym.utils.RecordConstructorArgs
):
    """Flat observations of about unit size, float32, for a network.

    Each number is scaled by a fixed middle and unit: lengths and targets are within [-1, 1] in the
    nominal model's ranges, tensions are -1 at 0 N and 4 at 500 N, temperatures -1 at 25 degC and 1
    at 75 degC. Entries follow each other in the order of the space, which is alphabetical.

    Args:
        env: an environment of `KengoroEnv` without frames, perhaps with fewer entries.

    Raises:
        ArgumentError: an entry of the observation, such as a frame, has no scale.
    """

    def __init__(self, env: gym.Env[dict[str, NDArray[Any]], Any]) -> None:
        gym.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self._scales = _Scales(env.observation_space)
        self.observation_space = self._scales.space

    def observation(self, observation: dict[str, NDArray[Any]]) -> Flat:
        """The observation (k,), flat and scaled."""
        return self._scales.flat(observation)


if TYPE_CHECKING:
    _VectorWrapper = VectorWrapper[Flat, Any, dict[str, NDArray[Any]], Any, NDArray[Any]]
else:
    _VectorWrapper = VectorWrapper  # which is not generic before Gymnasium 1.3


class ScaledVectorObservation(_VectorWrapper, gym.utils.RecordConstructorArgs):
    """`ScaledObservation` of a vector environment, in any mode of autoreset.

    Args:
        env: a `KengoroVectorEnv`, or another vector environment of `KengoroEnv` without frames.

    Raises:
        ArgumentError: an entry of the observation, such as a frame, has no scale.
    """

    def __init__(self, env: VectorEnv[dict[str, NDArray[Any]], Any, NDArray[Any]]) -> None:
        gym.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)
        self._scales = _Scales(env.single_observation_space)
        self.single_observation_space = self._scales.space
        self.observation_space = batch_space(self._scales.space, env.num_envs)

    @property
    def autoreset_mode(self) -> AutoresetMode:
        """When an environment that ended is reset; some learning libraries read it here."""
        mode: AutoresetMode = self.env.metadata["autoreset_mode"]
        return mode

    def reset(self, **arguments: Any) -> tuple[Flat, dict[str, Any]]:
        """Start an episode in each environment; arguments of the wrapped environment."""
        observations, infos = self.env.reset(**arguments)
        return self._scales.flat(observations), infos

    def step(
        self, actions: Any
    ) -> tuple[Flat, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Carry out actions; last observations in ``final_obs`` are scaled, too."""
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        if "final_obs" in infos:
            last = infos["final_obs"].copy()
            for i in np.flatnonzero(infos["_final_obs"]):
                last[i] = self._scales.flat(last[i])
            infos = {**infos, "final_obs": last}
        return self._scales.flat(observations), rewards, terminated, truncated, infos
