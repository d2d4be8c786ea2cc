"""Drives: lag and delay of motors, and errors of their force.

Parameters and amplitudes:

* actuator_lag: ``time_constant`` [s], the sum of the lags in `POLES`.
* delay: ``delay`` [s] of the commands of tendons, or of sensor readings (``of_sensor`` 1).
* force_scale: the motor's tension is (1 + ``excess``) times that of the motor law [1].
* force_offset: the motor's tension is ``force`` [N] more than that of the motor law.
"""

from __future__ import annotations

from functools import partial
from math import exp, isnan

from hidden_plants.machine import Machine
from hidden_plants.mechanisms.mechanism import (
    BOTH_SIGNS,
    Mechanism,
    Structure,
    each_tendon,
    scaled,
    signed,
)
from hidden_plants.robot import Robot, State
from hidden_plants.secret import Effect

POLES = (0.45, 0.45, 0.10)
"""Shares of a motor's time constant: rotor and gear, gear and spool, current loop."""


class Lag:
    """Three first-order lags in series, each integrated in closed form over a step."""

    def __init__(self, tendon: int, time_constant: float, step: float) -> None:
        self.tendon = tendon
        self.keep = [exp(-step / (share * time_constant)) for share in POLES]
        self.levels = [float("nan")] * len(POLES)

    def __call__(self, state: State) -> None:
        """Filter the motor's tension."""
        value = float(state.motor[self.tendon])
        if isnan(self.levels[0]):
            self.levels = [value] * len(POLES)
        for i, keep in enumerate(self.keep):
            value += keep * (self.levels[i] - value)
            self.levels[i] = value
        state.motor[self.tendon] = value


def _tune_lag(robot: Robot, effect: Effect) -> None:
    time_constant = effect.parameters["time_constant"]
    for name in effect.elements:
        robot.motor_devices.append(partial(Lag, robot.tendon(name), time_constant, robot.step))


def _delays(machine: Machine) -> list[Structure]:
    tendons = machine.tendons
    choices = [
        (tendons, 0.0),
        (tuple(f"length_{tendon}" for tendon in tendons), 1.0),
        (tuple(f"tension_{tendon}" for tendon in tendons), 1.0),
        (("marker_position", "marker_orientation"), 1.0),
    ]
    return [Structure("delay", elements, {"of_sensor": kind}) for elements, kind in choices]


def _tune_delay(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        if effect.parameters["of_sensor"]:
            delay = robot.sensor_delay.get(name, 0.0) + effect.parameters["delay"]
            robot.sensor_delay[name] = delay
        else:
            robot.command_delay[robot.tendon(name)] += effect.parameters["delay"]


def _tune_force_scale(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.gain[robot.tendon(name)] *= 1.0 + effect.parameters["excess"]


def _tune_force_offset(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.force_offset[robot.tendon(name)] += effect.parameters["force"]


MECHANISMS = (
    Mechanism(
        id="actuator_lag",
        unit="s",
        typical=4e-3,
        bound=0.03,
        structures=each_tendon("actuator_lag"),
        parameters=scaled("time_constant"),
        tune=_tune_lag,
    ),
    Mechanism(
        id="delay",
        unit="s",
        typical=5e-3,
        bound=0.2,
        structures=_delays,
        parameters=scaled("delay"),
        tune=_tune_delay,
    ),
    Mechanism(
        id="force_scale",
        unit="1",
        typical=0.03,
        bound=0.4,
        structures=each_tendon("force_scale", BOTH_SIGNS),
        parameters=signed("excess"),
        tune=_tune_force_scale,
    ),
    Mechanism(
        id="force_offset",
        unit="N",
        typical=3.0,
        bound=25.0,
        structures=each_tendon("force_offset", BOTH_SIGNS),
        parameters=signed("force"),
        tune=_tune_force_offset,
    ),
)
