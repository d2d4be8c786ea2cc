"""Which actuators take commands: some of a model may have no input, as bristles have none."""

from __future__ import annotations

import mujoco
import numpy as np


def commanded(model: mujoco.MjModel) -> tuple[int, ...]:
    """The actuators that take a command, in the order of a command's columns; one column each."""
    return tuple(np.flatnonzero(model.actuator_ctrlnum).tolist())


def column(model: mujoco.MjModel, actuator: str) -> int:
    """The column of an actuator's command."""
    return int(model.actuator_ctrladr[model.actuator(actuator).id])
