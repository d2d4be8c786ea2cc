"""Stiffness of the muscles that an agent commands, and how it changes while the arm holds still.

A command is shorter than the map's length by (T - T_bias) / K. When K changes, command and K go
together: 1 / K changes at a constant rate, and so does the command, no faster than commands follow
a changed map.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MotorControl
from jmm_agent.joint_stiffness import PostureStiffness, Stiffness, is_stable
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.tension_distribution import TensionDistribution
from jmm_agent.types import Bools, Floats

LIMITS = 0.05, 2.0
"""Lowest and highest K_stiff, as a share of what the motors were made with [1]."""
ARM = 0.05
"""Least moment arm of a muscle that stiffens a joint, as a share of the largest one there [1]."""
PULLS = 1e-3
"""A muscle resists both ways if its tension is above T_bias by this share of it [1]."""
SHORTEST = 0.2
"""Shortest duration of a change [s]."""


class MuscleStiffness:
    """K_stiff of all muscles, now and soon.

    Args:
        muscles: number of muscles, m.
        rate: largest speed of commands while it changes [m/s].

    Attributes:
        motors: gains now, and limit; None if unknown.
    """

    def __init__(self, muscles: int, rate: float) -> None:
        self._muscles, self._rate = muscles, rate
        self.motors: MotorControl | None = None
        self._begin = self._goal = np.empty(0)
        self._left = self._duration = 0.0

    @property
    def commanded(self) -> Floats | None:
        """K_stiff that the motors must have now (m,) [N/m]; None if it was never set."""
        return None if self.motors is None else self.motors.each

    def known(self) -> MotorControl:
        """Gains and limit of the motors; an `AgentError` if they are unknown."""
        if self.motors is None:
            raise AgentError(
                "Agent: the motors' gains are unknown, so that their stiffness cannot be set; "
                "assign a MotorControl to Agent.motors."
            )
        return self.motors

    def present(self) -> Floats:
        """K_stiff (m,) [N/m]."""
        gains = np.asarray(self.known().gains, dtype=float)
        return np.broadcast_to(gains, (self._muscles,)).copy()

    def change(
        self,
        value: ArrayLike | Mapping[str, float],
        limits: tuple[float, float] | None,
        jmm: JointMuscleMap,
        target: Floats,
        distribution: TensionDistribution | None,
        tensions: Floats | None,
    ) -> Stiffness:
        """Begin to change to what is asked for; see `Agent.set_stiffness`.

        Args:
            value: of muscles [N/m] or of joints by name [N m/rad].
            limits: lowest and highest K_stiff [N/m]; None: by the motors.
            jmm: the joint-muscle mapping.
            target: joint angles (n,) [rad] at which joints are to have their stiffness.
            distribution: tensions of postures; None if loads are unknown.
            tensions: with which muscles pull now (m,) [N]; None without a feed-forward.
        """
        motors = self.known()
        among, present = checked_limits(limits, motors), self.present()
        if distribution is None:
            found = chosen_stiffness(value, among, jmm, present, None)
            self.begin(found.muscles, tensions)
            return found

        def posture(muscles: Floats) -> PostureStiffness:
            return posture_stiffness(distribution, jmm, replace(motors, each=muscles), target)

        before, distribution.firm = distribution.firm, firm_muscles(value, jmm, target)
        try:
            found = chosen_stiffness(value, among, jmm, present, posture)
        except AgentError:
            distribution.firm = before
            raise
        self.begin(found.muscles, tensions)
        return found

    def begin(self, goal: Floats, tensions: Floats | None) -> None:
        """Begin to change.

        Args:
            goal: K_stiff (m,) [N/m].
            tensions: at the target (m,) [N]; None if commands have no feed-forward.
        """
        motors = self.known()
        self._begin, self._goal = self.present(), goal
        extra = motors.bias if tensions is None else np.abs(tensions - motors.bias)
        change = np.abs(extra * (1.0 / goal - 1.0 / self._begin))
        self._duration = self._left = max(SHORTEST, float(change.max()) / self._rate)
        self.motors = replace(motors, each=self._begin)

    def advance(self, passed: float) -> bool:
        """Go on by a control step; returns whether K_stiff has changed.

        Args:
            passed: time since the step before [s].
        """
        if self._left <= 0.0:
            return False
        self._left = max(0.0, self._left - passed)
        share = self._left / self._duration
        compliance = share / self._begin + (1.0 - share) / self._goal
        now = 1.0 / compliance if self._left > 0.0 else self._goal.copy()
        self.motors = replace(self.known(), each=now)
        return True

    def finish(self) -> bool:
        """End a change at once, as between episodes; returns whether there was one."""
        return self.advance(np.inf)


def checked_limits(limits: tuple[float, float] | None, motors: MotorControl) -> Floats:
    """Lowest and highest K_stiff (2,) [N/m]: as given, or by the motors.

    Raises:
        AgentError: they are not two positive finite numbers in order.
    """
    given = np.array(LIMITS) * motors.stiffness if limits is None else np.asarray(limits, float)
    if given.shape != (2,) or not 0.0 < given[0] <= given[1] < np.inf:
        raise AgentError(
            f"Agent.set_stiffness: limits are {limits}, but must be the lowest and the highest "
            "stiffness of a muscle, positive [N/m]."
        )
    return given


def checked_muscles(value: ArrayLike, muscles: int, limits: Floats) -> Floats:
    """K_stiff (m,) [N/m] that was asked for: one number, or one for each muscle.

    Raises:
        AgentError: another shape, or a number beyond the limits.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = np.array(np.nan)
    low, high = limits
    if array.shape not in ((), (muscles,)) or not np.all((array >= low) & (array <= high)):
        raise AgentError(
            f"Agent.set_stiffness: a muscle's stiffness must be from {low:.6g} to {high:.6g} N/m, "
            f"one number or {muscles}, got {value!r}."
        )
    return np.broadcast_to(array, (muscles,)).copy()


