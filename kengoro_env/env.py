"""The environments: a robot and a task in Gymnasium's words.

The environment only sequences. The robot knows the simulator, the task knows the goal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from kengoro_env.assets import asset_path
from kengoro_env.departures.choice import chosen_departures
from kengoro_env.errors import KengoroError
from kengoro_env.robot.draft import Departure, UnknownNameError
from kengoro_env.robot.motors import DEFAULT_GAINS, Gains
from kengoro_env.robot.robot import DivergedError, Robot
from kengoro_env.spaces import LATEST, box, checked_action, length_bounds
from kengoro_env.stepping.compiled_control import control_of
from kengoro_env.stepping.observation import Observation
from kengoro_env.tasks.can_grasp import CanGrasp
from kengoro_env.tasks.elbow import elbow_task
from kengoro_env.tasks.posture import posture_task
from kengoro_env.tasks.task import Task
from kengoro_env.types import Floats
from kengoro_env.vision.head_camera import HeadCamera
from kengoro_env.vision.rendering import COARSE, HEIGHT, WIDTH, Image, Painter, open_window

TASKS: dict[str, Callable[[], Task]] = {
    "can_grasp": CanGrasp,
    "posture": posture_task,
    "elbow": elbow_task,
}

CONTROL_PERIOD = 0.02
"""Time that a step takes [s]."""

METADATA: dict[str, Any] = {
    "render_modes": ["human", "rgb_array"],
    "render_fps": round(1 / CONTROL_PERIOD),
}

OUTSIDE = "outside"
"""The camera of `KengoroEnv.render`."""


class KengoroEnv(gym.Env[Observation, NDArray[np.float32]]):
    """Kengoro's arm with a task; made by `gymnasium.make`.

    Action, `Box` in [-1, 1], float32: one entry a muscle, affine to its target length
    (`lengths_to_action`, `kengoro_env.spaces`), then in CanGrasp one for the fingers, from -1
    (open) to +1 (closed). Muscle stiffness control holds the target lengths at the physics rate.

    Observation, `Dict`; sensors saturate at the bounds of their spaces:

    ============  ==================  =======  =================================================
    entry         shape               unit     what
    ============  ==================  =======  =================================================
    lengths       (m,) float64        m        what the encoders read, 0 where they were zeroed
    tensions      (m,) float64        N        what the tension sensors read
    frame         (480, 640, 3)       RGB      newest frame of the camera in the head, uint8
    frame_time    (1,) float64        s        when it was taken
    target        (n,) float64        rad      joint angles to reach (Posture, Elbow)
    ============  ==================  =======  =================================================

    ``info`` holds the truth, which no agent may use: ``joint_angles`` (n,) [rad], ``hand_pose``
    (4, 4) of the grip point in the world, ``can_pose`` (4, 4), ``success``, ``time`` [s],
    ``slack_paid_out`` and ``slack_target`` (m,) [m], and ``reason`` in the last step of an
    episode that ended. A simulation that diverges ends the episode with the last finite
    observation and the reward 0.

    Args:
        task: a key of `TASKS`.
        robot_seed: the actual robot of this seed; None for the drawing.
        departures: what else makes the robot depart from its drawing; not with ``robot_seed``.
        camera: whether ``frame`` and ``frame_time`` are observed; None: where there is a camera.
        render_mode: None, "rgb_array" or "human".
        gains: muscle stiffness control after each reset.

    Attributes:
        robot: the simulated robot.
        task: what is to be done with it.
        bounds: of the wires' lengths.
        muscles, joints: names, in the order of (m,) and (n,) arrays.

    Raises:
        KengoroError: in one sentence, what was wrong and what would be valid.
    """

    metadata = METADATA

    def __init__(
        self,
        task: str,
        robot_seed: int | None = None,
        departures: Sequence[Departure] | None = None,
        camera: bool | None = None,
        render_mode: str | None = None,
        gains: Gains = DEFAULT_GAINS,
    ) -> None:
        if task not in TASKS:
            raise UnknownNameError("task", task, TASKS)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise UnknownNameError("render_mode", render_mode, self.metadata["render_modes"])
        self.task = TASKS[task]()
        scene = asset_path(self.task.scene)
        self.robot = robot = Robot(
            scene, chosen_departures(robot_seed, departures), gains, CONTROL_PERIOD
        )
        self.muscles, self.joints = robot.muscles, robot.joints
        self.render_mode = render_mode
        self._painter = Painter(robot.model)
        self._window: Any = None
        self._camera = None
        if camera and not self.task.has_camera:
            raise KengoroError(f"the task {task!r} has no camera: leave camera out or False")
        if self.task.has_camera and camera is not False:
            self._camera = HeadCamera(Painter(robot.model, quality=COARSE), robot.frame_delay)
        self.bounds = length_bounds(self.task.scene)
        self._entries = (*robot.muscles, "fingers") if self.task.fingers else robot.muscles
        self.action_space = spaces.Box(-1.0, 1.0, (len(self._entries),), dtype=np.float32)
        self.observation_space = self._make_observation_space()
        self._control = control_of(robot, self.bounds, self._entries, self.task.thing)
        self._ended: str | None = "none has begun"

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
        return spaces.Dict(entries)

    def lengths_to_action(self, lengths: object, fingers: float = -1.0) -> NDArray[np.float32]:
        """The action that commands ``lengths`` (m,) [m]; those out of bounds are cut.

        Args:
            lengths: target lengths, as the encoders call them [m].
            fingers: from -1 (open) to +1 (closed); only where there are fingers.
        """
        array = _finite("lengths", lengths, len(self.muscles))
        action = self.bounds.to_action(array)
        if self.task.fingers:
            action = np.append(action, np.float32(fingers))
        return checked_action(action, self._entries).astype(np.float32)

    def action_to_lengths(self, action: object) -> Floats:
        """The target lengths (m,) [m] that an action commands."""
        return self.bounds.to_lengths(checked_action(action, self._entries)[: len(self.muscles)])

    def set_stiffness(self, stiffness: object, bias: object) -> None:
        """Set K_stiff [N/m] and T_bias [N], each a number or (m,); until the next reset."""
        self.robot.motors.set_stiffness(stiffness, bias)

    def put_can_back(self) -> None:
        """Put the can back where it stood at the reset, as a person would (CanGrasp only)."""
        if not isinstance(self.task, CanGrasp):
            raise KengoroError("there is no can to put back: only CanGrasp has one")
        self.task.tidy_up(self.robot)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode.

        Args:
            seed: same seed, same bits.
            options: ``posture`` (n,) to start at [rad]; ``target`` (n,) to reach [rad] (Posture,
                Elbow); ``can`` (x, y) of its axis on the table [m] (CanGrasp).
        """
        super().reset(seed=seed)
        checked = self._checked_options(options or {})
        rng, noise = self.np_random.spawn(2)
        self.task.start(self.robot, checked, rng, noise)
        self._ended = None
        if self._camera is not None:
            self._camera.reset(self.robot.data)
        observation, info, _, _, sight = self._control.tell(self.task.goal)
        self._show(observation)
        info["success"] = False
        self.task.tell(info, sight)
        self._last = observation, info
        if self.render_mode == "human":
            self.render()
        return self._last

    def _checked_options(self, options: Mapping[str, Any]) -> dict[str, Floats]:
        sizes = {"posture": None, **self.task.options}
        checked = {}
        for name, value in options.items():
            if name not in sizes:
                raise UnknownNameError("option", name, sizes)
            size = sizes[name]
            checked[name] = array = _finite(f"the option {name!r}", value, size or len(self.joints))
            if size is not None:
                continue
            beyond = np.flatnonzero((array < self.robot.lower) | (array > self.robot.upper))
            if len(beyond):
                i = beyond[0]
                raise KengoroError(
                    f"the option {name!r} puts {self.joints[i]} at {array[i]:.3f} rad: it must be "
                    f"within {self.robot.lower[i]:.3f} and {self.robot.upper[i]:.3f}"
                )
        return checked

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the commanded lengths for `CONTROL_PERIOD`."""
        if self._ended is not None:
            checked_action(action, self._entries)
            raise KengoroError(f"there is no episode to step ({self._ended}): call reset")
        task = self.task
        try:
            observation, info, error, tension, sight = self._control.step(action, task.goal)
        except DivergedError as diverged:
            self._ended = reason = str(diverged)
            observation, info = deepcopy(self._last)
            return observation, 0.0, True, False, {**info, "success": False, "reason": reason}
        reward, ended = task.judge(info, error, tension, sight)
        if self._camera is not None:
            self._camera.update(self.robot.data)
        self._ended = ended
        self._show(observation)
        self._last = observation, info
        if ended is not None:
            info["reason"] = ended
        if self.render_mode == "human":
            self.render()
        return observation, reward, ended is not None, False, info

    def _show(self, observation: Observation) -> None:
        """Add to what the robot feels what camera and task show."""
        if self._camera is not None:
            time, frame = self._camera.newest()
            observation["frame"] = frame
            observation["frame_time"] = np.array([min(time, LATEST)])
        goal = self.task.goal
        if goal is not None:
            observation["target"] = goal.copy()

    def render(self) -> Image | None:
        """The outside view (480, 640, 3) uint8, or None where a window shows it.

        Without a display "human" warns once and becomes "rgb_array".
        """
        if self.render_mode is None:
            return None
        robot = self.robot
        if self.render_mode == "human" and self._window is None:
            self._window = open_window(robot.model, robot.data)
            if self._window is None:
                self.render_mode = "rgb_array"
        if self.render_mode == "human":
            self._window.sync()
            return None
        return self._painter.draw(robot.data, OUTSIDE)

    def close(self) -> None:
        """Close the window and free the GL contexts; may be called again."""
        if self._window is not None:
            self._window.close()
            self._window = None
        self._painter.close()
        if self._camera is not None:
            self._camera.close()

    def __getstate__(self) -> dict[str, Any]:
        """A copied or unpickled environment goes on where this one stands, without its window."""
        return {**self.__dict__, "_window": None, "_control": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._control = control_of(self.robot, self.bounds, self._entries, self.task.thing)


def _finite(name: str, value: object, size: int) -> Floats:
    """``value`` as ``size`` finite numbers."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (size,) or not np.all(np.isfinite(array)):
        raise KengoroError(f"{name} must be {size} finite numbers, got {value!r}")
    return array
