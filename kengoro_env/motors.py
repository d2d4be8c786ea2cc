"""Motors: muscle stiffness control, what encoders and tension sensors would read without error.

Muscle stiffness control (paper, sec. III-B), T = T_bias + max(0, K (l - l_target)), is a stock
affine actuator of MuJoCo, cut at T_bias and T_max; it runs at the physics rate in C.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.draft import Draft
from kengoro_env.errors import KengoroError
from kengoro_env.wires import MOTOR_DAMPING, SPOOL_TRAVEL, spool_joint

Array = NDArray[np.float64]


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
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, draft: Draft, gains: Gains):
        self.muscles = tuple(draft.wires)
        self._model: Any = model
        self._data: Any = data
        self._limit = gains.limit
        wires = list(draft.wires.values())
        self._tendon = np.array([model.tendon(name).id for name in self.muscles])
        self._actuator = np.array([model.actuator(name).id for name in self.muscles])
        self._spooled = np.array([wire.stiffness is not None for wire in wires])
        self._has_spools = bool(self._spooled.any())
        spools = [
            model.joint(spool_joint(name))
            for name, spooled in zip(self.muscles, self._spooled, strict=True)
            if spooled
        ]
        self._spool_position = np.array([joint.qposadr[0] for joint in spools], dtype=int)
        self._spool_velocity = np.array([joint.dofadr[0] for joint in spools], dtype=int)
        self._polynomial = np.array([wire.stiffness or (0.0, 0.0, 0.0) for wire in wires])
        self._friction = np.array([wire.friction for wire in wires])
        self._friction_ratio = np.array([wire.friction_ratio for wire in wires])
        self.friction_grows = bool(np.any(self._friction_ratio > 0.0))
        self._elongation = np.array([wire.elongation for wire in wires])
        self._drum = np.zeros(len(wires))  # paid out when the spool stands at zero
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
        return many

    def _lay_out(self) -> None:
        """Choose each wire's length such that its spool's travel stays beyond the guide."""
        path = self.paths()
        self._drum = np.where(self._spooled, path + SPOOL_TRAVEL / 2, 0.0)
        self._write_slack_lengths()

    def _write_slack_lengths(self) -> None:
        spooled = self._tendon[self._spooled]
        longest = (self._drum + self._elongation)[..., self._spooled]
        self._model.tendon_lengthspring[..., spooled, 1] = longest

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
        self.stiffness, self.bias = values
        # A tendon pulls by a negative force on its length, a spool by a positive one on its travel.
        sign = np.where(self._spooled, 1.0, -1.0)
        low, high = np.sort([sign * self.bias, sign * self._limit], axis=0)
        model, index = self._model, self._actuator
        model.actuator_gainprm[index, 0] = -sign * self.stiffness
        model.actuator_biasprm[index, 0] = sign * self.bias + np.where(
            self._spooled, self.stiffness * self._drum, 0.0
        )
        model.actuator_biasprm[index, 1] = -self.stiffness
        model.actuator_forcerange[index] = np.column_stack([low, high])

    def paths(self) -> Array:
        """Lengths of the wires' paths from guide to end [m], true."""
        lengths: Array = self._data.ten_length[..., self._tendon]
        if self._has_spools:
            lengths[..., self._spooled] -= self._data.qpos[..., self._spool_position]
        return lengths

    def paid_out(self) -> Array:
        """What an encoder without error reads [m]: path minus stretch minus elongation."""
        lengths: Array = self._data.ten_length[..., self._tendon] - self._elongation
        if self._has_spools:
            turned = self._data.qpos[..., self._spool_position]
            lengths[..., self._spooled] = self._drum[self._spooled] - turned
        return lengths

    def tensions(self) -> Array:
        """Tensions of the wires [N], true, never negative.

        A wire that stretches pulls with its spring's force, another one with its motor's.
        """
        tensions = self._motor_pull()
        if self._has_spools:
            stretch = self.paths() - self.paid_out() - self._elongation
            tensions = np.where(self._spooled, self._pull(stretch), tensions)
        return tensions

    def _motor_pull(self) -> Array:
        data = self._data
        excess = data.ten_length[..., self._tendon] - data.ctrl[..., self._actuator]
        pull = (self.bias + self.stiffness * excess).clip(self.bias, self._limit)
        return np.maximum(0.0, pull + MOTOR_DAMPING * data.ten_velocity[..., self._tendon])

    def _pull(self, stretch: Array) -> Array:
        x = np.maximum(stretch, 0.0)
        k1, k2, k3 = self._polynomial.T
        return x * (k1 + x * (k2 + x * k3))

    def stretch_at(self, tension: Array) -> Array:
        """Stretch [m] of each wire at a tension [N] (m,), by Newton's method; 0 without stretch."""
        x = np.zeros(len(self.muscles))
        k1, k2, k3 = self._polynomial.T
        for _ in range(30):
            slope = np.where(self._spooled, k1 + x * (2 * k2 + 3 * k3 * x), 1.0)
            x = np.where(self._spooled, x - (self._pull(x) - tension) / slope, 0.0)
        return x

    def wind_up(self) -> None:
        """Turn every spool until its wire pulls with T_bias at the present posture."""
        travel = self._drum + self._elongation + self.stretch_at(self.bias) - self.paths()
        self._data.qpos[self._spool_position] = travel[self._spooled]
        self._data.qvel[self._spool_velocity] = 0.0

    def command(self, paid_out: Array) -> None:
        """Set the target of what is paid out [m] (m,) for the stiffness control."""
        target = np.where(self._spooled, paid_out, paid_out + self._elongation)
        self._data.ctrl[..., self._actuator] = target

    def elongate(self, elongation: Array) -> None:
        """Let wires give for good, in all by ``elongation`` [m] (m,) since they were mounted."""
        self._elongation = elongation.copy()
        self._write_slack_lengths()

    def elongate_one(self, i: int, elongation: Array) -> None:
        """The same (m,) [m] in the ``i``-th of many robots."""
        if not np.array_equal(self._elongation[i], elongation):
            self._elongation[i] = elongation
            self._write_slack_lengths()

    @property
    def elongation(self) -> Array:
        """By how much each wire has given for good [m]."""
        return self._elongation.copy()

    def update_friction(self) -> None:
        """Let the dry friction follow the tension, as a rope's over a pulley does."""
        loss = self._friction + self._friction_ratio * np.abs(
            self._data.actuator_force[..., self._actuator]
        )
        straight = ~self._spooled
        self._model.tendon_frictionloss[..., self._tendon[straight]] = loss[..., straight]
        self._model.dof_frictionloss[..., self._spool_velocity] = loss[..., self._spooled]