def checked_joints(wanted: Mapping[str, float], joints: Sequence[str]) -> dict[int, float]:
    """Wanted stiffness by the number of the joint [N m/rad].

    Raises:
        AgentError: an unknown joint, a number that is not positive and finite, or no joint.
    """
    if not wanted:
        raise AgentError("Agent.set_stiffness: no joint was named; {joint: N m/rad} is needed.")
    for joint, value in wanted.items():
        if joint not in joints:
            raise AgentError(
                f"Agent.set_stiffness: there is no joint {joint!r}; joints are {', '.join(joints)}."
            )
        if not isinstance(value, int | float | np.number) or not 0.0 < value < np.inf:
            raise AgentError(
                f"Agent.set_stiffness: the stiffness of joint {joint!r} is {value!r}, but must be "
                "positive and finite [N m/rad]."
            )
    return {list(joints).index(joint): float(value) for joint, value in wanted.items()}


def firm_muscles(
    value: ArrayLike | Mapping[str, float], jmm: JointMuscleMap, q: Floats
) -> Bools | None:
    """Muscles that stiffen the joints that are asked for (m,); None if muscles were asked for.

    Args:
        value: as in `Agent.set_stiffness`.
        jmm: the joint-muscle mapping.
        q: joint angles (n,) [rad].
    """
    if not isinstance(value, Mapping):
        return None
    arms = np.abs(jmm.jacobian(q)[:, [joint in value for joint in jmm.joints]])
    return np.asarray((arms > ARM * arms.max(initial=0.0)).any(axis=1))


def posture_stiffness(
    distribution: TensionDistribution, jmm: JointMuscleMap, motors: MotorControl, q: Floats
) -> PostureStiffness:
    """What the stiffness of a posture consists of.

    Args:
        distribution: tensions of postures.
        jmm: the joint-muscle mapping as learned so far.
        motors: gains and limit.
        q: joint angles (n,) [rad].
    """
    tensions, arms = distribution.at(jmm, motors, q).tensions, jmm.jacobian(q)
    pulls = tensions > (1.0 + PULLS) * motors.bias
    rest = distribution.slope(jmm, q, tensions)
    return PostureStiffness(arms * pulls[:, None], rest, -jmm.tension_jacobian(tensions))


def chosen_stiffness(
    value: ArrayLike | Mapping[str, float],
    limits: Floats,
    jmm: JointMuscleMap,
    present: Floats,
    posture: Callable[[Floats], PostureStiffness] | None,
) -> Stiffness:
    """Muscles for what was asked for, and the joints that follow.

    Args:
        value: K_stiff of all muscles or of each (m,) [N/m], or wanted joints [N m/rad] by name.
        limits: lowest and highest K_stiff (2,) [N/m].
        jmm: the joint-muscle mapping.
        present: K_stiff (m,) [N/m].
        posture: what the target posture's stiffness consists of, at K_stiff (m,); None if loads are
            unknown.

    Raises:
        AgentError: the value is not valid, or joints are asked for and loads are unknown.
    """
    wanted: dict[str, float] = {}
    if isinstance(value, Mapping):
        numbered = checked_joints(value, jmm.joints)
        if posture is None:
            raise AgentError(
                "Agent.set_stiffness: the stiffness of joints needs the loads of the nominal "
                "model, which this agent does not know; give that of the muscles."
            )
        muscles = posture(present).muscles_for(numbered, present, limits)
        # Tensions follow the stiffness a little, and so does what they stiffen.
        muscles = posture(muscles).muscles_for(numbered, present, limits)
        wanted = {joint: float(asked) for joint, asked in value.items()}
    else:
        muscles = checked_muscles(value, len(jmm.muscles), limits)
    if posture is None:
        return Stiffness(muscles, {}, wanted, None)
    found = posture(muscles)
    joints = dict(zip(jmm.joints, found.joints(muscles).tolist(), strict=True))
    return Stiffness(muscles, joints, wanted, is_stable(found.matrix(muscles)))
