"""Tendons and their gears: elasticity, permanent elongation, backlash and slack.

Parameters and amplitudes:

* tendon_elasticity: ``compliance`` [m/N], ``stiffness`` [N/m] (secant at 150 N).
* wire_elongation: ``length`` [m] more after ``start`` [s of log time], reached over ``duration``
  [s]; 0 for a sudden elongation.
* backlash: ``play`` [m], the whole width.
* slack: ``slack`` [m] at zero tension.
"""

from __future__ import annotations

from functools import partial
from math import exp, isnan

from hidden_plants.machine import BIAS, CUT, STIFFNESS, Machine
from hidden_plants.mechanisms.mechanism import (
    Mechanism,
    Shape,
    Structure,
    each_tendon,
    scaled,
    shapes_of,
)
from hidden_plants.robot import Device, Robot, State
from hidden_plants.secret import Effect

SPOOL_MASS = 0.01
"""Inertia of a motor and its spool, reflected to the tendon [kg]."""
TENDON_LOSS = 60.0
"""Internal damping of an elastic tendon [N s/m]."""
TENSION_OF_STIFFNESS = 150.0
"""Tension at which the secant stiffness of a tendon is stated [N]."""
TOE_TENSION = 60.0
"""Tension at which the slack falls to 1/e [N]."""
TOE_TIME = 0.002
"""Time constant of the slack [s]."""


class Spool:
    """A motor's spool behind an elastic tendon; the encoder reads the spool.

    The tendon only pulls, and it hardens: T(x) = k (0.75 x + 0.25 x^2 / x_r), where x_r is the
    stretch at 150 N and k the secant stiffness there. The spool's equation of motion is stiff, so
    it is integrated by backward Euler steps, each of which is the root of a quadratic equation.
    """

    def __init__(self, tendon: int, stiffness: float) -> None:
        self.tendon, self.slope = tendon, 0.75 * stiffness
        self.curve = 0.25 * stiffness * stiffness / TENSION_OF_STIFFNESS
        self.free, self.position, self.speed = 0.0, float("nan"), 0.0

    def read(self, state: State) -> None:
        """Replace the encoder reading by the spool's position."""
        self.free = float(state.encoder[self.tendon])
        if isnan(self.position):
            self.position = self.free - self._stretch(float(state.motor[self.tendon]))
        state.encoder[self.tendon] = self.position

    def pull(self, state: State) -> None:
        """Move the spool; the tension of the tendon replaces that of the motor at the bone."""
        step, rate = state.step, float(state.velocity[self.tendon])
        motor = float(state.motor[self.tendon])
        gain = STIFFNESS if BIAS * 1.001 < motor < CUT * 0.999 else 0.0
        push = SPOOL_MASS / step * self.speed - motor
        gap = self.free + step * rate - self.position
        resist = SPOOL_MASS / step + TENDON_LOSS + gain * step
        pressed = resist * gap / step - push - TENDON_LOSS * rate
        if pressed > 0.0:
            linear = self.slope + resist / step
            root = (linear * linear + 4.0 * self.curve * pressed) ** 0.5
            stretch = 2.0 * pressed / (linear + root)
            self.speed = (gap - stretch) / step
            tension = (self.slope + self.curve * stretch) * stretch
            tension += TENDON_LOSS * (rate - self.speed) - gain * step * self.speed
        else:
            self.speed = push / (SPOOL_MASS / step + gain * step)
            tension = 0.0
        state.pull[self.tendon] = max(0.0, tension)
        self.position += step * self.speed

    def _stretch(self, tension: float) -> float:
        root = (self.slope * self.slope + 4.0 * self.curve * tension) ** 0.5
        return 2.0 * tension / (self.slope + root)


