"""Control steps: a robot carries out an action, and tells what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from kengoro_env.robot.robot import Robot
from kengoro_env.spaces import LengthBounds, checked_action
from kengoro_env.stepping.lift_monitor import Sight, TrackedObject
from kengoro_env.stepping.observation import Observation, felt, known, mean
from kengoro_env.types import Floats

Told = tuple[Observation, dict[str, Any], float, float, Sight | None]
"""Lengths and tensions that are observed; the truth; the mean square error of the joint angles
[rad^2], 0 without a goal; the wires' mean tension [N]; what is true of the thing to be lifted."""


class Control:
    """Control steps of a robot.

    Args:
        robot: acts.
        bounds: of the wires' lengths, for actions and observations.
        entries: names of the entries of an action.
        thing: that the hand is to lift, a body's name; None for nothing.
    """

    def __init__(
        self, robot: Robot, bounds: LengthBounds, entries: Sequence[str], thing: str | None
    ) -> None:
        self._robot, self._bounds, self._entries = robot, bounds, entries
        self._thing = None if thing is None else TrackedObject(robot.model, thing)

    def step(self, action: object, goal: Floats | None) -> Told:
        """Carry out ``action`` (k,) for a control period.

        Args:
            action: an entry a wire, then one for the fingers where there are fingers.
            goal: joint angles to reach (n,) [rad]; None: there are none.

        Raises:
            InvalidActionError: it is none, and nothing has moved.
            DivergedError: the simulation is no longer finite.
        """
        robot, muscles = self._robot, len(self._robot.muscles)
        checked = checked_action(action, self._entries)
        robot.close_fingers(float(checked[-1]) if len(checked) > muscles else -1.0)
        robot.step(self._bounds.to_lengths(checked[:muscles]))
        return self.tell(goal)

    def tell(self, goal: Floats | None) -> Told:
        """What is so now, with ``goal`` as in `step`."""
        robot = self._robot
        now = robot.measure()
        error = 0.0
        if goal is not None:
            off = now.joint_angles - goal
            error = float(mean(off * off))
        truth = known(robot, now)
        truth["time"] = robot.time
        sight = None if self._thing is None else self._thing.look(robot.data)
        return felt(robot, now, self._bounds), truth, error, float(mean(now.tensions)), sight
