"""The nearest posture that the remaining muscles can hold.

Without some muscle there may be no tensions that balance a wanted posture w. Of those that can be
balanced, the nearest one is

    min |r(theta)|^2    over theta within the joint limits and T_bias <= T <= T_max
    s.t. G(theta)' T + (stops) = tau(theta),

where r is theta - w, or for a goal of the hand its distance and rotation from where it is at w,
with a small weight on theta - w. It is solved by steps of a quadratic programme, linearised about
theta and T; torque that is missing is allowed at a high price, and a trust region keeps steps
short. A joint that leaves the range in which it can be balanced often rests only at its stop, so
the search begins at w and, if it ends elsewhere than at a posture that can be held, with the
joints that lack torque at the stops towards which they fall. `advance` takes one step, so that a
control step stays short.

A muscle at its limit does not resist when it is stretched. The bounds of the tensions are therefore
narrower in the search (`MARGIN`), and the posture found must be stable with the muscles that pull
more than T_bias and less than T_max, with a share `FIRM` of the stiffness that all muscles would
have there at least.
"""

from __future__ import annotations

from collections.abc import Callable
from ctypes import c_int
from typing import NamedTuple

import daqp
import numpy as np
from scipy.spatial.transform import Rotation

from jmm_agent.guard.faults import MotorControl
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.tension_distribution import (
    EQUAL,
    FREE,
    TOLERANCE,
    Distribution,
    TensionDistribution,
)
from jmm_agent.types import Bools, Floats

MARGIN = 0.05, 0.2
"""Shares of T_bias and of T_max by which tensions stay within their bounds in the search [1]."""
FIRM = 0.2
"""Least stiffness in the softest direction, as a share of that with all muscles [1]."""
FREELY = 1e-3
"""A muscle resists if its tension is within its bounds by this share of them [1]."""
STEPS = 24
"""Largest number of steps from one start."""
LARGEST_STEP = 0.15
"""Largest change of a joint in one step, as a share of its range [1]."""
SMALLEST_STEP = 1e-3
"""A trust region below this share of the range ends the search [1]."""
BETWEEN = 0.3
"""Share of the path to where the joints fall at which the search begins, too [1]."""
LOW, HIGH = 3e3, 3e5
"""Prices of missing torque, in units of the largest at T_bias, against the distance [1]."""
EASE = 1e-3
"""Price of a tension of T_max [1]."""
ROTATED, BENT = 0.3, 0.1
"""Weights of the hand's rotation and of the joints beside the hand's distance [1]."""

Offset = Callable[[Floats], tuple[Floats, Floats]]
"""Joint angles (n,) [rad] -> how far they are from the goal (r,), and the Jacobian (r, n)."""


class Held(NamedTuple):
    """A posture that can be held, or the one that lacks least.

    Attributes:
        posture: joint angles (n,) [rad].
        pull: tensions there.
        holds: whether they hold it.
    """

    posture: Floats
    pull: Distribution
    holds: bool


def joint_offset(wanted: Floats) -> Offset:
    """Distance of joint angles from wanted ones (n,) [rad]."""
    return lambda q: (q - wanted, np.eye(len(wanted)))


def frame_offset(wanted: Floats, kinematics: ArmKinematics, frame: str) -> Offset:
    """Distance of a frame from where it is at wanted joint angles.

    Distances are divided by the arm's length, the distance of the frame from the joints' axes.

    Args:
        wanted: joint angles (n,) [rad].
        kinematics: of the arm.
        frame: its name.
    """
    goal = kinematics.pose(frame, wanted)
    slope = kinematics.frame_jacobian(frame, wanted)
    moved, turned = (float(np.linalg.norm(part)) for part in (slope[:3], slope[3:]))
    arm = max(moved / max(turned, 1e-12), 1e-9)

    def offset(q: Floats) -> tuple[Floats, Floats]:
        pose, rows = kinematics.pose(frame, q), kinematics.frame_jacobian(frame, q)
        away = pose[:3, :3].T @ (pose[:3, 3] - goal[:3, 3]) / arm
        rotation = Rotation.from_matrix(goal[:3, :3].T @ pose[:3, :3]).as_rotvec()
        return (
            np.concatenate([away, ROTATED * rotation, BENT * (q - wanted)]),
            np.vstack([rows[:3] / arm, ROTATED * rows[3:], BENT * np.eye(len(q))]),
        )

    return offset


