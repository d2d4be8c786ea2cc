"""Actuator lag: the force or the command of an actuator passes a first-order low-pass filter.

A lag of the command is MuJoCo's ``filterexact`` with ``actearly``, so that it vanishes with the
time constant. A lag of the force, such as that of a motor's current, also delays the feedback of
the actuator, and is a hook.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import elements
from reality_gap.causes.support.force_lag import ForceLag
from reality_gap.study.system import System

COMMAND = "of the command"
SECANTS = (0.04,)
"""Time constants at which the cause is screened in addition to a small one [s]."""

_NONE = mujoco.mjtDyn.mjDYN_NONE
_FILTERS = (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)


def _locations(system: System) -> tuple[Location, ...]:
    of_force = elements.each_actuator(system, _is_plain) + elements.all_actuators(system, _is_plain)
    of_command = elements.each_actuator(system, _can_lag) + elements.all_actuators(system, _can_lag)
    return of_force + tuple(Location(p.kind, p.elements, COMMAND) for p in of_command)


def _is_plain(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator has a fixed gain and no dynamics."""
    return int(model.actuator_dyntype[actuator]) == int(_NONE) and int(
        model.actuator_gaintype[actuator]
    ) == int(mujoco.mjtGain.mjGAIN_FIXED)


def _can_lag(model: mujoco.MjModel, actuator: int) -> bool:
    """Return whether an actuator has no dynamics, or a filter that could be slower."""
    return int(model.actuator_dyntype[actuator]) in (int(_NONE), *map(int, _FILTERS))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    least = float(system.model.opt.timestep)  # which does not resolve a faster filter
    low = min(0.0, least - _modelled(system, location))
    sizes = SECANTS if low == 0.0 else (*SECANTS, low / 2)
    hints = SearchHints(secants=elements.secants(system, location, sizes), absence=low < 0.0)
    return (Parameter("time_constant", "s", 0.004, 0.0001, low, 0.5, hints=hints, least=least),)


def _modelled(system: System, location: Location) -> float:
    """Return the least time constant of the filters that the model has at a location [s]."""
    if location.note != COMMAND:
        return 0.0
    model = system.model
    dynamics = [
        (model.actuator(name).dyntype[0], model.actuator(name).dynprm[0])
        for name in location.elements
    ]
    return min(float(tau) if int(kind) in map(int, _FILTERS) else 0.0 for kind, tau in dynamics)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if location.note != COMMAND or not values["time_constant"]:
        return
    for name in location.elements:
        actuator = spec.actuator(name)
        if actuator.dyntype == _NONE:
            actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            actuator.dynprm[0] = 0.0
            actuator.actearly = True
        actuator.dynprm[0] += values["time_constant"]


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    if location.note != COMMAND and values["time_constant"]:
        effects.add_hook(lambda model: ForceLag(model, location.elements, values["time_constant"]))


CAUSE = Cause(
    id="actuator_lag",
    title="lag of an actuator",
    explanation="An actuator follows its command with a first-order lag, or with a shorter one "
    "than that of the model.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