def _tune_elasticity(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        _add_spool(robot, robot.tendon(name), effect.parameters["stiffness"])


def _add_spool(robot: Robot, tendon: int, stiffness: float) -> None:
    """Insert the spool before all other devices of the tendon, which act on its results."""
    spools: list[Spool] = []

    def reader() -> Device:
        spools.append(Spool(tendon, stiffness))
        return spools[-1].read

    robot.encoder_devices.insert(0, reader)
    robot.pull_devices.insert(0, lambda: spools[-1].pull)


def _compliance(shape: Shape, amplitude: float) -> dict[str, float]:
    return {**shape, "compliance": amplitude, "stiffness": 1.0 / max(amplitude, 1e-12)}


def _elongations(machine: Machine) -> list[Structure]:
    structures = []
    for tendon in machine.tendons:
        rng = shapes_of("wire_elongation", tendon)
        for duration in (0.0, 6.0):
            shape = {"start": round(rng.uniform(5.0, 9.0), 3), "duration": duration}
            structures.append(Structure("wire_elongation", (tendon,), shape))
    return structures


def _tune_elongation(robot: Robot, effect: Effect) -> None:
    start, duration = effect.parameters["start"], max(effect.parameters["duration"], 0.02)
    length = effect.parameters["length"]

    def device(tendon: int) -> Device:
        def act(state: State) -> None:
            share = (state.log_time - start) / duration
            if share > 0.0:
                state.encoder[tendon] -= length * min(share, 1.0)

        return act

    for name in effect.elements:
        robot.encoder_devices.append(partial(device, robot.tendon(name)))


class Play:
    """Encoder gear with play: the reading follows only when the play is taken up."""

    def __init__(self, tendon: int, play: float) -> None:
        self.tendon, self.half, self.reading = tendon, 0.5 * play, float("nan")

    def __call__(self, state: State) -> None:
        """Replace the encoder reading by that behind the gear."""
        true = float(state.encoder[self.tendon])
        if isnan(self.reading):
            self.reading = true
        self.reading = min(max(self.reading, true - self.half), true + self.half)
        state.encoder[self.tendon] = self.reading


def _tune_backlash(robot: Robot, effect: Effect) -> None:
    play = effect.parameters["play"]
    for name in effect.elements:
        robot.encoder_devices.append(partial(Play, robot.tendon(name), play))


class Toe:
    """Slack tendon: at low tension the paid-out length exceeds the length of the path."""

    def __init__(self, tendon: int, slack: float) -> None:
        self.tendon, self.slack, self.extra = tendon, slack, 0.0

    def __call__(self, state: State) -> None:
        """Add the slack to the encoder reading."""
        slack = self.slack * exp(-float(state.motor[self.tendon]) / TOE_TENSION)
        self.extra += (slack - self.extra) * (1.0 - exp(-state.step / TOE_TIME))
        state.encoder[self.tendon] += self.extra


def _tune_slack(robot: Robot, effect: Effect) -> None:
    slack = effect.parameters["slack"]
    for name in effect.elements:
        robot.encoder_devices.append(partial(Toe, robot.tendon(name), slack))


MECHANISMS = (
    Mechanism(
        id="tendon_elasticity",
        unit="m/N",
        typical=4e-6,
        bound=2e-4,
        structures=each_tendon("tendon_elasticity"),
        parameters=_compliance,
        tune=_tune_elasticity,
    ),
    Mechanism(
        id="wire_elongation",
        unit="m",
        typical=5e-4,
        bound=1e-2,
        structures=_elongations,
        parameters=scaled("length"),
        tune=_tune_elongation,
    ),
    Mechanism(
        id="backlash",
        unit="m",
        typical=5e-4,
        bound=8e-3,
        structures=each_tendon("backlash"),
        parameters=scaled("play"),
        tune=_tune_backlash,
    ),
    Mechanism(
        id="slack",
        unit="m",
        typical=5e-4,
        bound=1e-2,
        structures=each_tendon("slack"),
        parameters=scaled("slack"),
        tune=_tune_slack,
    ),
)
