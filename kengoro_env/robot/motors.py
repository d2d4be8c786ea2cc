"""Motors: muscle stiffness control, what encoders and tension sensors would read without error.

Muscle stiffness control (paper, sec. III-B), T = T_bias + max(0, K (l - l_target)), is a stock
affine actuator of MuJoCo, cut at T_bias and T_max; it runs at the physics rate in C.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.errors import KengoroError
from kengoro_env.robot.draft import Draft
from kengoro_env.robot.friction import GrowingFriction
from kengoro_env.robot.indexing import index_of, reader
from kengoro_env.robot.tendons import MOTOR_DAMPING, SPOOL_TRAVEL, spool_joint
from kengoro_env.types import Floats


@dataclass(frozen=True)
class Gains:
    """Muscle stiffness control, the same for drawing and actual robot.

    Attributes:
        stiffness: K_stiff [N/m].
        bias: T_bias, the tension that keeps a wire from going slack [N].
        limit: T_max, the largest tension of a motor [N].
    """

    stiffness: float = 30_000.0
    bias: float = 30.0
    limit: float = 500.0


DEFAULT_GAINS = Gains()


class Motors:
    """The wires' motors of a compiled robot; every array is (m,), in the order of the muscles.

    Of many robots at once (`of_many`) they have the robots as a leading axis.

    Attributes:
        stiffness, bias: K_stiff (m,) [N/m] and T_bias (m,) [N].
        frictions: those that follow tension, of tendons or joints.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, draft: Draft, gains: Gains):
        self.muscles = tuple(draft.tendons)
        self._model: Any = model
        self._data: Any = data
        self._limit = gains.limit
        planned = list(draft.tendons.values())
        # NumPy is faster with an array than with a number.
        self._limits, self._damping, self._none = (
            np.full(len(planned), value) for value in (gains.limit, MOTOR_DAMPING, 0.0)
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
        ratio = np.array([tendon.friction_ratio for tendon in planned])
        straight = ~self._spooled
        self.frictions = tuple(
            GrowingFriction(model, field, places, actuators[these], (self._sign * ratio)[these])
            for field, places, these in (
                ("tendon_frictionloss", tendons[straight], straight),
                ("dof_frictionloss", self._spool_velocity, self._spooled),
            )
            if np.any(ratio[these] > 0.0)
        )
        self._elongation = np.array([tendon.elongation for tendon in planned])
        self._elongated = bool(self._elongation.any())
        self._drum = np.zeros(len(tendons))  # paid out when the spool stands at zero
        self.stiffness, self.bias = (np.zeros(len(tendons)) for _ in range(2))
        self._look()
        self._lay_out()
        self.set_stiffness(gains.stiffness, gains.bias)

    def of_many(self, count: int, model: Any, data: Any) -> Motors:
        """These motors in ``count`` robots.

        Args:
            count: of robots.
            model: has the arrays of an `MjModel` that motors write, with an axis of robots before.
            data: the same of an `MjData`.
        """
        many = copy(self)
        many._model, many._data = model, data
        many._elongation = np.tile(self._elongation, (count, 1))
        many.stiffness, many.bias = self.stiffness.copy(), self.bias.copy()
        many._look()
        return many

    def _look(self) -> None:
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
        """Arrays of MuJoCo do not travel with a copy."""
        return {**self.__dict__, "_mujoco": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._look()

    def _lay_out(self) -> None:
        """Choose each wire's length such that its spool's travel stays beyond the guide."""
        path = self.paths()
        self._drum = np.where(self._spooled, path + SPOOL_TRAVEL / 2, 0.0)
        self._write_slack_lengths()

    def _write_slack_lengths(self) -> None:
        longest = (self._drum + self._elongation)[..., self._spooled]
        self._model.tendon_lengthspring[..., self._spooled_tendon, 1] = longest

    def set_stiffness(self, stiffness: object, bias: object) -> None:
        """Set K_stiff [N/m] and T_bias [N], each a number or (m,); `KengoroError` if not valid."""
        shape = (len(self.muscles),)
        values = []
        for name, value in (("stiffness", stiffness), ("bias", bias)):
            try:
                array = np.asarray(value, dtype=float)
            except (TypeError, ValueError):
                array = np.array(np.nan)
            if array.shape not in ((), shape) or not np.all(np.isfinite(array) & (array >= 0)):
                raise KengoroError(
                    f"set_stiffness: {name} must be finite, not negative and of shape () or "
                    f"{shape}, got {value!r}"
                )
            values.append(np.broadcast_to(array, shape).copy())
        if np.any(values[1] > self._limit):
            raise KengoroError(f"set_stiffness: bias must be at most T_max = {self._limit} N")
        self.stiffness[:], self.bias[:] = values
        sign = self._sign
        low, high = np.sort([sign * self.bias, sign * self._limit], axis=0)
        model, index = self._model, self._actuator
        model.actuator_gainprm[index, 0] = -sign * self.stiffness
        model.actuator_biasprm[index, 0] = sign * self.bias + np.where(
            self._spooled, self.stiffness * self._drum, 0.0
        )
        model.actuator_biasprm[index, 1] = -self.stiffness
        model.actuator_forcerange[index] = np.column_stack([low, high])

    def measure(self) -> tuple[Floats, Floats, Floats]:
        """Where the wires are and how they pull now, true.

        A wire that stretches pulls with its spring's force, another one with its motor's.

        Returns:
            Lengths of the paths from guide to end (m,) [m]; what encoders without error would read
            (m,) [m], path minus stretch minus elongation; tensions, never negative (m,) [N].
        """
        lengths = self._mujoco.lengths()
        if not self._has_spools:
            paid_out = lengths - self._elongation if self._elongated else lengths
            return lengths, paid_out, self._motor_pull(lengths)
        turned = self._turned()
        paths, paid_out = lengths - turned, self._drum - turned
        stretch = paths - paid_out
        stretch -= self._elongation
        tensions = self._pull(stretch)
        if not self._all_spooled:
            paid_out = np.where(self._spooled, paid_out, lengths - self._elongation)
            tensions = np.where(self._spooled, tensions, self._motor_pull(lengths))
        return paths, paid_out, tensions

    def paths(self) -> Floats:
        """Lengths of the wires' paths from guide to end [m], true."""
        lengths: Floats = self._mujoco.lengths() - self._turned()
        return lengths

    def _turned(self) -> Floats:
        """How far spools have turned from where they stand at zero [m]; 0 without a spool."""
        positions: Floats = self._mujoco.spools()
        if self._all_spooled:
            return positions
        turned = np.zeros((*positions.shape[:-1], len(self.muscles)))
        turned[..., self._spooled] = positions
        return turned

    def _motor_pull(self, lengths: Floats) -> Floats:
        pull: Floats = self._mujoco.commands()
        np.subtract(lengths, pull, out=pull)
        pull *= self.stiffness
        pull += self.bias
        np.maximum(pull, self.bias, out=pull)
        np.minimum(pull, self._limits, out=pull)
        damped = self._mujoco.velocities()
        damped *= self._damping
        pull += damped
        return np.maximum(pull, self._none, out=pull)

    def _pull(self, stretch: Floats) -> Floats:
        x = np.maximum(stretch, self._none)
        k1, k2, k3 = self._polynomial
        pull: Floats = k3 * x
        pull += k2
        pull *= x
        pull += k1
        pull *= x
        return pull

    def slack(self, paths: Floats, paid_out: Floats) -> Floats:
        """How much more of each wire is paid out (m,) [m] than its path takes (m,) [m]."""
        if not self._has_spools and not self._elongated:
            return np.zeros(paths.shape)
        beyond = paid_out + self._elongation
        beyond -= paths
        return np.maximum(beyond, self._none, out=beyond)

    def stretch_at(self, tension: Floats) -> Floats:
        """Stretch [m] of each wire at a tension [N] (m,), by Newton's method; 0 without stretch."""
        x = np.zeros(len(self.muscles))
        k1, k2, k3 = self._polynomial
        for _ in range(30):
            slope = np.where(self._spooled, k1 + x * (2 * k2 + 3 * k3 * x), 1.0)
            x = np.where(self._spooled, x - (self._pull(x) - tension) / slope, 0.0)
        return x

    def wind_up(self) -> None:
        """Turn every spool until its wire pulls with T_bias at the present posture."""
        travel = self._drum + self._elongation + self.stretch_at(self.bias) - self.paths()
        self._data.qpos[self._spool_position] = travel[self._spooled]
        self._data.qvel[self._spool_velocity] = 0.0

    def command(self, paid_out: Floats) -> None:
        """Set the target of what is paid out [m] (m,) for the stiffness control."""
        target = paid_out + self._elongation if self._elongated else paid_out
        if self._elongated and self._has_spools:
            target = np.where(self._spooled, paid_out, target)
        self._mujoco.ctrl[..., self._actuator] = target

    def elongate(self, elongation: Floats) -> None:
        """Let wires give for good, in all by ``elongation`` [m] (m,) since they were mounted."""
        self._elongation[:] = elongation
        self._elongated = bool(elongation.any())
        self._write_slack_lengths()

    def elongate_one(self, i: int, elongation: Floats) -> None:
        """The same (m,) [m] in the ``i``-th of many robots."""
        if not np.array_equal(self._elongation[i], elongation):
            self._elongation[i] = elongation
            self._elongated = True
            self._write_slack_lengths()

    @property
    def elongation(self) -> Floats:
        """By how much each wire has given for good [m]."""
        return self._elongation.copy()

    def layout(self) -> dict[str, Floats | NDArray[np.int64]]:
        """Arrays by their names in control_step.c, which are written in place, never replaced."""
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
        """Let the dry friction follow the tension."""
        for follow in self._mujoco.frictions:
            follow()
