"""Which departures a user asked for, by a robot's seed or one by one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kengoro_env import departures as departures_package
from kengoro_env.departures.presets import actual
from kengoro_env.errors import KengoroError
from kengoro_env.robot.draft import Departure, UnknownNameError


def chosen_departures(
    robot_seed: int | None, departures: Sequence[Departure] | None
) -> tuple[Departure, ...]:
    """What makes a robot depart from its drawing: a seed's preset, or a list, or nothing.

    Raises:
        KengoroError: both are given, or one is not what it should be.
    """
    if robot_seed is not None and departures is not None:
        raise KengoroError("give either robot_seed or departures, not both")
    if robot_seed is not None:
        if isinstance(robot_seed, bool) or not isinstance(robot_seed, int | np.integer):
            raise KengoroError(f"robot_seed must be a whole number or None, got {robot_seed!r}")
        if robot_seed < 0:
            raise KengoroError(f"robot_seed must not be negative, got {robot_seed}")
        return actual(int(robot_seed))
    chosen = () if departures is None else departures
    if not isinstance(chosen, Sequence):
        raise KengoroError(f"departures must be a tuple of departures, got {chosen!r}")
    for departure in chosen:
        if isinstance(departure, type) or not hasattr(departure, "edit"):
            kinds = [name for name in departures_package.__all__ if name[0].isupper()]
            raise UnknownNameError("departure", departure, kinds)
    return tuple(chosen)
