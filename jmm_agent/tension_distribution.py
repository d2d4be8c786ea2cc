"""Tensions that hold a posture with the least internal force.

At rest the muscles balance the loads, gravity and springs of joints,

    G(theta)' T = tau(theta),    T_low <= T <= T_max,

with the moment arms G = dl/dtheta of the map as learned so far. There are more muscles than joints,
and of all such tensions those are taken whose distance from T_low is least: a quadratic programme,

    min  sum_i (T_i - T_low,i)^2 / T_max^2  +  sum_j (missing_j / (SOFT T_max max|G|))^2.

It is always feasible: torques that no tensions balance stay missing, as little as possible.

A motor at T_bias does not pull less when its muscle shortens, and so resists in one direction only.
T_low is therefore above T_bias by a reserve R, where that helps: a muscle then stays above T_bias
over R / K. At a stiffness K at which that is far below the errors of the lengths, map errors decide
which muscles pull, and the reserve shrinks to R R / (K error). Muscles of joints whose stiffness is
wanted are firm: their reserve is K error, so that they resist both ways in spite of such errors.

While muscles are out of use (`jmm_agent.muscles_in_use`) they have no tension. Then a posture may
be held only at the edge of what is left: tensions may be as low as T_bias where T_low leaves torque
missing, and a stop of a joint that is at its limit pushes as a muscle would, with the largest arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from ctypes import c_int
from dataclasses import dataclass
from typing import NamedTuple

import daqp
import numpy as np

from jmm_agent.errors import AgentError, positive
from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Bools, Floats
from jmm_agent.vision.balance import Loads, load_slope

SOFT = 1e-3
"""Missing torque that costs as much as T_max of one muscle, over that on the largest arm [1]."""
TOLERANCE = 1e-3
"""Torque that may be missing, as a share of the largest torque of a muscle at T_bias [1]."""
FREE = 1e30
"""A bound that is none."""
EQUAL = 5
"""DAQP's kind of an equality."""


