"""The object that the hand is to lift: its pose, its distance and what touches it."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot.body import pose_of
from kengoro_env.robot.subtree import subtree
from kengoro_env.types import Floats

BY_FINGERS, BY_PALM, BY_OTHERS = 1, 2, 4
"""Flags of what touches the object: fingers; palm or thumb; any other geom."""


class ObjectState(NamedTuple):
    """True state of the object at one time.

    Attributes:
        pose: pose in the world (4, 4), translation in [m].
        distance: distance of its centre from the grip point [m].
        touched: sum of the flags `BY_FINGERS`, `BY_PALM` and `BY_OTHERS` of what touches it.
    """

    pose: Floats
    distance: float
    touched: int


class TrackedObject:
    """Reads the state of the object from the simulation: a body with one geom.

    Args:
        model: model with the site "grip" and the bodies "hand" and "fingers_proximal".
        name: name of the object's body, and of its geom.
    """

    def __init__(self, model: mujoco.MjModel, name: str) -> None:
        self._body, self._geom = model.body(name).id, model.geom(name).id
        self._grip = model.site("grip").id
        self._toucher = np.full(model.ngeom + 1, BY_OTHERS)  # the last is for geom -1: not a geom
        self._toucher[_geoms(model, "hand")] = BY_PALM
        self._toucher[_geoms(model, "fingers_proximal")] = BY_FINGERS

    def observe(self, data: mujoco.MjData) -> ObjectState:
        """State of the object now."""
        position = data.xpos[self._body]
        pose = pose_of(position, data.xmat[self._body].reshape(3, 3))
        x, y, z = (position - data.site_xpos[self._grip]).tolist()
        return ObjectState(pose, sqrt(x * x + y * y + z * z), self._touched(data))

    def _touched(self, data: mujoco.MjData) -> int:
        touched, own, contacts = 0, self._geom, data.contact
        pairs = zip(contacts.geom.tolist(), contacts.exclude.tolist(), strict=True)
        for (first, second), excluded in pairs:
            if own in (first, second) and not excluded:
                touched |= int(self._toucher[second if first == own else first])
        return touched

    def layout(self) -> dict[str, Any]:
        """Values of the fields of ``Step`` in control_step.c; the array is never replaced."""
        return {"object": self._body, "object_geom": self._geom, "toucher": self._toucher}


def _geoms(model: mujoco.MjModel, root: str) -> NDArray[np.int64]:
    """Geoms of a body and of all its descendants."""
    return np.flatnonzero(subtree(model, model.body(root).id)[model.geom_bodyid])
