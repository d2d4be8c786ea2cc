"""Motors of the muscles: commands, and what encoders and tension sensors would read without error.

`muscle_law` says how a motor pulls. A tendon that stretches is wound on a spool, a slide joint of
its own (`tendons`); one that does not is pulled by its actuator directly.
"""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.arguments import real_numbers
from kengoro_env.errors import ArgumentError
from kengoro_env.robot.draft import Draft
from kengoro_env.robot.friction import GrowingFriction
from kengoro_env.robot.indexing import index_of, reader
from kengoro_env.robot.muscle_law import (
    Gains,
    motor_tension,
    spring_stretch,
    spring_tension,
    write_law,
)
from kengoro_env.robot.tendons import SPOOL_TRAVEL, spool_joint
from kengoro_env.types import Floats


class Motors:
    """Motors of a compiled robot. Arrays are (m,), in the order of the muscles.

    Motors of many robots (`of_many`) have a leading axis of robots in arrays that change.

    Args:
        model: the compiled model.
        data: its state.
        draft: the draft that the model was compiled from.
        gains: gains of muscle stiffness control at the start.

    Attributes:
        muscles: names of the muscles.
        stiffness: K_stiff (m,) [N/m].
        bias: T_bias (m,) [N].
        frictions: dry frictions that follow tension, of tendons or of joints.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, draft: Draft, gains: Gains
    ) -> None:
        self.muscles = tuple(draft.tendons)
        self._model: Any = model
        self._data: Any = data
        self._limit = gains.limit
        planned = list(draft.tendons.values())
        # NumPy is faster with an array than with a number.
        self._limits, self._damping, self._zeros = (
            np.full(len(planned), value) for value in (gains.limit, gains.damping, 0.0)
        )
        tendons = np.array([model.tendon(name).id for name in self.muscles])
        self._tendon = index_of(tendons)
        actuators = np.array([model.actuator(name).id for name in self.muscles])
        self._actuator = index_of(actuators)
        self._spooled = np.array([tendon.stiffness is not None for tendon in planned])
        self._has_spools, self._all_spooled = bool(self._spooled.any()), bool(self._spooled.all())
        spools = [
            model.joint(spool_joint(name))
            for name, spooled in zip(self.muscles, self._spooled, strict=True)
            if spooled
        ]
        self._spool_position = index_of(np.array([j.qposadr[0] for j in spools], dtype=int))
        self._spool_velocity = np.array([joint.dofadr[0] for joint in spools], dtype=int)
        self._spooled_tendon = tendons[self._spooled]
        self._polynomial = np.array(
            [tendon.stiffness or (0.0, 0.0, 0.0) for tendon in planned]
        ).T.copy()
        # A tendon pulls by a negative force on its length, a spool by a positive one on its travel.
        self._sign = np.where(self._spooled, 1.0, -1.0)
        self.frictions = self._growing_frictions(
            np.array([tendon.friction_ratio for tendon in planned]), tendons, actuators
        )
        self._elongation = np.array([tendon.elongation for tendon in planned])
        self._elongated = bool(self._elongation.any())
        self._drum = np.zeros(len(tendons))  # length paid out when the spool stands at zero
        self.stiffness, self.bias = (np.zeros(len(tendons)) for _ in range(2))
        self._find_arrays()
        self._set_drums()
        self.set_stiffness(gains.stiffness, gains.bias)

    def _growing_frictions(
        self, ratio: Floats, tendons: NDArray[np.int64], actuators: NDArray[np.int64]
    ) -> tuple[GrowingFriction, ...]:
        straight = ~self._spooled
        return tuple(
            GrowingFriction(
                self._model, field, elements, actuators[these], (self._sign * ratio)[these]
            )
            for field, elements, these in (
                ("tendon_frictionloss", tendons[straight], straight),
                ("dof_frictionloss", self._spool_velocity, self._spooled),
            )
            if np.any(ratio[these] > 0.0)
        )

    def of_many(self, count: int, model: Any, data: Any) -> Motors:
        """These motors in ``count`` robots.

        Args:
            count: number of robots.
            model: has the arrays of an `MjModel` that motors write, with a leading axis of robots.
            data: has the arrays of an `MjData`, with a leading axis of robots.
        """
        many = copy(self)
        many._model, many._data = model, data
        many._elongation = np.tile(self._elongation, (count, 1))
        many.stiffness, many.bias = self.stiffness.copy(), self.bias.copy()
        many._find_arrays()
        return many

    def _find_arrays(self) -> None:
        """Find the arrays of MuJoCo that are read and written in each step."""
        data = self._data
        self._mujoco = SimpleNamespace(
            lengths=reader(data.ten_length, self._tendon),
            velocities=reader(data.ten_velocity, self._tendon),
            commands=reader(data.ctrl, self._actuator),
            spools=reader(data.qpos, self._spool_position),
            ctrl=data.ctrl,
            frictions=[friction.follow(self._model, data) for friction in self.frictions],
        )

    def __getstate__(self) -> dict[str, Any]:
        """State without MuJoCo's arrays, which a copy finds for itself."""
        return {**self.__dict__, "_mujoco": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._find_arrays()

    def _set_drums(self) -> None:
        """Choose the length of each tendon such that its spool stays beyond the guide."""
        path = self.paths()
        self._drum = np.where(self._spooled, path + SPOOL_TRAVEL / 2, 0.0)
        self._write_slack_lengths()

    def _write_slack_lengths(self) -> None:
        longest = (self._drum + self._elongation)[..., self._spooled]
        self._model.tendon_lengthspring[..., self._spooled_tendon, 1] = longest

    def set_stiffness(self, stiffness: object, bias: object) -> None:
        """Set the gains of muscle stiffness control.

        Args:
            stiffness: K_stiff, a number or (m,) [N/m].
            bias: T_bias, a number or (m,), at most T_max [N].

        Raises:
            ArgumentError: a value is negative or not finite, or has another shape.
        """
        shape = (len(self.muscles),)
        values = []
        for name, value in (("stiffness", stiffness), ("bias", bias)):
            found = real_numbers(value)
            array = np.array(np.nan) if found is None else found
            if array.shape not in ((), shape) or not np.all(np.isfinite(array) & (array >= 0)):
                raise ArgumentError(
                    f"set_stiffness: {name} must be finite, not negative and of shape () or "
                    f"{shape}, got {value!r}"
                )
            values.append(np.broadcast_to(array, shape).copy())
        if np.any(values[1] > self._limit):
            raise ArgumentError(f"set_stiffness: bias must be at most T_max = {self._limit} N")
        self.stiffness[:], self.bias[:] = values
        gains = (self.stiffness, self.bias, self._limit)
        write_law(self._model, self._actuator, gains, self._sign, self._drum)

    def measure(self) -> tuple[Floats, Floats, Floats]:
        """True lengths and tensions of the muscles now.

        Returns:
            Lengths of the paths from guide to end (m,) [m]; lengths paid out, which are path minus
            stretch minus permanent elongation (m,) [m]; tensions, never negative (m,) [N]: of the
            spring for a tendon that stretches, of the motor for any other.
        """
        lengths = self._mujoco.lengths()
        if not self._has_spools:
            paid_out = lengths - self._elongation if self._elongated else lengths
            return lengths, paid_out, self._motor_tension(lengths)
        turned = self._turned()
        paths, paid_out = lengths - turned, self._drum - turned
        stretch = paths - paid_out
        stretch -= self._elongation
        tensions = spring_tension(stretch, self._polynomial)
        if not self._all_spooled:
            paid_out = np.where(self._spooled, paid_out, lengths - self._elongation)
            tensions = np.where(self._spooled, tensions, self._motor_tension(lengths))
        return paths, paid_out, tensions

    def paths(self) -> Floats:
        """True lengths of the paths from guide to end (m,) [m]."""
        lengths: Floats = self._mujoco.lengths() - self._turned()
        return lengths

    def _turned(self) -> Floats:
        """Travel of the spools from zero [m]; 0 without a spool."""
        positions: Floats = self._mujoco.spools()
        if self._all_spooled:
            return positions
        turned = np.zeros((*positions.shape[:-1], len(self.muscles)))
        turned[..., self._spooled] = positions
        return turned

    def _motor_tension(self, lengths: Floats) -> Floats:
        gains = (self.stiffness, self.bias, self._limits)
        commands, velocities = self._mujoco.commands(), self._mujoco.velocities()
        return motor_tension(lengths, commands, velocities, gains, self._damping)

    def slack(self, paths: Floats, paid_out: Floats) -> Floats:
        """Length paid out beyond the path (m,) [m].

        Args:
            paths: lengths of the paths (m,) [m].
            paid_out: lengths paid out (m,) [m].
        """
        if not self._has_spools and not self._elongated:
            return np.zeros(paths.shape)
        beyond = paid_out + self._elongation
        beyond -= paths
        return np.maximum(beyond, self._zeros, out=beyond)

    def stretch_at(self, tension: Floats) -> Floats:
        """Stretch of each tendon at a tension (m,) [N], in [m]; 0 for one that does not stretch."""
        return spring_stretch(tension, self._polynomial, self._spooled)

    def wind_up(self) -> None:
        """Turn every spool until its tendon pulls with T_bias in the present posture."""
        travel = self._drum + self._elongation + self.stretch_at(self.bias) - self.paths()
        self._data.qpos[self._spool_position] = travel[self._spooled]
        self._data.qvel[self._spool_velocity] = 0.0

    def command(self, paid_out: Floats) -> None:
        """Command the lengths to be paid out (m,) [m]."""
        target = paid_out + self._elongation if self._elongated else paid_out
        if self._elongated and self._has_spools:
            target = np.where(self._spooled, paid_out, target)
        self._mujoco.ctrl[..., self._actuator] = target

    def elongate(self, elongation: Floats) -> None:
        """Set the permanent elongation of the tendons since they were mounted (m,) [m]."""
        self._elongation[:] = elongation
        self._elongated = bool(elongation.any())
        self._write_slack_lengths()

    def elongate_one(self, i: int, elongation: Floats) -> None:
        """Set the permanent elongation (m,) [m] in robot ``i`` of many."""
        if not np.array_equal(self._elongation[i], elongation):
            self._elongation[i] = elongation
            self._elongated = True
            self._write_slack_lengths()

    @property
    def elongation(self) -> Floats:
        """Permanent elongation of the tendons [m]."""
        return self._elongation.copy()

    def layout(self) -> dict[str, Floats | NDArray[np.int64]]:
        """Values of the fields of ``Step`` in control_step.c; the arrays are never replaced."""
        spool = np.full(len(self.muscles), -1)
        spool[self._spooled] = np.arange(self._model.nq)[self._spool_position]
        return {
            "tendon": np.arange(self._model.ntendon)[self._tendon],
            "actuator": np.arange(self._model.nu)[self._actuator],
            "spool": spool,
            "drum": self._drum,
            "elongation": self._elongation,
            "stiffness": self.stiffness,
            "bias": self.bias,
            "limit": self._limits,
            "damping": self._damping,
            "polynomial": self._polynomial,
        }

    def update_friction(self) -> None:
        """Set the dry friction that follows tension."""
        for follow in self._mujoco.frictions:
            follow()