class NearestPosture:
    """Search for the posture nearest to a wanted one that can be held (module docstring).

    Args:
        wanted: joint angles (n,) [rad], within the limits.
        jmm: the joint-muscle mapping as learned so far.
        motors: gains and limit.
        distribution: of the tensions, with the muscles in use.
        offset: how far joint angles are from the goal.

    Attributes:
        best: the nearest posture so far that can be held; before one was found, the wanted one.
        done: whether the search has ended.
    """

    def __init__(
        self,
        wanted: Floats,
        jmm: JointMuscleMap,
        motors: MotorControl,
        distribution: TensionDistribution,
        offset: Offset,
    ) -> None:
        assert distribution.limits is not None
        self._map, self._motors, self._distribution = jmm, motors, distribution
        self._offset, self._low, self._high = offset, *distribution.limits.T
        self._range = np.maximum(self._high - self._low, 1e-9)
        pull = self._pull(wanted)
        self.best = Held(wanted, pull, pull.lacking(motors) is None)
        self.done = self.best.holds
        fallen = self._fallen(wanted, pull)
        between = wanted + BETWEEN * (fallen - wanted)
        starts = [(wanted, LOW), (None, HIGH), (between, LOW), (None, HIGH), (fallen, HIGH)]
        self._starts = [] if self.done else starts
        self._q, self._here = wanted, pull
        self._lowest, self._trust, self._left, self._price = np.inf, LARGEST_STEP, 0, LOW

    def run(self) -> Held:
        """Search to the end."""
        while not self.done:
            self.advance()
        return self.best

    def advance(self) -> None:
        """Take one step of the search."""
        if self.done:
            return
        if self._left == 0:
            if not self._starts:
                self.done = True
                return
            self._begin(*self._starts.pop(0))
        self._left -= 1
        tried = np.clip(self._q + self._step(), self._low, self._high)
        pull = self._pull(tried)
        merit = self._merit(tried, pull)
        if merit < self._lowest:
            gain, self._lowest = self._lowest - merit, merit
            self._q, self._here = tried, pull
            self._keep(tried, pull)
            self._trust = min(2.0 * self._trust, LARGEST_STEP)
            small = gain < 1e-6 * merit
        else:
            self._trust *= 0.35
            small = self._trust < SMALLEST_STEP
        if small:
            self._left = 0
        if self._left == 0 and not self._starts:
            self.done = True

    def _begin(self, start: Floats | None, price: float) -> None:
        """Begin at a posture, or go on at the present one, with a price of missing torque."""
        self._q = self._q if start is None else start
        self._here, self._price = self._pull(self._q), price
        self._lowest, self._trust = self._merit(self._q, self._here), LARGEST_STEP
        self._left = STEPS
        self._keep(self._q, self._here)

    def _keep(self, q: Floats, pull: Distribution) -> None:
        """Remember a posture if it is better than the best one so far."""
        if pull.lacking(self._motors) is None and self._stable(q, pull):
            if not self.best.holds or self._distance(q) < self._distance(self.best.posture):
                self.best = Held(q, pull, True)
        elif not self.best.holds:
            less = float(np.abs(pull.missing).max()) < float(np.abs(self.best.pull.missing).max())
            self.best = Held(q, pull, False) if less else self.best

    def _pull(self, q: Floats) -> Distribution:
        return self._distribution.at(self._map, self._motors, q)

    def _stable(self, q: Floats, pull: Distribution) -> bool:
        """Whether muscles and stops oppose every small displacement of a posture, and firmly."""
        motors, tensions = self._motors, pull.tensions
        free = np.flatnonzero(self._pushed(q, pull) == 0.0)
        if not free.size:
            return True
        resists = tensions > (1.0 + FREELY) * motors.bias
        resists &= tensions < (1.0 - FREELY) * motors.limit
        gains = np.broadcast_to(np.asarray(motors.gains, dtype=float), tensions.shape)
        series = 1.0 / (1.0 / gains - self._map.tension_jacobian(tensions))
        arms, every = pull.arms[:, free], self._map.jacobian(q)[:, free]
        slope = self._distribution.slope(self._map, q, tensions)[np.ix_(free, free)]
        left = np.linalg.eigvalsh(slope + (arms.T * (series * resists)) @ arms)[0]
        return bool(left > FIRM * np.linalg.eigvalsh((every.T * series) @ every)[0])

    def _pushed(self, q: Floats, pull: Distribution) -> Floats:
        """1 or -1 for a joint that its upper or lower stop pushes back, else 0 (n,)."""
        torque = self._distribution.loads.gravity(q) - pull.arms.T @ pull.tensions - pull.missing
        pushed = np.abs(torque) > TOLERANCE * self._torque(pull)
        return np.where(pushed, self._distribution.stops(q), 0.0)

    def _distance(self, q: Floats) -> float:
        return float(np.sum(self._offset(q)[0] ** 2))

    def _merit(self, q: Floats, pull: Distribution) -> float:
        missing = pull.missing / self._torque(pull)
        return self._distance(q) + self._price * float(np.sum(missing**2))

    def _torque(self, pull: Distribution) -> float:
        """The largest torque of a muscle at T_bias [N m]."""
        return max(self._motors.bias * float(np.abs(pull.arms).max()), 1e-12)

    def _fallen(self, wanted: Floats, pull: Distribution) -> Floats:
        """The wanted posture, with joints that lack torque at the stops towards which they fall."""
        lacking = np.abs(pull.missing) > 0.3 * np.abs(pull.missing).max()
        stop = np.where(pull.missing > 0.0, self._high, self._low)
        return np.where(lacking, stop, wanted)

    def _in_use(self, count: int) -> Bools:
        in_use = self._distribution.in_use
        return np.ones(count, dtype=bool) if in_use is None else in_use

    def _step(self) -> Floats:
        """Change of the joint angles (n,) [rad] by the quadratic programme."""
        q, pull, motors = self._q, self._here, self._motors
        m, n = pull.arms.shape
        unit = self._torque(pull)
        offset, rows = self._offset(q)
        slope = self._distribution.slope(self._map, q, pull.tensions)
        stops = self._pushed(q, pull)  # such joints stay there
        # The unknowns: change of angles (n,), tensions over the limit (m,), torques of stops (n,)
        # and missing torques (n,), both in units.
        matrix = np.hstack(
            [slope / unit, pull.arms.T * (motors.limit / unit), np.diag(stops), np.eye(n)]
        )
        torque = self._distribution.loads.gravity(q) / unit
        hessian = np.zeros((2 * n + m + n, 2 * n + m + n))
        hessian[:n, :n] = rows.T @ rows + 1e-6 * np.eye(n)
        easy = np.arange(n, 2 * n + m)
        hessian[easy, easy] = EASE
        last = np.arange(2 * n + m, 3 * n + m)
        hessian[last, last] = self._price
        linear = np.zeros(len(hessian))
        linear[:n] = rows.T @ offset
        reach = np.where(stops != 0.0, 0.0, self._trust * self._range)
        in_use = self._in_use(m)
        least = np.where(in_use, (1.0 + MARGIN[0]) * motors.bias / motors.limit, 0.0)
        most = np.where(in_use, np.maximum(1.0 - MARGIN[1], least), 0.0)
        pushes, free = np.where(stops != 0.0, FREE, 0.0), np.full(n, FREE)
        x, _, flag, _ = daqp.solve(
            hessian,
            linear,
            matrix,
            np.concatenate([np.minimum(reach, self._high - q), most, pushes, free, torque]),
            np.concatenate([np.maximum(-reach, self._low - q), least, np.zeros(n), -free, torque]),
            np.concatenate([np.zeros(len(hessian)), np.full(n, EQUAL)]).astype(c_int),
        )
        return np.asarray(x[:n] if flag > 0 else np.zeros(n))
