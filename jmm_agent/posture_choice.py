"""Postures that a robot goes to while muscles are out of use: the wanted ones, or the nearest.

`PostureChoice` checks the postures of a movement with the muscles that are left. One that they
cannot hold is replaced by the nearest that they can (`NearestPosture`), and a fault names the joint
that lacks torque. When a muscle is lost within a movement, the rest of it is checked while it goes
on, one step of the search in each control step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import POSTURE_NOT_HELD, Fault, MotorControl
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.muscles_in_use import MusclesInUse
from jmm_agent.nearest_posture import Held, NearestPosture, frame_offset, joint_offset
from jmm_agent.tension_distribution import TensionDistribution
from jmm_agent.types import Floats

RATE = 0.5
"""Speed at which the arm goes to another posture than it was sent to [ranges of a joint/s]."""


class Chosen(NamedTuple):
    """Postures of a movement, of which some may be replaced.

    Attributes:
        points: joint angles (K, n) [rad].
        duration: of the movement [s].
        fault: names the joint that cannot be held where it should; None if all can.
    """

    points: Floats
    duration: float
    fault: Fault | None = None


class _Movement(NamedTuple):
    """A movement whose postures are searched.

    Attributes:
        points: wanted joint angles (K, n) [rad].
        duration: [s].
        time: at which it was asked for [s].
        motors: gains and limit.
        wanted: the postures with their tensions, K.
        searches: for the posture nearest to each, K.
    """

    points: Floats
    duration: float
    time: float
    motors: MotorControl
    wanted: list[Held]
    searches: list[NearestPosture]


class PostureChoice:
    """Chooses postures that the muscles in use can hold.

    Args:
        kinematics: of the arm.
        distribution: of the tensions; None if the loads are unknown, and then nothing is replaced.
        in_use: which muscles are in use.

    Attributes:
        fault: what is wrong with the newest movement; None if nothing is.
    """

    def __init__(
        self,
        kinematics: ArmKinematics,
        distribution: TensionDistribution | None,
        in_use: MusclesInUse,
    ) -> None:
        self._kinematics, self._distribution, self._in_use = kinematics, distribution, in_use
        self._goal: str | None = None
        self._movement: _Movement | None = None
        self.fault: Fault | None = None
        self.in_use_changed()

    @property
    def sentence(self) -> str:
        """What is wrong with the newest movement; empty if nothing is."""
        if self.fault is None:
            return ""
        return f"{self.fault.detail[0].upper()}{self.fault.detail[1:]}."

    def in_use_changed(self) -> None:
        """Pass which muscles are in use to the distribution of the tensions."""
        if self._distribution is not None:
            self._distribution.in_use = None if self._in_use.all else self._in_use.mask
            self._distribution.limits = self._kinematics.limits

    def set_goal(self, goal: str | None) -> None:
        """Set what is to be near where a posture cannot be held.

        Args:
            goal: name of a frame; None: the joint angles.

        Raises:
            AgentError: there is no such frame.
        """
        if goal is not None and goal not in self._kinematics.frames:
            known = ", ".join(self._kinematics.frames)
            raise AgentError(f"Agent.go: there is no frame {goal!r}; frames are {known}.")
        self._goal = goal

    def choose(
        self,
        movement: Chosen,
        time: float,
        jmm: JointMuscleMap,
        motors: MotorControl | None,
    ) -> Chosen:
        """Postures of a new movement.

        Args:
            movement: as wanted.
            time: now [s].
            jmm: the joint-muscle mapping as learned so far.
            motors: gains and limit; None if unknown, and then nothing is replaced.
        """
        self.begin(movement, time, jmm, motors)
        while self._movement is not None:
            found = self.advance()
            movement = found or movement
        return movement

    def begin(
        self,
        movement: Chosen,
        time: float,
        jmm: JointMuscleMap,
        motors: MotorControl | None,
    ) -> None:
        """Check a movement, or what remains of it after muscles have left; see `advance`.

        Args:
            movement: as wanted.
            time: now [s].
            jmm: the joint-muscle mapping as learned so far.
            motors: gains and limit; None if unknown.
        """
        self._movement, self.fault, distribution = None, None, self._distribution
        if self._in_use.all or distribution is None or motors is None:
            return
        points, goal = movement.points, self._goal
        offsets = [
            joint_offset(q) if goal is None else frame_offset(q, self._kinematics, goal)
            for q in points
        ]
        searches = [
            NearestPosture(q, jmm, motors, distribution, offset)
            for q, offset in zip(points, offsets, strict=True)
        ]
        wanted = [search.best for search in searches]
        if not all(held.holds for held in wanted):
            self._movement = _Movement(points, movement.duration, time, motors, wanted, searches)

    def advance(self) -> Chosen | None:
        """Take one step of the search; the other movement after the last one, else None."""
        movement = self._movement
        if movement is None:
            return None
        for search in movement.searches:
            if not search.done:
                search.advance()
                return None
        self._movement = None
        found = np.array([search.best.posture for search in movement.searches])
        ranges = np.maximum(np.ptp(self._kinematics.limits, axis=1), 1e-9)
        far = float((np.abs(found - movement.points) / ranges).max())
        self.fault = self._fault(movement)
        return Chosen(found, max(movement.duration, far / RATE), self.fault)

    def _fault(self, movement: _Movement) -> Fault:
        """The joint that lacks torque, at the target or else at the first posture that lacks some.

        It says where the arm goes instead.
        """
        joints, motors = self._kinematics.joints, movement.motors
        missed = [number for number, held in enumerate(movement.wanted) if not held.holds]
        number = len(movement.wanted) - 1
        number = number if number in missed else missed[0]
        pull, best = movement.wanted[number].pull, movement.searches[number].best
        lacking = pull.lacking(motors)
        assert lacking is not None
        moved = np.degrees(best.posture - movement.points[number])
        most = int(np.abs(moved).argmax())
        where = (
            f"the arm goes to the nearest posture that can be held, {moved[most]:+.3g} deg away in "
            f"{joints[most]!r}"
            if best.holds
            else "no posture was found that can be held, and the arm goes where least is missing"
        )
        out = ", ".join((*self._in_use.left_out, *self._in_use.returning))
        torque = abs(float(pull.missing[lacking]))
        detail = f"without {out} joint {joints[lacking]!r} lacks {torque:.2g} N m; {where}"
        return Fault(POSTURE_NOT_HELD, joints[lacking], movement.time, detail)
