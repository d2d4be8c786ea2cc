"""Control period: time between two commands, and the physics steps within it."""

from __future__ import annotations

from math import ceil

import mujoco
import numpy as np

from kengoro_env.errors import ArgumentError

CONTROL_PERIOD = 0.02
"""Time between commands [s], if none is given."""
SHORTEST, LONGEST = 0.001, 0.1
"""Limits of the time between commands [s]."""


def set_time_step(spec: mujoco.MjSpec, control_period: float) -> int:
    """Number of physics steps in a control period; shortens the time step that does not divide it.

    Args:
        spec: whose time step [s] is set.
        control_period: time between commands [s].

    Raises:
        ArgumentError: the period is out of range.
    """
    if not (
        isinstance(control_period, int | float | np.number)
        and SHORTEST <= control_period <= LONGEST
    ):
        raise ArgumentError(
            f"control_period is {control_period!r}, but must be from {SHORTEST} to {LONGEST} s"
        )
    control_period = float(control_period)
    ratio = control_period / spec.option.timestep
    substeps = max(1, round(ratio))
    if not np.isclose(substeps, ratio):
        substeps = ceil(ratio)
        spec.option.timestep = control_period / substeps
    return substeps