@dataclass(frozen=True)
class TensionOptions:
    """Which tensions muscles have beside those that the load needs.

    Attributes:
        reserve: R, tension above T_bias, as a share of T_bias [1].
        length_error: error of the lengths against which the reserve helps [m].
        most: largest reserve of firm muscles, as a share of the motors' limit [1].

    Raises:
        AgentError: a share is negative, or the error is not positive.
    """

    reserve: float = 1.0 / 3.0
    length_error: float = 0.003
    most: float = 0.2

    def __post_init__(self) -> None:
        positive("TensionOptions", length_error=self.length_error)
        for name in ("reserve", "most"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise AgentError(
                    f"TensionOptions: {name} is {getattr(self, name)}, but must be at least 0."
                )

    def low(self, motors: MotorControl, muscles: int, firm: Bools | None = None) -> Floats:
        """T_low (m,) [N].

        Args:
            motors: gains and limit.
            muscles: number of muscles, m.
            firm: which muscles are to resist both ways (m,); None for none.
        """
        stiffness = np.broadcast_to(np.asarray(motors.gains, dtype=float), (muscles,))
        reserve = min(self.reserve * motors.bias, motors.limit - motors.bias)
        helps = np.minimum(1.0, reserve / (stiffness * self.length_error))
        low = motors.bias + reserve * helps
        if firm is None:
            return np.asarray(low)
        most = min(self.most * motors.limit, motors.limit - motors.bias)
        both = motors.bias + np.minimum(stiffness * self.length_error, most)
        return np.asarray(np.where(firm, np.maximum(low, both), low))


class Distribution(NamedTuple):
    """Tensions that hold a posture, or nearly.

    Attributes:
        tensions: (m,) [N].
        missing: torques of the loads that they do not balance (n,) [N m].
        arms: moment arms (m, n) [m/rad].
    """

    tensions: Floats
    missing: Floats
    arms: Floats

    def lacking(self, motors: MotorControl) -> int | None:
        """Number of the joint that lacks most torque; None if all are held.

        Args:
            motors: gains and limit.
        """
        worst = int(np.abs(self.missing).argmax())
        least = TOLERANCE * max(motors.bias * float(np.abs(self.arms).max()), 1e-9)
        return worst if abs(float(self.missing[worst])) > least else None

    def failure(self, motors: MotorControl, joints: Sequence[str]) -> str:
        """Which joint cannot be held, in one sentence without a full stop; empty if all can.

        Args:
            motors: gains and limit.
            joints: names of the n joints.
        """
        worst = self.lacking(motors)
        if worst is None:
            return ""
        missing = abs(float(self.missing[worst]))
        return (
            f"no pull of its muscles from T_bias = {motors.bias:.3g} N to {motors.limit:.3g} N "
            f"balances joint {joints[worst]!r}, where {missing:.2g} N m are missing"
        )


def distribute(
    arms: Floats,
    torque: Floats,
    low: Floats,
    high: float,
    least: Floats | None = None,
    stops: Floats | None = None,
) -> Distribution:
    """Tensions nearest to the lowest ones that balance torques, or leave the least missing.

    Args:
        arms: moment arms (m, n) [m/rad].
        torque: of the loads (n,) [N m].
        low: wanted tensions (m,) [N], below ``high``.
        high: largest tension [N].
        least: lowest tensions (m,) [N]; ``low`` if left out.
        stops: 1 for a joint at its upper stop, -1 at its lower one, else 0 (n,); none if left out.
            What a stop pushes is not missing.

    Raises:
        AgentError: an argument is not finite, the bounds are contradictory, or no solution is
            found.
    """
    arms, torque, low = (np.asarray(part, dtype=float) for part in (arms, torque, low))
    m, n = arms.shape
    if not all(np.isfinite(part).all() for part in (arms, torque, low)) or (low > high).any():
        raise AgentError(
            "Tension distribution: moment arms, torques and bounds must be finite, and the lowest "
            f"tension of each muscle at most {high} N."
        )
    bounds = low if least is None else np.asarray(least, dtype=float)
    # The unknowns: tensions over the largest (m,), and missing torques over what they may be (n,).
    scale = max(float(np.abs(arms).max()), 1e-12)
    matrix = np.hstack([arms.T / scale, SOFT * np.eye(n)])
    balance = torque / (scale * high)
    size = max(1.0, float(np.abs(balance).max()))  # far beyond all muscles it would be too large
    wanted, balance = low / (high * size), balance / size
    lowest, highest = bounds / (high * size), np.full(m, 1.0 / size)
    at_stop = np.flatnonzero(np.zeros(n) if stops is None else stops)
    if stops is not None:  # a stop pushes like a muscle with the largest arm
        matrix = np.hstack([matrix, np.diag(stops)[:, at_stop]])
    k = len(at_stop)
    x, _, flag, _ = daqp.solve(
        np.eye(m + n + k),
        np.concatenate([-wanted, np.zeros(n + k)]),
        matrix,
        np.concatenate([highest, np.full(n + k, FREE), balance]),
        np.concatenate([lowest, np.full(n, -FREE), np.zeros(k), balance]),
        np.concatenate([np.zeros(m + n + k), np.full(n, EQUAL)]).astype(c_int),
    )
    if flag < 1:
        raise AgentError(f"Tension distribution: the solver ended without a solution ({flag}).")
    tensions = np.clip(high * size * x[:m], bounds, high)
    missing = torque - arms.T @ tensions
    missing[at_stop] -= scale * high * size * matrix[at_stop, m + n :] @ x[m + n :]
    return Distribution(tensions, missing, arms)


class TensionDistribution:
    """Tensions that hold postures by a map.

    Args:
        loads: torques that the nominal model needs to hold a posture.
        options: of the tensions without load.

    Attributes:
        firm: which muscles are to resist both ways (m,); None for none.
        loads: as given; may be replaced, for a hand that holds something.
        in_use: muscles that pull (m,); None for all.
        limits: angles at which the joints' stops are (n, 2) [rad]; they count while muscles are out
            of use. None: unknown.
    """

    def __init__(self, loads: Loads, options: TensionOptions) -> None:
        self.loads, self._options = loads, options
        self.firm: Bools | None = None
        self.in_use: Bools | None = None
        self.limits: Floats | None = None

    def low(self, jmm: JointMuscleMap, motors: MotorControl) -> Floats:
        """T_low (m,) [N]; see `TensionOptions.low`. 0 for muscles out of use."""
        low = self._options.low(motors, len(jmm.muscles), self.firm)
        return low if self.in_use is None else np.where(self.in_use, low, 0.0)

    def at(self, jmm: JointMuscleMap, motors: MotorControl, q: Floats) -> Distribution:
        """Tensions that hold a posture.

        Args:
            jmm: the joint-muscle mapping as learned so far.
            motors: gains and limit.
            q: joint angles (n,) [rad].
        """
        low, arms, torque = self.low(jmm, motors), jmm.jacobian(q), self.loads.gravity(q)
        if self.in_use is None:
            return distribute(arms, torque, low, motors.limit)
        arms[~self.in_use] = 0.0
        found = distribute(arms, torque, low, motors.limit, stops=self.stops(q))
        if found.lacking(motors) is None:
            return found
        least = np.where(self.in_use, motors.bias, 0.0)
        return distribute(arms, torque, low, motors.limit, least, self.stops(q))

    def stops(self, q: Floats) -> Floats:
        """1 for a joint at its upper stop, -1 at its lower one, else 0 (n,).

        Args:
            q: joint angles (n,) [rad].
        """
        if self.limits is None:
            return np.zeros(len(q))
        low, high = self.limits.T
        return np.where(q >= high, 1.0, 0.0) - (q <= low)

    def slope(self, jmm: JointMuscleMap, q: Floats, tensions: Floats) -> Floats:
        """How tensions that stay resist a change of posture (n, n) [N m/rad].

        It is sum_i T_i dG_i/dq - dtau/dq: the stiffness without motors, often negative.

        Args:
            jmm: the joint-muscle mapping.
            q: joint angles (n,) [rad].
            tensions: (m,) [N].
        """
        slope = jmm.torque_slope(q[None], tensions[None])[0] - load_slope(self.loads, q)
        return np.asarray(0.5 * (slope + slope.T))


def not_balanced(pulls: Sequence[Distribution], joints: Sequence[str], motors: MotorControl) -> str:
    """One sentence on postures that the muscles cannot hold by a map; empty if there are none.

    Args:
        pulls: tensions of each posture.
        joints: names of the n joints.
        motors: gains and limit.
    """
    for number, pull in enumerate(pulls):
        reason = pull.failure(motors, joints)
        if reason:
            which = "The posture" if len(pulls) == 1 else f"Posture {number} of {len(pulls)}"
            return f"{which} cannot be held by the map as learned: {reason}."
    return ""
