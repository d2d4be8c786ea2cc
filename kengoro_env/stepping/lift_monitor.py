"""Whether a thing was lifted: physically, by nothing but the hand's contact."""

from __future__ import annotations

from math import cos, radians, sqrt
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot.body import pose_of

LIFT_HEIGHT = 0.03
"""How far the thing must rise [m]."""

LIFT_TIME = 1.0
"""How long it must stay up [s]."""

UPRIGHT = radians(30.0)
"""How far it may lean [rad]."""

BY_FINGERS, BY_PALM, BY_OTHERS = 1, 2, 4
"""Who touches it: fingers; palm or thumb; anything else. A sum of those that do."""


class Sight(NamedTuple):
    """What is true of the thing at one time.

    Attributes:
        pose: in the world (4, 4).
        distance: of its centre from the grip point [m].
        touched: by whom, a sum of `BY_FINGERS`, `BY_PALM` and `BY_OTHERS`.
    """

    pose: NDArray[np.float64]
    distance: float
    touched: int


class TrackedObject:
    """A thing that the hand is to lift: a body with one geom.

    Args:
        model: with the site "grip" and the bodies "hand" and "fingers_proximal" of the robot.
        name: of both, the body and the geom.
    """

    def __init__(self, model: mujoco.MjModel, name: str) -> None:
        self._body, self._geom = model.body(name).id, model.geom(name).id
        self._grip = model.site("grip").id
        self._who = np.full(model.ngeom + 1, BY_OTHERS)  # the last for what is no geom, which is -1
        self._who[_geoms(model, "hand")] = BY_PALM
        self._who[_geoms(model, "fingers_proximal")] = BY_FINGERS

    def look(self, data: mujoco.MjData) -> Sight:
        """What is true of it now."""
        place = data.xpos[self._body]
        pose = pose_of(place, data.xmat[self._body].reshape(3, 3))
        x, y, z = (place - data.site_xpos[self._grip]).tolist()
        return Sight(pose, sqrt(x * x + y * y + z * z), self._touched(data))

    def _touched(self, data: mujoco.MjData) -> int:
        touched, thing, contacts = 0, self._geom, data.contact
        pairs = zip(contacts.geom.tolist(), contacts.exclude.tolist(), strict=True)
        for (first, second), excluded in pairs:
            if thing in (first, second) and not excluded:
                touched |= int(self._who[second if first == thing else first])
        return touched

    def layout(self) -> dict[str, Any]:
        """Numbers, and an array that is never replaced, by their names in control_step.c."""
        return {"thing": self._body, "thing_geom": self._geom, "who": self._who}


class LiftMonitor:
    """Watches the thing; `update` it once per control step.

    Args:
        sight: of the thing where it stands.
        time: now [s].

    Attributes:
        grasped: fingers and thumb (or palm) hold it between them now.
        rise: how far it is above where it stood [m].
        held: for how long it has been up, upright and touched by the hand only [s].
        lifted: it has been so for `LIFT_TIME` at least once since the reset.
    """

    def __init__(self, sight: Sight, time: float) -> None:
        self.reset(sight, time)

    def reset(self, sight: Sight, time: float) -> None:
        """Start anew: it stands where it is now."""
        self._height = float(sight.pose[2, 3])
        self._up_since = time
        self.grasped = self.lifted = False
        self.rise = self.held = 0.0

    def update(self, sight: Sight, time: float) -> None:
        """Judge what is true of it now, at a time [s]."""
        _, _, upright, height = sight.pose[2].tolist()
        by_hand = 0 < sight.touched < BY_OTHERS
        self.grasped = sight.touched & (BY_FINGERS | BY_PALM) == BY_FINGERS | BY_PALM
        self.rise = height - self._height
        if not (by_hand and upright > cos(UPRIGHT) and self.rise >= LIFT_HEIGHT):
            self._up_since = time
        self.held = time - self._up_since
        self.lifted = self.lifted or self.held >= LIFT_TIME


def _geoms(model: mujoco.MjModel, root: str) -> list[int]:
    """Geoms of a body and of all bodies that hang on it."""
    bodies = {model.body(root).id}
    for body in range(min(bodies) + 1, model.nbody):  # a child's number is larger than its parent's
        if model.body_parentid[body] in bodies:
            bodies.add(body)
    return [g for g in range(model.ngeom) if model.geom_bodyid[g] in bodies]
