"""Many environments at once: what ``gymnasium.make_vec`` makes of Posture and Elbow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from kengoro_env.env import METADATA, KengoroEnv
from kengoro_env.errors import KengoroError
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.motors import DEFAULT_GAINS, Gains
from kengoro_env.robot.robot import DivergedError
from kengoro_env.spaces import InvalidActionError, checked_action
from kengoro_env.stepping.compiled_fleet import fleet_of
from kengoro_env.stepping.fleet import BatchResult
from kengoro_env.tasks.reach import Reach, judged
from kengoro_env.types import Bools, Floats

Observations = dict[str, NDArray[Any]]
Infos = dict[str, Any]

MANY: dict[str, Any] = {
    **METADATA,
    "render_modes": [],
    "autoreset_mode": AutoresetMode.NEXT_STEP,
}


class KengoroVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """``num_envs`` times `KengoroEnv` without a camera, stepped on all cores.

    By compiled code, or by `mujoco.batch` where there is no compiler, which is slower for few
    environments. Bit for bit what as many single ones give, whatever the number of threads; an
    environment that ended is reset by the next step (`AutoresetMode.NEXT_STEP`). Observations,
    actions and infos are those of `KengoroEnv` with an axis of environments before theirs.

    Args:
        num_envs: how many.
        task: "posture" or "elbow".
        robot_seed: the actual robot of this seed, in all of them; None for the drawing.
        departures: what else makes the robot depart from its drawing; not with ``robot_seed``.
        camera: must be False: frames are drawn one after the other; ``vectorization_mode="async"``
            has them.
        gains: muscle stiffness control.
        max_episode_steps: after so many steps an episode is truncated; None: never.
        threads: how many threads step; 0: as many as pay, at most one a core.

    Attributes:
        fleet: the simulated robots; `parts` gives model and data of one of them, for reading.
        muscles, joints: names, in the order of (num_envs, m) and (num_envs, n) arrays.

    Raises:
        KengoroError: in one sentence, what was wrong and what would be valid.
    """

    metadata = MANY

    def __init__(
        self,
        num_envs: int,
        task: str,
        robot_seed: int | None = None,
        departures: Sequence[Departure] | None = None,
        camera: bool = False,
        gains: Gains = DEFAULT_GAINS,
        max_episode_steps: int | None = None,
        threads: int = 0,
    ) -> None:
        if camera:
            raise KengoroError(
                "many environments at once have no camera: leave camera out, or ask for "
                'vectorization_mode="async"'
            )
        if num_envs < 1:
            raise KengoroError(f"num_envs must be 1 or more, got {num_envs}")
        self._env = KengoroEnv(task, robot_seed, departures, camera=False, gains=gains)
        if not isinstance(self._env.task, Reach):
            raise KengoroError("only posture and elbow can be many at once")
        self._task = self._env.task
        self.num_envs = num_envs
        self.single_action_space = self._env.action_space
        self.single_observation_space = self._env.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.muscles, self.joints = self._env.muscles, self._env.joints
        self.fleet = fleet_of(self._env.robot, self._env.bounds, num_envs, threads)
        self._most = np.inf if max_episode_steps is None else max_episode_steps
        self._randoms: list[np.random.Generator | None] = [None] * num_envs
        self._tasks: list[Reach] = []
        self._until = np.full(num_envs, np.inf)  # when each one's target makes way for another
        self._steps = np.zeros(num_envs, dtype=int)
        self._ended = np.ones(num_envs, dtype=bool)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, Infos]:
        """Start an episode in each environment.

        Args:
            seed: of the first, the others follow; or one for each.
            options: of `KengoroEnv.reset`, for all of them; ``reset_mask`` (num_envs,) bool: reset
                these only.
        """
        options = dict(options or {})
        which = options.pop("reset_mask", np.ones(self.num_envs, dtype=bool))
        if seed is None or isinstance(seed, int):
            seeds = [None if seed is None else seed + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs or np.shape(which) != (self.num_envs,):
            raise KengoroError(
                f"seed and reset_mask must have an entry for each of {self.num_envs} environments"
            )
        if not self._tasks and not np.all(which):
            raise KengoroError("the first reset must be one of all environments")
        for i in np.flatnonzero(which):
            self._begin(int(i), seeds[i], options)
        return self._told(which)

    def _begin(self, i: int, seed: int | None, options: dict[str, Any]) -> None:
        env = self._env
        random = self._randoms[i]
        if random is not None:
            env.np_random = random
        elif seed is None:
            env.np_random = np.random.default_rng()
        observation, info = env.reset(seed=seed, options=options)
        self._randoms[i] = env.np_random
        if not self._tasks:
            self._observed, self._known = (
                {name: np.stack([value] * self.num_envs) for name, value in first.items()}
                for first in (observation, info)
            )
            self._tasks = [self._task] * self.num_envs
        self._tasks[i] = copy(self._task)
        self._until[i] = self._task.until
        self.fleet.take(i)
        self._steps[i], self._ended[i] = 0, False
        _write(self._observed, i, observation)
        _write(self._known, i, info)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[Any], NDArray[Any], NDArray[Any], Infos]:
        """Hold the commanded lengths (num_envs, m) for `CONTROL_PERIOD`, and reset who ended."""
        checked = self._checked(actions)
        if not self._tasks:
            raise KengoroError("there is no episode to step (none has begun): call reset")
        fleet, begins = self.fleet, self._ended.copy()
        told = fleet.step(checked, ~begins, self._observed["target"])
        diverged = told.diverged
        moved = ~begins & ~diverged
        outcomes = map(judged, told.errors.tolist(), told.tensions.tolist())
        rewards, successes = zip(*outcomes, strict=True)
        reward = np.where(moved, rewards, 0.0)
        self._observe(told, moved, np.array(successes))
        self._steps += 1
        truncated = moved & (self._steps >= self._most)
        for i in np.flatnonzero(begins):
            self._begin(int(i), None, {})
        self._ended = diverged | truncated
        self._known["success"][diverged] = False
        observed, infos = self._told(np.ones(self.num_envs, dtype=bool))
        if diverged.any():
            infos["reason"] = np.full(self.num_envs, None, dtype=object)
            infos["reason"][diverged] = str(DivergedError())
            infos["_reason"] = diverged.copy()
        return observed, reward, diverged, truncated, infos

    def _checked(self, actions: object) -> Floats:
        array = np.asarray(actions, dtype=float)
        if array.shape != self.action_space.shape:
            raise InvalidActionError(
                f"actions must have the shape {self.action_space.shape}, one row an environment "
                f"and one column a muscle, got {array.shape}"
            )
        for i in np.flatnonzero(~(np.abs(array) <= 1.0).all(axis=1)):
            try:
                checked_action(array[i], self.muscles)
            except InvalidActionError as error:
                raise InvalidActionError(f"environment {i}: {error}") from None
        return array

    def _observe(self, told: BatchResult, moved: Bools, success: Bools) -> None:
        """Write what those that moved sense, and the truth about them."""
        for i in np.flatnonzero(moved & (told.truth["time"] >= self._until)):
            task = self._tasks[i]
            task.go_on()
            self._observed["target"][i], self._until[i] = task.goal, task.until
        truth = told.truth | {"success": success}
        if moved.all():  # as nearly always: what is new replaces what was known
            self._observed |= told.observation
            self._known |= truth
            return
        for arrays, news in ((self._observed, told.observation), (self._known, truth)):
            _write(arrays, moved, {name: values[moved] for name, values in news.items()})

    def _told(self, which: Bools) -> tuple[Observations, Infos]:
        """Copies of what is observed by now and of the truth, which is known of ``which``."""
        infos: Infos = {}
        everybody = which.all()
        for name, values in self._known.items():
            shape = (self.num_envs,) + (1,) * (values.ndim - 1)
            told = values if everybody else np.where(which.reshape(shape), values, 0)
            infos[name] = told.astype(values.dtype)
            infos[f"_{name}"] = which.copy()
        return {name: values.copy() for name, values in self._observed.items()}, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Free what the template holds."""
        self._env.close()


def _write(arrays: Mapping[str, NDArray[Any]], rows: Any, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        arrays[name][rows] = value
