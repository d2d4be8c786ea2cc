"""Checks of numbers that users give: options of a reset, target lengths."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kengoro_env.arguments import real_numbers
from kengoro_env.errors import ArgumentError, UnknownNameError
from kengoro_env.robot.robot import Robot
from kengoro_env.types import Floats


def checked_options(
    options: Mapping[str, Any], sizes: Mapping[str, int | None], robot: Robot
) -> dict[str, Floats]:
    """Options of a reset as arrays of float64.

    Args:
        options: values by name.
        sizes: lengths of the valid options; None: joint angles (n,) [rad].
        robot: the robot, whose joint limits hold for joint angles.

    Raises:
        UnknownNameError: an option does not exist.
        ArgumentError: a value has another length, is not finite, or leaves the joint limits.
    """
    checked = {}
    for name, value in options.items():
        if name not in sizes:
            raise UnknownNameError("option", name, sizes)
        size = sizes[name]
        checked[name] = array = finite(f"the option {name!r}", value, size or len(robot.joints))
        if size is not None:
            continue
        beyond = np.flatnonzero((array < robot.lower) | (array > robot.upper))
        if len(beyond):
            i = beyond[0]
            raise ArgumentError(
                f"the option {name!r} puts {robot.joints[i]} at {array[i]:.3f} rad: it must be "
                f"within {robot.lower[i]:.3f} and {robot.upper[i]:.3f}"
            )
    return checked


def finite(name: str, value: object, size: int) -> Floats:
    """A value as an array of ``size`` finite numbers.

    Args:
        name: name of the value in the error message.
        value: the value.
        size: number of entries.

    Raises:
        ArgumentError: the value has another shape, or an entry is not a finite number.
    """
    array = real_numbers(value)
    if array is None or array.shape != (size,) or not np.all(np.isfinite(array)):
        numbers = "1 finite number in a list" if size == 1 else f"{size} finite numbers"
        raise ArgumentError(f"{name} must be {numbers}, got {value!r}")
    return array
