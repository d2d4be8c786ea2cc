"""Whether the can was lifted: physically, by nothing but the hand's contact."""

from __future__ import annotations

from math import cos, radians

import mujoco

LIFT_HEIGHT = 0.03
"""How far the can must rise [m]."""

LIFT_TIME = 1.0
"""How long it must stay up [s]."""

UPRIGHT = radians(30.0)
"""How far the can may lean [rad]."""


class LiftMonitor:
    """Watches the can; `update` it once per control step.

    Attributes:
        grasped: fingers and thumb (or palm) hold the can between them now.
        rise: how far the can is above where it stood [m].
        held: for how long it has been up, upright and touched by the hand only [s].
        lifted: it has been so for `LIFT_TIME` at least once since the reset.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._can = model.body("can").id
        self._can_geom = model.geom("can").id
        self._hand = _geoms(model, model.body("hand").id)
        self._fingers = _geoms(model, model.body("fingers_proximal").id)
        self._palm_and_thumb = self._hand - self._fingers
        self.reset(data)

    def reset(self, data: mujoco.MjData) -> None:
        """Start anew: the can stands where it is now."""
        self._height = float(data.xpos[self._can][2])
        self._time = self._up_since = float(data.time)
        self.grasped = self.lifted = False
        self.rise = self.held = 0.0

    def update(self, data: mujoco.MjData) -> None:
        """Look at the can's pose and at what touches it now."""
        touching = self._touching(data)
        by_hand = bool(touching) and touching <= self._hand
        self.grasped = not (
            touching.isdisjoint(self._fingers) or touching.isdisjoint(self._palm_and_thumb)
        )
        self.rise = float(data.xpos[self._can][2]) - self._height
        upright = data.xmat[self._can][8] > cos(UPRIGHT)
        if not (by_hand and upright and self.rise >= LIFT_HEIGHT):
            self._up_since = float(data.time)
        self.held = float(data.time) - self._up_since
        self.lifted = self.lifted or self.held >= LIFT_TIME

    def _touching(self, data: mujoco.MjData) -> set[int]:
        """Geoms that touch the can."""
        if data.ncon == 0:
            return set()
        contacts, can = data.contact, self._can_geom
        pairs = zip(contacts.geom.tolist(), contacts.exclude.tolist(), strict=True)
        return {
            second if first == can else first
            for (first, second), excluded in pairs
            if not excluded and can in (first, second)
        }


def _geoms(model: mujoco.MjModel, root: int) -> frozenset[int]:
    """Geoms of a body and of all bodies that hang on it."""
    bodies = {root}
    for body in range(root + 1, model.nbody):  # a child's number is larger than its parent's
        if model.body_parentid[body] in bodies:
            bodies.add(body)
    return frozenset(g for g in range(model.ngeom) if model.geom_bodyid[g] in bodies)
