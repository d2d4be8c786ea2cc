"""Speed limit of a servo: its set point moves to a new command at a limited speed.

Many servos have a profile generator, such as "profile velocity" of Dynamixel or "goal speed" of bus
servos: after a new command the set point moves at a constant speed until it arrives. At a limit
above all speeds of a command the slope at zero hardly tells anything; the cause is screened at
several sizes.
"""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import clocks, drives, elements
from reality_gap.study.system import System, column
from reality_gap.types import Floats

SPEEDS = (4.0, 1.0, 0.4)
"""Limits at which the cause is screened in addition to a high one, over the typical speed."""
LOWEST = 0.05
"""Lowest limit over the typical speed."""


def _locations(system: System) -> tuple[Location, ...]:
    return drives.each_and_all(system, drives.is_servo)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    unit, speed = drives.typical_speed(system, location)
    values = elements.secants(system, location, tuple(1.0 / (x * speed) for x in SPEEDS))
    hints = SearchHints(secants=values or (1.0 / (SPEEDS[1] * speed),))
    sizes = (0.1 / speed, 0.002 / speed, 0.0, 1.0 / (LOWEST * speed))
    # A set point that needs a part of each period for its step is late by half of that part.
    late = 2.0 * clocks.least_delay(system) / _command_period(system)
    least = min(late, 1.0 / SPEEDS[0]) / speed
    return (Parameter("slowness", f"s/{unit}", *sizes, hints=hints, least=least),)


def _command_period(system: System) -> float:
    """Return the usual time between two commands of the study [s]."""
    found = [float(np.median(np.diff(e.time))) for e in system.study.episodes if len(e.time) > 1]
    return max(found, default=system.duration) or system.duration


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    if values["slowness"]:
        names = location.elements
        effects.commands.append(partial(_slow_commands, names, 1.0 / values["slowness"]))


def _slow_commands(
    names: tuple[str, ...], speed: float, model: mujoco.MjModel, time: Floats, command: Floats
) -> Floats:
    found = command.copy()
    for name in names:
        i = model.actuator(name).id
        per_command = model.actuator_gainprm[i, 0] / -model.actuator_biasprm[i, 1]
        most = speed * abs(float(model.actuator_gear[i, 0] / per_command)) * model.opt.timestep
        at = column(model, name)
        found[:, at] = followed(command[:, at], most)
    return found


def followed(wanted: Floats, most: float) -> Floats:
    """Follow a signal with steps of a limited size.

    Args:
        wanted: the signal, shape (k,).
        most: largest change from one sample to the next.

    Returns:
        The signal that follows, shape (k,); it begins at the first sample.
    """
    if np.abs(np.diff(wanted)).max(initial=0.0) <= most:
        return wanted
    found, here = [], float(wanted[0])
    for there in wanted.tolist():
        here = min(max(there, here - most), here + most)
        found.append(here)
    return np.array(found)


CAUSE = Cause(
    id="speed_limit",
    title="speed limit of a servo",
    explanation="The set point of a servo moves to a new command at a speed of at most 1/slowness.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
    fine=True,
)
