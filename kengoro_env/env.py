"""Gymnasium environment: a robot, which knows the simulator, and a task, which knows the goal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy, deepcopy
from pathlib import Path
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import DTypeLike, NDArray

from kengoro_env.arguments import checked_mapping, seed_or_none, whole
from kengoro_env.assets import asset_path
from kengoro_env.departures.choice import chosen_departures
from kengoro_env.errors import ArgumentError, DivergedError, EpisodeError, UnknownNameError
from kengoro_env.robot.control_period import CONTROL_PERIOD
from kengoro_env.robot.draft import Departure
from kengoro_env.robot.muscle_law import DEFAULT_GAINS, Gains
from kengoro_env.robot.own_model import Model, OwnModel, SharedModel
from kengoro_env.robot.robot import Robot
from kengoro_env.spaces import (
    LATEST,
    box,
    checked_action,
    checked_dtype,
    in_dtype,
    length_bounds,
)
from kengoro_env.stepping.choice import steps_of_one
from kengoro_env.stepping.report import Observation, measured_report
from kengoro_env.stepping.tracked_object import TrackedObject
from kengoro_env.tasks.can_grasp import CanGrasp
from kengoro_env.tasks.elbow import elbow_task
from kengoro_env.tasks.options import checked_options, finite
from kengoro_env.tasks.posture import posture_task
from kengoro_env.tasks.task import Task, entries_of
from kengoro_env.types import Floats
from kengoro_env.vision.head_camera import HeadCamera
from kengoro_env.vision.lens import camera_painter
from kengoro_env.vision.rendering import COARSE, HEIGHT, WIDTH, Painter, open_window

TASKS: dict[str, Callable[[], Task]] = {
    "can_grasp": CanGrasp,
    "posture": posture_task,
    "elbow": elbow_task,
}

METADATA: dict[str, Any] = {
    "render_modes": ["human", "rgb_array", "depth_array"],
    "render_fps": round(1 / CONTROL_PERIOD),
}

COLDEST, HOTTEST = -50.0, 500.0
"""Bounds of the observed temperatures of the motors [degC]."""

OUTSIDE = "outside"
"""Name of the camera of `KengoroEnv.render`, unless it is asked for another."""

MOST_PIXELS = 4096
"""Largest width and height of an image."""

NOT_BEGUN = "none has begun"
"""Why there is no episode before the first reset."""


class KengoroEnv(gym.Env[Observation, NDArray[np.float32]]):
    """Kengoro's arm with a task. Create it with `gymnasium.make`.

    Action, `Box` in [-1, 1], float32: an entry per muscle, affine to its target length
    (`lengths_to_action`, `kengoro_env.spaces`), then in CanGrasp an entry for the fingers, from -1
    (open) to +1 (closed). Muscle stiffness control holds the target lengths at the physics rate.

    Observation, `Dict`; readings saturate at the bounds of their spaces; float64 may be float32
    (``dtype``):

    ============  ==================  =======  =================================================
    entry         shape               unit     content
    ============  ==================  =======  =================================================
    lengths       (m,) float64        m        encoder readings, 0 in the zero posture
    tensions      (m,) float64        N        readings of the tension sensors
    frame         (480, 640, 3)       RGB      newest frame of the camera in the head, uint8
    frame_time    (1,) float64        s        time at which the frame was taken
    target        (n,) float64        rad      joint angles to reach (Posture, Elbow)
    temperatures  (m,) float64        degC     housings of the motors, with `HeatingMotors` only
    ============  ==================  =======  =================================================

    ``info`` holds the truth, which no agent may use: ``joint_angles`` (n,) [rad]; ``hand_pose``
    (4, 4), pose of the grip point in the world; ``slack_paid_out`` (m,) [m], length paid out beyond
    the path; ``slack_target`` (m,) [m], target length beyond the true length; ``success``;
    ``time`` [s]; in CanGrasp ``can_pose`` (4, 4), ``grasped`` and ``rise`` [m]; ``reason`` in the
    last step of an episode that ended; with `HeatingMotors` ``core_temperatures`` and
    ``housing_temperatures`` (m,) [degC]. Numbers are NumPy's, truth values arrays of shape ().
    A simulation that diverges ends the episode with the last finite observation and the reward 0.

    Args:
        task: a key of `TASKS`.
        robot_seed: seed of an actual robot; None: the nominal model.
        departures: departures from the nominal model; only without ``robot_seed``.
        camera: whether ``frame`` and ``frame_time`` are observed; None: if the scene has a camera.
            ``Kengoro/CanGrasp-v0`` is registered with None, for nothing else shows the can.
        render_mode: None, "rgb_array", "depth_array" or "human".
        gains: gains of muscle stiffness control after each reset.
        control_period: simulated time of a step, from 0.001 to 0.1 [s].
        width: width of the images of `render` [pixels].
        height: height of the images of `render` [pixels].
        camera_name: camera of the model that `render` uses: "outside", or "eye" in the head,
            without the errors of its lens; None: "outside".
        dtype: of the numbers in observations, `numpy.float64` or `numpy.float32`; ``info`` is
            float64.
        model: model of the robot in place of the nominal one, with its own gains, such as a sample
            of `reality_gap.Diagnosis`; it has no frames.

    Attributes:
        robot: the simulated robot.
        task: the task.
        bounds: bounds of the muscles' lengths and tensions.
        muscles: names of the muscles, in the order of (m,) arrays.
        joints: names of the joints, in the order of (n,) arrays.

    Raises:
        KengoroError: an argument cannot be used; see `kengoro_env.errors` for the classes.
    """

    metadata = METADATA
    _made_from: EnvSpec | None = None

    def __init__(
        self,
        task: str,
        robot_seed: int | None = None,
        departures: Sequence[Departure] | None = None,
        camera: bool | None = False,
        render_mode: str | None = None,
        gains: Gains = DEFAULT_GAINS,
        control_period: float = CONTROL_PERIOD,
        width: int = WIDTH,
        height: int = HEIGHT,
        camera_name: str | None = None,
        dtype: DTypeLike = np.float64,
        model: Model | None = None,
    ) -> None:
        _check_names(task, render_mode)
        if not isinstance(gains, Gains):
            raise ArgumentError(f"gains must be kengoro_env.Gains, got {gains!r}")
        self.task = TASKS[task]()
        scene = asset_path(self.task.scene)
        chosen = chosen_departures(robot_seed, departures)
        if model is not None:
            given = robot_seed is not None or departures is not None
            chosen, camera = own_model(model, self.task, given, gains, camera), False
        self._has_own_model = model is not None
        self.robot = robot = Robot(scene, chosen, gains, control_period)
        self.metadata = {**METADATA, "render_fps": round(1 / control_period)}
        self.muscles, self.joints = robot.muscles, robot.joints
        self.render_mode = render_mode
        size = (whole("width", width, 1, MOST_PIXELS), whole("height", height, 1, MOST_PIXELS))
        self._painter = Painter(robot.model, *size)
        self._view = _camera_name(robot.model, camera_name, render_mode)
        self._window: Any = None
        self._camera = None
        _check_camera(camera, self.task, task)
        if self.task.has_camera and camera is not False:
            self._camera = _head_camera(robot)
        self.bounds = length_bounds(self.task.scene)
        self._entries = entries_of(self.task, robot.muscles)
        self._action_shape = (len(self._entries),)
        self.action_space = spaces.Box(-1.0, 1.0, self._action_shape, dtype=np.float32)
        self._dtype = checked_dtype(dtype)
        self._rounds = self._dtype != np.float64
        self.observation_space = in_dtype(self._make_observation_space(), self._dtype)
        name = self.task.object_name
        self._tracked = None if name is None else TrackedObject(robot.model, name)
        self._steps = steps_of_one(robot, self.bounds, self._entries, self._tracked)
        self._ended: str | None = NOT_BEGUN

    @property
    def spec(self) -> EnvSpec | None:
        """What `gymnasium.make` made this environment from; it can be copied, with a model, too."""
        return self._made_from

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._made_from = copy(spec)
        model = None if spec is None else spec.kwargs.get("model")
        if self._made_from is not None and not isinstance(model, str | Path | None):
            self._made_from.kwargs = {**self._made_from.kwargs, "model": SharedModel(model)}

    def _make_observation_space(self) -> spaces.Dict:
        muscles = (len(self.muscles),)
        entries: dict[str, spaces.Space[Any]] = {
            "lengths": box(self.bounds.low, self.bounds.high, muscles),
            "tensions": box(0.0, self.bounds.most_tension, muscles),
        }
        if self._camera is not None:
            entries["frame"] = spaces.Box(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
            entries["frame_time"] = box(0.0, LATEST, (1,))
        if self.task.shows_target:
            entries["target"] = box(self.robot.lower, self.robot.upper, (len(self.joints),))
        if self.robot.heat is not None:
            entries["temperatures"] = box(COLDEST, HOTTEST, muscles)
        return spaces.Dict(entries)

    def lengths_to_action(self, lengths: object, fingers: float = -1.0) -> NDArray[np.float32]:
        """Action that commands target lengths; lengths out of bounds are clipped.

        Args:
            lengths: target lengths as the encoders read them (m,) [m].
            fingers: command of the fingers, from -1 (open) to +1 (closed); used in CanGrasp only.
        """
        array = finite("lengths", lengths, len(self.muscles))
        action = self.bounds.to_action(array)
        if self.task.fingers:
            action = np.append(action, np.float32(fingers))
        return checked_action(action, self._entries).astype(np.float32)

    def action_to_lengths(self, action: object) -> Floats:
        """Target lengths (m,) [m] that an action commands."""
        return self.bounds.to_lengths(checked_action(action, self._entries)[: len(self.muscles)])

    def set_stiffness(self, stiffness: object, bias: object = None) -> None:
        """Set the gains of muscle stiffness control until the next reset.

        `gymnasium.make(..., gains=Gains(stiffness=...))` sets those after each reset.

        Args:
            stiffness: K_stiff, a number or (m,) [N/m].
            bias: T_bias, a number or (m,) [N]; as it is if left out.

        Raises:
            ArgumentError: a value is negative or not finite, or has another shape.
        """
        motors = self.robot.motors
        motors.set_stiffness(stiffness, motors.bias.copy() if bias is None else bias)

    def put_can_back(self) -> None:
        """Put the can back to where it stood at the reset (CanGrasp only).

        The can stays where it is while the hand is there.

        Raises:
            EpisodeError: no episode has begun.
        """
        if not isinstance(self.task, CanGrasp):
            raise ArgumentError("there is no can to put back: only CanGrasp has one")
        if self._ended == NOT_BEGUN:
            raise EpisodeError(f"there is no can to put back ({NOT_BEGUN}): call reset")
        self.task.put_can_back(self.robot)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode.

        Args:
            seed: seed of the episode; the same seed gives the same bits.
            options: ``posture``: joint angles at the start (n,) [rad]; ``target``: joint angles to
                reach (n,) [rad] (Posture, Elbow); ``can``: x and y of the can's axis (2,) [m]
                (CanGrasp).

        Raises:
            KengoroError: an option is unknown or has a value that is not valid.
        """
        super().reset(seed=seed_or_none(seed))
        known = {"posture": None, **self.task.options}
        checked = checked_options(checked_mapping(options), known, self.robot)
        rng, noise = self.np_random.spawn(2)
        self.task.start(self.robot, checked, rng, noise)
        self._ended = None
        if self.robot.heat is not None:
            self.robot.heat.reset(self.np_random.spawn(1)[0])
        if self._camera is not None:
            self._camera.reset(self.robot.data)
        start = measured_report(self.robot, self.bounds, self.task.goal, self._tracked)
        observation, info = start.observation, start.truth
        self._add_frame_and_target(observation)
        self._add_temperatures(observation, info)
        if self._rounds:
            self._round(observation)
        info["success"] = False
        self.task.write_info(info, start.object_state)
        _fix_types(info)
        self._last = observation, info
        if self.render_mode == "human":
            self.render()
        return self._last

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the commanded lengths for a control period.

        Raises:
            InvalidActionError: the action is not valid; nothing has moved.
            EpisodeError: no episode has begun, or it has ended.
        """
        if self._ended is not None:
            checked_action(action, self._entries)
            raise EpisodeError(f"there is no episode to step ({self._ended}): call reset")
        task = self.task
        entries: NDArray[np.floating[Any]] = action
        if not (
            type(action) is np.ndarray
            and action.shape == self._action_shape
            and action.dtype.kind == "f"  # the step checks its values, which costs less
        ):
            entries = checked_action(action, self._entries)
        try:
            report = self._steps.step(entries, task.goal)
        except DivergedError as diverged:
            self._ended = reason = str(diverged)
            observation, info = deepcopy(self._last)
            info |= {"success": np.array(False), "reason": reason}
            return observation, 0.0, True, False, info
        observation, info, error, tension, state = report
        reward, ended = task.judge(info, error, tension, state)
        if self._camera is not None:
            self._camera.update(self.robot.data)
        self._ended = ended
        if self.robot.heat is not None:
            self.robot.heat.advance(self.robot.tensions, self.robot.control_period)
        self._add_frame_and_target(observation)
        self._add_temperatures(observation, info)
        if self._rounds:
            self._round(observation)
        _fix_types(info)
        self._last = observation, info
        if ended is not None:
            info["reason"] = ended
        if self.render_mode == "human":
            self.render()
        return observation, reward, ended is not None, False, info

    def _add_frame_and_target(self, observation: Observation) -> None:
        if self._camera is not None:
            time, frame = self._camera.newest()
            observation["frame"] = frame
            observation["frame_time"] = np.array([min(time, LATEST)])
        goal = self.task.goal
        if goal is not None:
            observation["target"] = goal.copy()

    def _add_temperatures(self, observation: Observation, info: dict[str, Any]) -> None:
        heat = self.robot.heat
        if heat is None:
            return
        observation["temperatures"] = np.clip(heat.readings, COLDEST, HOTTEST)
        info["core_temperatures"] = heat.core.copy()
        info["housing_temperatures"] = heat.housing.copy()

    def _round(self, observation: Observation) -> None:
        for name, value in observation.items():
            if value.dtype == np.float64:
                observation[name] = value.astype(self._dtype)

    def render(self) -> NDArray[Any] | None:
        """Render the robot as ``render_mode`` says.

        Without a display, "human" warns once and becomes "rgb_array".

        Returns:
            "rgb_array": (height, width, 3) uint8; "depth_array": distances along the camera's axis
            (height, width) float32 [m], that of the far clipping plane where there is nothing;
            otherwise None.

        Raises:
            EpisodeError: no episode has begun.
        """
        if self.render_mode is None:
            return None
        if self._ended == NOT_BEGUN:
            raise EpisodeError(f"there is no episode to render ({NOT_BEGUN}): call reset")
        robot = self.robot
        if self.render_mode == "human" and self._window is None:
            self._window = open_window(robot.model, robot.data)
            if self._window is None:
                self.render_mode = "rgb_array"
        if self.render_mode == "human":
            self._window.sync()
            return None
        if self.render_mode == "depth_array":
            return self._painter.depth(robot.data, self._view)
        return self._painter.draw(robot.data, self._view)

    def close(self) -> None:
        """Close the window and free the GL contexts; a second call does nothing."""
        if self._window is not None:
            self._window.close()
            self._window = None
        self._painter.close()
        if self._camera is not None:
            self._camera.close()

    def __getstate__(self) -> dict[str, Any]:
        """State of a copy, which continues from here without a window."""
        state = {**self.__dict__, "_window": None, "_steps": None}
        return {**state, "_made_from": None} if self._has_own_model else state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._steps = steps_of_one(self.robot, self.bounds, self._entries, self._tracked)


def _check_names(task: object, render_mode: object) -> None:
    if not isinstance(task, str) or task not in TASKS:
        raise UnknownNameError("task", task, TASKS)
    modes = METADATA["render_modes"]
    if render_mode not in (None, *modes):
        raise UnknownNameError("render_mode", render_mode, modes)


def _head_camera(robot: Robot) -> HeadCamera:
    painter = camera_painter(robot.model, robot.lens, COARSE)
    return HeadCamera(painter, robot.frame_delay, tendons=True, times=robot.frame_times)


def _check_camera(camera: object, task: Task, name: str) -> None:
    if not isinstance(camera, bool | np.bool_ | None):
        raise ArgumentError(f"camera is {camera!r}, but must be True, False or None")
    if camera and not task.has_camera:
        raise ArgumentError(f"the task {name!r} has no camera: leave camera out or False")


def _camera_name(model: mujoco.MjModel, name: object, render_mode: str | None) -> str:
    """A camera's name, if the model has it or nothing is rendered."""
    known = [model.camera(i).name for i in range(model.ncam)]
    seen = (model.geom_group < 3) & (model.geom_rgba[:, 3] > 0.0)
    if render_mode is not None and not seen.any():
        raise ArgumentError(
            "nothing of the model is rendered, for no geom in the groups 0 to 2 is visible: leave "
            "render_mode out"
        )
    if name is None:
        if render_mode is not None and OUTSIDE not in known:
            raise ArgumentError(
                f"the model has no camera {OUTSIDE!r}: leave render_mode out, or give camera_name "
                f"one of its cameras ({', '.join(known) or 'it has none'})"
            )
        return OUTSIDE
    if name not in known:
        raise UnknownNameError("camera_name", name, known)
    return str(name)


def own_model(
    model: Model,
    task: Task,
    others: bool = False,
    gains: Gains = DEFAULT_GAINS,
    camera: bool | None = None,
    name: str = "model",
) -> tuple[Departure, ...]:
    """The departure that replaces the nominal model.

    Args:
        model: the model.
        task: the task.
        others: whether a robot seed or departures are given as well.
        gains: gains that were given.
        camera: whether frames are to be observed.
        name: of the model in messages.

    Raises:
        ArgumentError: the model does not fit the task or the other arguments.
    """
    if others:
        raise ArgumentError("give a model, or robot_seed or departures, not both")
    if gains != DEFAULT_GAINS:
        raise ArgumentError("a model has its own gains: leave gains out")
    if camera:
        raise ArgumentError("a model has no frames: give camera=False")
    return (OwnModel(model, asset_path(task.scene), name, task.elements),)


def _fix_types(info: dict[str, Any]) -> None:
    """Replace numbers of Python by those of NumPy, whose types learning libraries read.

    Truth values become arrays of shape (), for Gymnasium's vector environments batch those.
    """
    for name, value in info.items():
        if isinstance(value, bool):
            info[name] = np.array(value)
        elif type(value) is float:
            info[name] = np.float64(value)
