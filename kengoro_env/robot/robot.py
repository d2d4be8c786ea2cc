"""Robot: a compiled model with its departures, stepped at the control rate.

It knows MuJoCo and no task. Its lengths are relative to the posture in which the encoders were
zeroed, as the encoders read them.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.errors import DivergedError, UnknownNameError
from kengoro_env.robot.body import Body
from kengoro_env.robot.control_period import CONTROL_PERIOD, set_time_step
from kengoro_env.robot.draft import Departure, Draft, FrameTimes
from kengoro_env.robot.fingers import FINGERS, add_fingers
from kengoro_env.robot.indexing import index_of
from kengoro_env.robot.model_file import load_spec
from kengoro_env.robot.motor_gains import gains_of
from kengoro_env.robot.motor_heat import MotorHeat
from kengoro_env.robot.motors import Motors
from kengoro_env.robot.muscle_law import Gains
from kengoro_env.robot.robot_state import RobotState
from kengoro_env.robot.sensors import Sensors
from kengoro_env.robot.tendons import actuated_joints, wind
from kengoro_env.types import Floats

DIVERGENCE = slice(int(mujoco.mjtWarning.mjWARN_BADQPOS), int(mujoco.mjtWarning.mjWARN_BADCTRL) + 1)
"""MuJoCo's warnings of positions, velocities, accelerations or commands that are not finite."""

STATE = mujoco.mjtState.mjSTATE_INTEGRATION
"""The state that determines a robot's motion."""


