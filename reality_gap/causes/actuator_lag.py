"""An actuator whose force, or whose command, lags behind by a first order.

The lag of the command is MuJoCo's own, integrated exactly: ``filterexact``, with ``actearly`` so
that nothing is left of it without a time constant. The lag of the force, as of a motor's current,
also delays what the actuator feeds back; MuJoCo filters commands only, so that a hook corrects the
bias until the force is the filtered one.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from reality_gap.cause import Cause, Effects, Parameter, Place, Values
from reality_gap.causes import places
from reality_gap.causes.extra import Extra
from reality_gap.system import System

COMMAND = "of the command"

_NONE = mujoco.mjtDyn.mjDYN_NONE
_FILTERS = (mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)


def _places(system: System) -> tuple[Place, ...]:
    of_force = places.each_actuator(system, _is_plain) + places.all_actuators(system, _is_plain)
    of_command = places.each_actuator(system, _can_lag) + places.all_actuators(system, _can_lag)
    return of_force + tuple(Place(p.kind, p.elements, COMMAND) for p in of_command)


def _is_plain(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether its force is a fixed gain times the command plus a bias, without dynamics."""
    return int(model.actuator_dyntype[actuator]) == int(_NONE) and int(
        model.actuator_gaintype[actuator]
    ) == int(mujoco.mjtGain.mjGAIN_FIXED)


def _can_lag(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether it has no dynamics, or a filter that may be slower than the model says."""
    return int(model.actuator_dyntype[actuator]) in (int(_NONE), *map(int, _FILTERS))


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    return (Parameter("time_constant", "s", 0.01, 0.0003, 0.0, 0.5),)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    if place.note != COMMAND or not values["time_constant"]:
        return
    for name in place.elements:
        actuator = spec.actuator(name)
        if actuator.dyntype == _NONE:
            actuator.dyntype = mujoco.mjtDyn.mjDYN_FILTEREXACT
            actuator.dynprm[0] = 0.0
            actuator.actearly = True
        actuator.dynprm[0] += values["time_constant"]


def _attach(effects: Effects, system: System, place: Place, values: Values) -> None:
    if place.note != COMMAND and values["time_constant"]:
        effects.act(lambda model: _Lag(model, place.elements, values["time_constant"]))


class _Lag:
    """Filters the forces of actuators, from the first step on."""

    def __init__(self, model: mujoco.MjModel, names: tuple[str, ...], time_constant: float) -> None:
        self._actuators = np.array([model.actuator(name).id for name in names])
        self._bias = Extra(model.actuator_biasprm[:, 0], self._actuators)
        self._share = 1.0 - math.exp(-model.opt.timestep / time_constant)
        self._force: np.ndarray | None = None

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write the bias that makes the filtered force of what is wanted now."""
        at = self._actuators
        step = model.opt.timestep
        length = data.actuator_length[at] + step * data.actuator_velocity[at]
        self._bias.write(np.zeros(len(at)))
        prm = model.actuator_biasprm[at]
        wanted = model.actuator_gainprm[at, 0] * data.ctrl[at]
        affine = model.actuator_biastype[at] == int(mujoco.mjtBias.mjBIAS_AFFINE)
        wanted = wanted + affine * (
            prm[:, 0] + prm[:, 1] * length + prm[:, 2] * data.actuator_velocity[at]
        )
        limited = model.actuator_forcelimited[at] > 0
        low, high = model.actuator_forcerange[at].T
        wanted = np.where(limited, np.clip(wanted, low, high), wanted)
        if self._force is None:
            self._force = wanted
        self._force = self._force + self._share * (wanted - self._force)
        self._bias.write(self._force - wanted)


CAUSE = Cause(
    id="actuator_lag",
    title="lag of an actuator",
    explanation="An actuator follows its command with a first-order lag.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
)
