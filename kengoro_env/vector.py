"""Vector environment: what ``gymnasium.make_vec`` creates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import DTypeLike, NDArray

from kengoro_env.arguments import (
    checked_mapping,
    checked_mask,
    described,
    real_numbers,
    seeds_of_many,
    whole,
)
from kengoro_env.env import METADATA, NOT_BEGUN, TASKS, KengoroEnv, own_model
from kengoro_env.errors import (
    ArgumentError,
    DivergedError,
    EpisodeError,
    InvalidActionError,
    UnknownNameError,
)
from kengoro_env.robot.control_period import CONTROL_PERIOD
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.muscle_law import DEFAULT_GAINS, Gains
from kengoro_env.robot.own_model import Model
from kengoro_env.spaces import check_actions, checked_dtype, in_dtype
from kengoro_env.stepping.choice import MOST_THREADS, Steps, steps_of_many
from kengoro_env.tasks.many import tasks_of_many
from kengoro_env.tasks.task import entries_of
from kengoro_env.types import Bools
from kengoro_env.vision.rendering import HEIGHT, WIDTH

Observations = dict[str, NDArray[Any]]
Infos = dict[str, Any]

OBSERVED = ("lengths", "tensions")
"""Entries of the observations of all tasks."""

KNOWN = ("joint_angles", "hand_pose", "slack_paid_out", "slack_target", "time", "success")
"""Entries of the infos of all tasks."""

MANY: dict[str, Any] = {
    **METADATA,
    "render_modes": ["rgb_array", "depth_array"],
    "autoreset_mode": AutoresetMode.NEXT_STEP,
}


class KengoroVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """Several `KengoroEnv` without frames in the observations, stepped on all cores.

    Compiled code steps the robots, or `mujoco.batch` where there is no compiler, which is slower
    for few environments. The results have the bits of as many single environments, for any number
    of threads. The next step resets an environment that ended, or as ``autoreset_mode`` says.
    Observations, actions and infos are those of `KengoroEnv` with a leading axis of environments.

    Args:
        num_envs: number of environments.
        task: "posture", "elbow" or "can_grasp".
        robot_seed: seed of the actual robot, the same in all environments; None: the nominal model.
        departures: departures from the nominal model; only without ``robot_seed``.
        camera: False or None; use ``vectorization_mode="async"`` for environments with a camera.
        render_mode: None, "rgb_array" or "depth_array"; use ``vectorization_mode="sync"`` for
            windows.
        gains: gains of muscle stiffness control.
        max_episode_steps: number of steps after which an episode is truncated; None: never.
        threads: number of threads; 0: as many as pay, at most one per core.
        control_period: simulated time of a step, from 0.001 to 0.1 [s].
        autoreset_mode: when an environment that ended is reset, a `gymnasium.vector.AutoresetMode`
            or its value: by the next step; by the same step, which then returns the last
            observation and info as ``final_obs`` and ``final_info`` in the infos; or by the user,
            with ``reset_mask``.
        width: width of the images of `render` [pixels].
        height: height of the images of `render` [pixels].
        camera_name: camera of the model that `render` uses, "outside" or "eye"; None: "outside".
        dtype: of the numbers in observations, `numpy.float64` or `numpy.float32`.
        model: a model for all environments; see `KengoroEnv`.
        models: a model for each environment in place of one robot, such as the samples of
            `reality_gap.Diagnosis`.

    Attributes:
        autoreset_mode: when an environment that ended is reset, an `AutoresetMode`.
        fleet: the control steps of the robots; ``fleet.parts(i)`` returns model and data of robot
            ``i``, to read from.
        muscles: names of the muscles, in the order of (num_envs, m) arrays.
        joints: names of the joints, in the order of (num_envs, n) arrays.

    Raises:
        KengoroError: an argument cannot be used; see `kengoro_env.errors` for the classes.
    """

    metadata = MANY

    def __init__(
        self,
        num_envs: int,
        task: str,
        robot_seed: int | None = None,
        departures: Sequence[Departure] | None = None,
        camera: bool | None = False,
        render_mode: str | None = None,
        gains: Gains = DEFAULT_GAINS,
        max_episode_steps: int | None = None,
        threads: int = 0,
        control_period: float = CONTROL_PERIOD,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        width: int = WIDTH,
        height: int = HEIGHT,
        camera_name: str | None = None,
        dtype: DTypeLike = np.float64,
        model: Model | None = None,
        models: Sequence[Model] | None = None,
    ) -> None:
        _refuse_camera_and_window(camera, render_mode)
        num_envs = whole("num_envs", num_envs, 1)
        if max_episode_steps is not None:
            max_episode_steps = whole("max_episode_steps", max_episode_steps, 1)
        self._has_own_models = model is not None or models is not None
        self._threads = whole("threads", threads, 0, MOST_THREADS)
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        make = partial(
            KengoroEnv, task, camera=False, render_mode=render_mode, gains=gains,
            control_period=control_period, width=width, height=height, camera_name=camera_name,
        )  # fmt: skip
        robot = {"robot_seed": robot_seed, "departures": departures, "model": model}
        self._envs = _envs_of(make, robot, models, num_envs)
        self._env = self._envs[0]
        self.render_mode = render_mode
        frames = self._env.metadata["render_fps"]
        self.metadata = {**MANY, "render_fps": frames, "autoreset_mode": self.autoreset_mode}
        _refuse_heat(self._env)
        self.num_envs = num_envs
        self._dtype = checked_dtype(dtype)
        self._make_spaces()
        self.muscles, self.joints = self._env.muscles, self._env.joints
        self._make_tasks()
        self.fleet = self._new_fleet()
        self._randoms: list[np.random.Generator | None] = [None] * num_envs
        self._begun = False
        self._prepare_steps(np.inf if max_episode_steps is None else max_episode_steps)

    def _prepare_steps(self, most: float) -> None:
        """Set what is counted in steps, and arrays that steps copy."""
        count = self.num_envs
        self._step, self._most = 0, most
        self._last_steps = np.full(count, np.inf)  # step at which each episode is truncated
        self._no_truncation_before = 0.0  # before this step none is
        self._none, self._all = np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
        self._ended = self._all.copy()
        self._shown = np.ones((len(self._known), count), dtype=bool)

    def _make_spaces(self) -> None:
        """Set the spaces; the single environment inside keeps float64, which goals need."""
        single = _space_of_all([env.observation_space for env in self._envs])
        self.single_action_space = self._env.action_space
        self.single_observation_space = in_dtype(single, self._dtype)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._action_shape = self.action_space.shape
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def _make_tasks(self) -> None:
        """Set the tasks, the arrays of results, and which of them observations and infos hold."""
        task, sizes = self._env.task, (len(self.muscles), len(self.joints))
        self._entries = entries_of(task, self.muscles)
        self._tasks = tasks_of_many(task, self.num_envs, *sizes)
        self._latest = self._tasks.latest
        self._observed = (*OBSERVED, *self._tasks.observed)
        self._known = (*KNOWN, *self._tasks.known)

    def _new_fleet(self) -> Steps:
        robots, env = [each.robot for each in self._envs], self._env
        return steps_of_many(
            robots, env.bounds, self._entries, self._tasks.stepped, self._threads,
            env.task.object_name,
        )  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        """State of a copy, which continues from here; `fleet` is made again from its robots."""
        states = [self.fleet.state(i) for i in range(self.num_envs)] if self._begun else []
        state = {**self.__dict__, "fleet": states}
        return {**state, "spec": None} if self._has_own_models else state  # a MjSpec has no copy

    def __setstate__(self, state: dict[str, Any]) -> None:
        states = state["fleet"]
        self.__dict__.update(state)
        self.fleet = self._new_fleet()
        for i, robot in enumerate(states):
            self.fleet.restore(i, robot)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, Infos]:
        """Start an episode in each environment.

        Args:
            seed: seed of the first environment, to which each other adds its index; or a seed per
                environment.
            options: options of `KengoroEnv.reset` for all environments; ``reset_mask``
                (num_envs,) bool: which environments to reset, one at least.

        Raises:
            KengoroError: an argument has the wrong length or value.
        """
        options, which = checked_mapping(options), np.ones(self.num_envs, dtype=bool)
        if "reset_mask" in options:
            which = checked_mask(options.pop("reset_mask"), self.num_envs)
        seeds = seeds_of_many(seed, self.num_envs)
        if not self._begun and not np.all(which):
            raise EpisodeError("the first reset must be one of all environments")
        for i in np.flatnonzero(which):
            self._begin(int(i), seeds[i], options)
        return self._results(None if which.all() else which)

    def _begin(self, i: int, seed: int | None, options: dict[str, Any]) -> None:
        env = self._envs[i % len(self._envs)]
        random = self._randoms[i]
        if random is not None:
            env.np_random = random
        elif seed is None:
            env.np_random = np.random.default_rng()
        observation, info = env.reset(seed=seed, options=options)
        self._randoms[i] = env.np_random
        self._begun = True
        self._tasks.begin(i, env.task)
        self.fleet.restore(i, env.robot.state())
        self._last_steps[i], self._ended[i] = self._step + self._most, False
        for name, value in (observation | info).items():
            self._latest[name][i] = value

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[Any], NDArray[Any], NDArray[Any], Infos]:
        """Hold the commanded lengths for a control period; reset as ``autoreset_mode`` says.

        Args:
            actions: entries in [-1, 1] (num_envs, m), in CanGrasp (num_envs, m + 1).

        Raises:
            InvalidActionError: an action is not valid; nothing has moved.
            EpisodeError: no episode has begun, or one has ended that the user is to reset.
        """
        checked = self._checked(actions)
        if not self._begun:
            check_actions(checked, self._entries)
            raise EpisodeError(f"there is no episode to step ({NOT_BEGUN}): call reset")
        begins = self._ended
        some_begin = _some(begins)
        if some_begin and self.autoreset_mode is AutoresetMode.DISABLED:
            raise EpisodeError(
                f"environment {np.flatnonzero(begins)[0]} has ended: reset it with reset_mask"
            )
        # A NumPy function that runs once a step takes as long as a tenth of a small robot's step,
        # for physics has displaced its code from the cache: hence only copies in the usual case.
        moving = ~begins if some_begin else self._all
        terminated = self.fleet.step_many(checked, moving)
        self._step += 1
        reasons = self._tasks.judge(moving, terminated)
        for i in np.flatnonzero(begins) if some_begin else ():
            self._begin(int(i), None, {})
        truncated = self._truncated()
        news: Infos = {}
        self._ended = self._none
        if reasons or _some(terminated) or _some(truncated):
            reasons |= dict.fromkeys(np.flatnonzero(terminated).tolist(), str(DivergedError()))
            terminated[list(reasons)] = True
            self._ended = terminated | truncated
            same_step = self.autoreset_mode is AutoresetMode.SAME_STEP
            news = self._reset_ended(reasons) if same_step else self._reasons(reasons)
        observed, infos = self._results()
        infos |= news
        return observed, self._latest["reward"].copy(), terminated, truncated, infos

    def _truncated(self) -> Bools:
        if self._step < self._no_truncation_before:
            return self._none.copy()
        self._no_truncation_before = self._last_steps.min()
        truncated: Bools = self._last_steps <= self._step
        return truncated

    def _reset_ended(self, reasons: dict[int, str]) -> Infos:
        """Reset the environments that ended; return their last observations and infos."""
        ended = self._ended.copy()
        observed, infos = self._results(ended)
        last = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended):
            last[i] = {name: values[i] for name, values in observed.items()}
            self._begin(int(i), None, {})
        infos |= self._reasons(reasons)
        return {
            "final_obs": last,
            "_final_obs": ended,
            "final_info": infos,
            "_final_info": ended.copy(),
        }

    def _reasons(self, reasons: dict[int, str]) -> Infos:
        """Entries of infos with the reasons of environments that terminated, if any did."""
        if not reasons:
            return {}
        of_all = np.full(self.num_envs, None, dtype=object)
        shown = np.zeros(self.num_envs, dtype=bool)
        of_all[list(reasons)], shown[list(reasons)] = list(reasons.values()), True
        return {"reason": of_all, "_reason": shown}

    def _checked(self, actions: object) -> NDArray[np.floating[Any]]:
        """The actions as an array of the right shape; the step checks its values."""
        shape = self._action_shape
        if type(actions) is np.ndarray and actions.shape == shape and actions.dtype.kind == "f":
            return actions
        array = real_numbers(actions)
        if array is None or array.shape != shape:
            fingers = " and one for the fingers" if self._env.task.fingers else ""
            raise InvalidActionError(
                f"actions must be real numbers of the shape {shape}, one row an "
                f"environment and one column a muscle{fingers}, got "
                f"{described(actions) if array is None else array.shape}"
            )
        return array

    def _results(self, which: Bools | None = None) -> tuple[Observations, Infos]:
        """Copies of observations and infos; infos of environments not in ``which`` are 0."""
        latest = self._latest
        infos: Infos = {}
        shown = self._shown.copy()
        for name, mask in zip(self._known, shown, strict=True):
            infos[name] = latest[name].copy()
            infos[f"_{name}"] = mask
        if which is not None:
            shown &= which
            for name in self._known:
                infos[name][~which] = 0
        observed = {name: latest[name].copy() for name in self._observed}
        if self._dtype != np.float64:
            observed = {name: values.astype(self._dtype) for name, values in observed.items()}
        return observed, infos

    def render(self) -> tuple[NDArray[Any], ...] | None:
        """Images of all environments, each as `KengoroEnv.render` returns it; None: no mode.

        Raises:
            EpisodeError: no episode has begun.
        """
        if self.render_mode is None:
            return None
        if not self._begun:
            raise EpisodeError(f"there is no episode to render ({NOT_BEGUN}): call reset")
        images = []
        for i in range(self.num_envs):
            env = self._envs[i % len(self._envs)]
            env.robot.restore(self.fleet.state(i))
            image = env.render()
            assert image is not None  # there is no window
            images.append(image)
        return tuple(images)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the environment that resets happen in, if the arguments were valid."""
        for env in getattr(self, "_envs", ()):
            env.close()


