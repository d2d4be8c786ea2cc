"""Velocity feed-forward: a servo damps the difference of its velocity to that of its set point.

The servo of a model exerts ``kp (u - q) - kd q'``, and lags behind a moving command ``u`` by
``kd/kp``. Most industrial drives and many controllers of robots exert ``kp (u - q) + kd (share u' -
q')``. The velocity ``u'`` is the last change of the command over the usual time between two.
"""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import clocks, drives, elements
from reality_gap.study.system import System, column
from reality_gap.types import Floats

WHOLE = (1.0,)
"""Share at which the cause is screened in addition to a small one: most drives have all or none."""


def _locations(system: System) -> tuple[Location, ...]:
    return drives.each_and_all(system, drives.is_damped)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    hints = SearchHints(secants=elements.secants(system, location, WHOLE))
    model = system.model
    lags = [_lag(model, model.actuator(name).id) for name in location.elements]
    # A feed-forward that shifts the command by less than its clock is known cannot be named.
    least = clocks.least_delay(system) / max(lags)
    return (Parameter("share", "1", 0.1, 0.0, 0.0, 3.0, hints=hints, least=least),)


def _lag(model: mujoco.MjModel, actuator: int) -> float:
    """Return the time by which a servo lags behind a moving command [s]."""
    kp, kd = model.actuator_biasprm[actuator, 1:3]
    return abs(float(kd / kp))


def _update_period(system: System) -> float:
    """Return the usual time between two changes of the commands [s]; 0 if there are none."""
    periods = []
    for episode in system.study.episodes:
        changes = np.flatnonzero(np.any(np.diff(episode.command, axis=0) != 0.0, axis=1))
        periods += np.diff(episode.time[changes + 1]).tolist()
    return float(np.median(periods)) if periods else 0.0


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    if values["share"] and (period := _update_period(system)) > 0.0:
        effects.commands.append(partial(_lead, location.elements, values["share"], period))


def _lead(
    names: tuple[str, ...],
    share: float,
    period: float,
    model: mujoco.MjModel,
    time: Floats,
    command: Floats,
) -> Floats:
    """Return commands (k, nu) that are ahead by what the velocity of the set points does."""
    found, period = command.copy(), max(period, float(model.opt.timestep))
    for name in names:
        at, lag = column(model, name), _lag(model, model.actuator(name).id)
        before = np.interp(time - period, time, command[:, at])
        found[:, at] += share * lag * (command[:, at] - before) / period
    return found


CAUSE = Cause(
    id="velocity_feedforward",
    title="velocity feed-forward",
    explanation="A servo damps the difference of its velocity to that of its set point, and does "
    "not lag behind a moving command.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
