"""Lift monitor: decides whether the hand alone has lifted an object."""

from __future__ import annotations

from math import cos, radians

from kengoro_env.stepping.tracked_object import BY_FINGERS, BY_OTHERS, BY_PALM, ObjectState

LIFT_HEIGHT = 0.03
"""Height above its start that the object must reach [m]."""

LIFT_TIME = 1.0
"""Time for which it must stay there [s]."""

UPRIGHT = radians(30.0)
"""Largest tilt of the object's axis [rad]."""


class LiftMonitor:
    """Watches the object; call `update` once per control step.

    Args:
        state: state of the object where it stands.
        time: time now [s].

    Attributes:
        grasped: whether fingers and thumb, or fingers and palm, hold the object now.
        rise: height above its start [m].
        held: time for which it has been up, upright and touched by the hand only [s].
        lifted: whether ``held`` has reached `LIFT_TIME` since the reset.
    """

    def __init__(self, state: ObjectState, time: float) -> None:
        self.reset(state, time)

    def reset(self, state: ObjectState, time: float) -> None:
        """Start again with the object at its present place."""
        self._height = float(state.pose[2, 3])
        self._up_since = time
        self.grasped = self.lifted = False
        self.rise = self.held = 0.0

    def update(self, state: ObjectState, time: float) -> None:
        """Take in the state of the object at ``time`` [s]."""
        _, _, upright, height = state.pose[2].tolist()
        by_hand = 0 < state.touched < BY_OTHERS
        self.grasped = state.touched & (BY_FINGERS | BY_PALM) == BY_FINGERS | BY_PALM
        self.rise = height - self._height
        if not (by_hand and upright > cos(UPRIGHT) and self.rise >= LIFT_HEIGHT):
            self._up_since = time
        self.held = time - self._up_since
        self.lifted = self.lifted or self.held >= LIFT_TIME