def _envs_of(
    make: partial[KengoroEnv], robot: Mapping[str, Any], models: object, count: int
) -> list[KengoroEnv]:
    """An environment for each model; one if there are no models.

    Args:
        make: makes an environment.
        robot: arguments of the robot that all environments have.
        models: the models; None: none.
        count: number of environments.

    Raises:
        KengoroError: there is another number of models, or one does not fit.
    """
    if models is None:
        return [make(**robot)]
    if not isinstance(models, Sequence) or isinstance(models, str | bytes):
        raise ArgumentError(f"models must be a list of {count} models, got {models!r}")
    if len(models) != count:
        raise ArgumentError(
            f"models must have one model for each of {count} environments, it has {len(models)}"
        )
    if any(value is not None for value in robot.values()):
        raise ArgumentError("give models, or robot_seed, departures or a model, not both")
    (task,), gains = make.args, make.keywords["gains"]
    if task not in TASKS:
        raise UnknownNameError("task", task, TASKS)
    chosen = [
        own_model(model, TASKS[task](), gains=gains, name=f"models[{i}]")
        for i, model in enumerate(models)
    ]
    return [make(departures=departures) for departures in chosen]


def _autoreset_mode(mode: object) -> AutoresetMode:
    known = {each.value: each for each in AutoresetMode}
    if isinstance(mode, AutoresetMode):
        return mode
    if not isinstance(mode, str) or mode not in known:
        raise UnknownNameError("autoreset_mode", mode, known)
    return known[mode]


