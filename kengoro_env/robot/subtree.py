"""Which bodies of a model move with a body."""

from __future__ import annotations

import mujoco
import numpy as np

from kengoro_env.types import Bools


def subtree(model: mujoco.MjModel, body: int) -> Bools:
    """Which bodies (nbody,) are a body or its descendants."""
    found = np.zeros(model.nbody, dtype=bool)
    found[body] = True
    for number in range(body + 1, model.nbody):  # a child's number is above its parent's
        found[number] = found[model.body_parentid[number]]
    return found
