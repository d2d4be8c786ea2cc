"""The departures that a user chose: by the seed of a robot, or as a list."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kengoro_env import departures as departures_package
from kengoro_env.departures.presets import actual
from kengoro_env.errors import ArgumentError, UnknownNameError
from kengoro_env.robot.draft import Departure


def chosen_departures(
    robot_seed: int | None, departures: Sequence[Departure] | None
) -> tuple[Departure, ...]:
    """Departures of a robot: the preset of a seed, a list, or none.

    Args:
        robot_seed: seed of an actual robot; None: no preset.
        departures: departures from the nominal model; None: none.

    Raises:
        ArgumentError: both are given, or one has the wrong type or sign.
        UnknownNameError: an entry of ``departures`` is not a departure.
    """
    if robot_seed is not None and departures is not None:
        raise ArgumentError("give either robot_seed or departures, not both")
    if robot_seed is not None:
        if isinstance(robot_seed, bool) or not isinstance(robot_seed, int | np.integer):
            raise ArgumentError(f"robot_seed must be a whole number or None, got {robot_seed!r}")
        if robot_seed < 0:
            raise ArgumentError(f"robot_seed must not be negative, got {robot_seed}")
        return actual(int(robot_seed))
    chosen = () if departures is None else departures
    if not isinstance(chosen, Sequence):
        raise ArgumentError(f"departures must be a tuple of departures, got {chosen!r}")
    for departure in chosen:
        if isinstance(departure, type) or not hasattr(departure, "edit"):
            kinds = [name for name in departures_package.__all__ if name[0].isupper()]
            raise UnknownNameError("departure", departure, kinds)
    return tuple(chosen)