def _refuse_heat(env: KengoroEnv) -> None:
    if env.robot.heat is not None:
        raise ArgumentError(
            "a vector environment has no HeatingMotors: leave them out, or ask for "
            'vectorization_mode="async"'
        )


def _space_of_all(each: Sequence[spaces.Space[Any]]) -> spaces.Dict:
    """The space that holds the observations of all robots, whose joint ranges may differ."""
    entries: dict[str, list[Any]] = {}
    for space in each:
        assert isinstance(space, spaces.Dict)
        for name, entry in space.spaces.items():
            entries.setdefault(name, []).append(entry)
    return spaces.Dict(
        {
            name: spaces.Box(
                np.min([one.low for one in boxes], axis=0),
                np.max([one.high for one in boxes], axis=0),
                dtype=boxes[0].dtype,
            )
            for name, boxes in entries.items()
        }
    )


def _refuse_camera_and_window(camera: bool | None, render_mode: str | None) -> None:
    if camera:
        raise ArgumentError(
            "a vector environment has no camera: leave camera out, or ask for "
            'vectorization_mode="async"'
        )
    if render_mode == "human":
        raise ArgumentError(
            "a vector environment has no window: leave render_mode out, or ask for "
            'vectorization_mode="sync"'
        )


def _some(flags: Bools) -> bool:
    """Whether one is True, in a fifth of the time of ``flags.any()``."""
    return b"\1" in flags.tobytes()