class Robot(Body):
    """The arm with its muscles, motors and sensors.

    Args:
        scene: MJCF file of the robot and its surroundings.
        departures: departures from the nominal model, such as ``actual(seed)``.
        gains: gains of muscle stiffness control after each reset; those of `gains_of` if left out,
            which are `DEFAULT_GAINS` for Kengoro's arm.
        control_period: time between commands [s]. Physics takes the longest time step that divides
            it and is not above the model's own.
        folders: further folders whose files the model may include or load.

    Attributes:
        muscles: names of the muscles, in the order of (m,) arrays.
        joints: names of the joints that muscles cross, in the order of (n,) arrays.
        lower: lower joint limits (n,) [rad].
        upper: upper joint limits (n,) [rad].
        random: generator of the sensors' noise.
        events: elongations to come in this episode, the next one first.
        heat: temperatures of the motors; None: they stay cold.

    Raises:
        KengoroError: the model or an argument cannot be used.
    """

    def __init__(
        self,
        scene: Path | str,
        departures: Sequence[Departure] = (),
        gains: Gains | None = None,
        control_period: float = CONTROL_PERIOD,
        folders: Sequence[Path | str] = (),
    ) -> None:
        gains = gains_of(scene, folders).gains if gains is None else gains
        draft = Draft.of(load_spec(scene, folders))
        for departure in departures:
            departure.edit(draft)
        if draft.own_gains is None:
            wind(draft, gains.damping)
            add_fingers(draft.spec)
        else:
            gains = draft.own_gains
        self._substeps = set_time_step(draft.spec, control_period)
        self.model = draft.spec.compile()
        self.data = mujoco.MjData(self.model)
        self.control_period = control_period
        self._gains, self._sensor_errors, self._planned = (
            gains,
            draft.sensor_errors,
            tuple(draft.events),
        )
        self.joints = actuated_joints(self.model)
        addresses = [self.model.joint(joint) for joint in self.joints]
        self._position = index_of(np.array([joint.qposadr[0] for joint in addresses]))
        self.lower, self.upper = self.model.jnt_range[[j.id for j in addresses]].T.copy()
        self._left_at = np.empty(self.model.nq + self.model.nv)
        self._find_arrays()
        mujoco.mj_forward(self.model, self.data)
        self.motors = Motors(self.model, self.data, draft, gains)
        self.muscles = self.motors.muscles
        self._zeros, self._target = (np.zeros(len(self.muscles)) for _ in range(2))
        self._sensors = Sensors(self._sensor_errors, self.muscles)
        self._zero = self._length_at_zero_posture()
        self._mounted = self.motors.elongation
        self.heat = None if draft.heat is None else MotorHeat(draft.heat)
        fingers = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_ACTUATOR, FINGERS)
        self._fingers = fingers if fingers >= 0 else None
        self.random = np.random.default_rng(0)
        self.reset(np.zeros(len(self.joints)), self.random)

    def _length_at_zero_posture(self) -> Floats:
        """Length that each motor has paid out in the zero posture at T_bias, before elongation."""
        posture = self._sensor_errors.zero_posture
        self.data.qpos[self._position] = [posture.get(joint, 0.0) for joint in self.joints]
        mujoco.mj_forward(self.model, self.data)
        stretch = self.motors.stretch_at(self.motors.bias)
        return self.motors.paths() - stretch

    @property
    def changing_fields(self) -> tuple[str, ...]:
        """Names of the model's arrays that a step may change."""
        found: list[str] = []
        if self.motors.frictions:
            found += ["tendon_frictionloss", "dof_frictionloss"]
        if self._planned:
            found += ["tendon_lengthspring"]
        return tuple(found)

    @property
    def frame_delay(self) -> float:
        """Age of a frame when the agent gets it [s]."""
        return self._sensor_errors.frame_delay

    @property
    def frame_times(self) -> FrameTimes:
        """Errors of the frames' time stamps."""
        return self._sensor_errors.frame_times

    @property
    def lens(self) -> tuple[float, ...] | None:
        """Distortion of the camera's lens k1, k2, p1, p2, k3 [1]; None if there is none."""
        return self._sensor_errors.lens

    @property
    def time(self) -> float:
        """Simulated time since the last reset [s]."""
        return float(self.data.time)

    def reset(self, posture: Floats, rng: np.random.Generator) -> None:
        """Put the arm at rest, with the fingers open and the muscles at T_bias.

        Args:
            posture: joint angles (n,) [rad], clipped to the joint limits.
            rng: generator of the sensors' noise.
        """
        self.random = rng
        mujoco.mj_resetData(self.model, self.data)
        self.motors.elongate(self._mounted)
        self.motors.update_friction()
        self.events = sorted(self._planned, key=lambda event: event.time)
        self.motors.set_stiffness(self._gains.stiffness, self._gains.bias)
        self.data.qpos[self._position] = np.clip(posture, self.lower, self.upper)
        mujoco.mj_forward(self.model, self.data)
        self.motors.wind_up()
        mujoco.mj_forward(self.model, self.data)
        _, paid_out, _ = self.motors.measure()
        self.motors.command(paid_out)
        self.close_fingers(-1.0)
        mujoco.mj_forward(self.model, self.data)
        self._target[:] = self.lengths
        if self._sensors.length_offset is not None:
            self._target += self._sensors.length_offset
        self._left_at[:] = np.nan

    def state(self) -> RobotState:
        """The present state; it shares the generator of the noise with this robot."""
        physics = np.empty(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, physics, STATE)
        return RobotState(
            physics,
            self.data.actuator_force.copy(),
            {name: getattr(self.model, name).copy() for name in self.changing_fields},
            self.motors.elongation,
            self.target,
            self.random,
            list(self.events),
        )

    def restore(self, state: RobotState) -> None:
        """Continue from the state of a robot of the same model, and share its generator."""
        model, data = self.model, self.data
        for name, values in state.fields.items():
            getattr(model, name)[:] = values
        self.motors.elongate(state.elongation)
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, state.physics, STATE)
        mujoco.mj_forward(model, data)
        data.actuator_force[:] = state.forces
        self._target[:], self._left_at[:] = state.target, np.nan
        self.random, self.events = state.random, list(state.events)

    def step(self, target: Floats) -> None:
        """Hold target lengths by muscle stiffness control for one control period.

        Args:
            target: target lengths as the encoders read them (m,) [m].

        Raises:
            DivergedError: the state of the simulation is no longer finite.
        """
        self.elongate_tendons()
        self._target[:] = target
        self.motors.command(self._commanded(target))
        self._advance()

    def elongate_tendons(self) -> None:
        """Apply the elongations that are due."""
        while self.events and self.events[0].time <= self.time:
            event = self.events.pop(0)
            self.elongate(event.muscle, event.elongation)

    def _advance(self) -> None:
        """Step the physics for one control period, and update paths and poses.

        `mj_step` computes paths and poses from the joint angles and then moves the joints, which
        leaves paths and poses a time step behind. Here the position stage of the next time step
        runs at the end of the period. The next period skips it, unless the state was changed in
        between. The bits are those of `mj_step` alone. After a change of the geometry of ``model``
        call `mj_forward`.

        Raises:
            DivergedError: the state of the simulation is no longer finite.
        """
        model, data, motors = self.model, self.data, self.motors
        left = self._substeps
        if self._left_at.tobytes() == self._state().tobytes():
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_step2(model, data)
            left -= 1
        if motors.frictions:
            for _ in range(left):
                motors.update_friction()
                mujoco.mj_step(model, data)
            motors.update_friction()
        else:
            mujoco.mj_step(model, data, left)
        self._check_finite()
        mujoco.mj_fwdPosition(model, data)
        self._left_at[:] = self._state()

    def _find_arrays(self) -> None:
        super()._find_arrays()
        self._mujoco.qpos, self._mujoco.qvel = self.data.qpos, self.data.qvel
        self._mujoco.warnings = self.data.warning.number[DIVERGENCE]  # a view

    def _state(self) -> Floats:
        """Positions and velocities (nq + nv,)."""
        return np.concatenate([self._mujoco.qpos, self._mujoco.qvel])

    def _check_finite(self) -> None:
        """Raise `DivergedError` after a state that was not finite or that MuJoCo reset."""
        # Velocities that are finite leave positions finite, and so does the sum of their squares.
        velocity = self._mujoco.qvel
        finite = isfinite(velocity.dot(velocity))
        if not finite or any(self._mujoco.warnings.tolist()):
            raise DivergedError

    def close_fingers(self, command: float) -> None:
        """Command the fingers, from -1 (open) to +1 (closed); no effect without fingers."""
        if self._fingers is not None:
            self.data.ctrl[self._fingers] = command

    def elongate(self, muscle: str, length: float) -> None:
        """Elongate a tendon until the next reset.

        Args:
            muscle: name of the muscle.
            length: added length [m].

        Raises:
            UnknownNameError: there is no such muscle.
        """
        if muscle not in self.muscles:
            raise UnknownNameError("muscle", muscle, self.muscles)
        elongation = self.motors.elongation
        elongation[self.muscles.index(muscle)] += length
        self.motors.elongate(elongation)

    def layout(self) -> dict[str, int | Floats | NDArray[np.int64] | None]:
        """Values of the fields of ``Step`` in control_step.c; the arrays are never replaced."""
        return {
            "model": self.model._address,
            "data": self.data._address,
            "substeps": self._substeps,
            "muscles": len(self.muscles),
            "joints": len(self.joints),
            "fingers": -1 if self._fingers is None else self._fingers,
            "grip": self.model.site("grip").id,
            "zero": self._zero,
            "position": np.arange(self.model.nq)[self._position],
            "left_at": self._left_at,
            "target": self._target,
            **self.motors.layout(),
            **self._sensors.layout(),
        }

    @property
    def plans_events(self) -> bool:
        """Whether each reset plans elongations that come in the episode."""
        return bool(self._planned)

    @property
    def kinds_of_noise(self) -> int:
        """Number of kinds of sensors that have noise."""
        return self._sensors.kinds_of_noise

    def _noise(self, kinds: int) -> Floats:
        return self.random.standard_normal((kinds, len(self.muscles)))

    def __getstate__(self) -> dict[str, Any]:
        """State without MuJoCo's arrays, and without the computed stage of the next time step."""
        nowhere = np.full_like(self._left_at, np.nan)
        return {**self.__dict__, "_mujoco": None, "_left_at": nowhere}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._find_arrays()
