"""What makes a robot strange while it runs: gymnasium wrappers of `Kengoro/Posture-v0`."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from kengoro_env.env import KengoroEnv

GONE = 1e4
"""Length that is added to a wire which is absent [m]; its motor never winds it taut."""
MINUTE = 60.0
DRIFT_STEP = 1.0
"""Time between two steps of a drift [s]."""

Env = gym.Env[Any, Any]
Step = tuple[Any, Any, bool, bool, dict[str, Any]]


def simulated(env: Env) -> KengoroEnv:
    """The environment of Kengoro's arm within wrappers."""
    inner = env.unwrapped
    assert isinstance(inner, KengoroEnv)
    return inner


class SwappedMotors(gym.Wrapper[Any, Any, Any, Any]):
    """Motors of two wires with their sensors, each connected to the other's channel.

    Args:
        env: environment without fingers.
        first: index of the first wire; the second is the next one.
    """

    def __init__(self, env: Env, first: int) -> None:
        super().__init__(env)
        self._order = np.arange(len(simulated(env).muscles))
        self._order[[first, first + 1]] = first + 1, first

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        observation, info = self.env.reset(**options)
        return self._swapped(observation), info

    def step(self, action: Any) -> Step:
        """Run one control period."""
        world = simulated(self.env)
        lengths = world.action_to_lengths(action)[self._order]
        action = world.lengths_to_action(lengths)
        observation, reward, ended, cut, info = self.env.step(action)
        return self._swapped(observation), reward, ended, cut, info

    def _swapped(self, observation: dict[str, Any]) -> dict[str, Any]:
        both = {name: observation[name][self._order] for name in ("lengths", "tensions")}
        return {**observation, **both}


class AbsentMuscle(gym.Wrapper[Any, Any, Any, Any]):
    """A wire that is not there: its motor winds up nothing, forever, and its tension is 0.

    Args:
        env: environment of a robot whose tendons stretch.
        muscle: its name.
    """

    def __init__(self, env: Env, muscle: str) -> None:
        super().__init__(env)
        self._muscle = muscle

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        found = self.env.reset(**options)
        simulated(self.env).robot.elongate(self._muscle, GONE)
        return found


class DriftingLengths(gym.Wrapper[Any, Any, Any, Any]):
    """Wires whose lengths drift at a constant rate, each in its own direction.

    Args:
        env: environment of the robot.
        rates: of the elongations (m,) [m/min].
        begin: time since the drift began, at the reset [s].
        stays: whether the lengths stay as they were then.
    """

    def __init__(self, env: Env, rates: np.ndarray, begin: float, stays: bool) -> None:
        super().__init__(env)
        self._rates, self._begin, self._stays = rates, begin, stays
        self._drifted, self._steps = 0.0, 0

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode; wires have drifted since before."""
        found = self.env.reset(**options)
        self._drifted, self._steps = 0.0, 0
        self._drift_until(self._begin)
        return found

    def step(self, action: Any) -> Step:
        """Run one control period."""
        self._steps += 1
        time = self._begin + self._steps * simulated(self.env).robot.control_period
        if not self._stays and time >= self._drifted + DRIFT_STEP:
            self._drift_until(time)
        return self.env.step(action)

    def _drift_until(self, time: float) -> None:
        robot, minutes = simulated(self.env).robot, (time - self._drifted) / MINUTE
        for muscle, rate in zip(robot.muscles, self._rates, strict=True):
            robot.elongate(muscle, float(rate) * minutes)
        self._drifted = time
