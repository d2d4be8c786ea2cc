"""Gears and bearings: friction at rest, friction by load, elasticity, and motors that turn along.

Amplitudes: stribeck_friction, the dry friction at rest that is gone at several times the Stribeck
velocity ``slow`` [N or N m]; gear_friction, the ratio of dry friction to the drive's force [1];
joint_elasticity, the compliance between a motor with its encoder and the joint [rad/(N m) or m/N];
motor_coupling, the share of the motion of the joint before with which a motor turns, too [1].
"""

from __future__ import annotations

from functools import partial
from math import copysign, exp

import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import (
    Mechanism,
    Structure,
    joint_of,
    sign,
    size_of,
)
from hidden_plants.strangers.plant import Device, Plant, Readings, State
from hidden_plants.strangers.stranger import Stranger
from hidden_plants.types import Floats

DRIVEN = ("motors", "servos")
"""Kinds of machines with a motor at each joint."""
CONTROLLED = ("servos", "efforts")
"""Kinds of machines with such a motor in closed loop. In open loop, friction that falls with the
speed makes the motion chaotic, so that no log tells more than that it is there."""
QUICKEST = 0.002
"""Least time constant of a windup [s]."""


class Bend:
    """Dry friction of one joint by Dahl's model of bristles that bend over a travel, then slide."""

    def __init__(self, travel: float) -> None:
        self.travel, self.share = travel, 0.0

    def __call__(self, speed: float, step: float) -> float:
        """Share of the level with which the friction opposes a positive speed."""
        end = copysign(1.0, speed) if speed else 0.0
        self.share = end + (self.share - end) * exp(-abs(speed) * step / self.travel)
        return self.share


def _sticking(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind not in CONTROLLED:
        return []
    numbers = stranger.design
    return [
        Structure("stribeck_friction", (joint,), 0.1 * peak, peak, {"slow": 0.1 * speed})
        for joint, peak, speed in zip(
            stranger.joints, numbers.peak.tolist(), numbers.speed.tolist(), strict=True
        )
    ]


def _tune_sticking(plant: Plant, effect: Effect) -> None:
    i, shape = joint_of(plant, effect.elements[0]), effect.parameters
    travel = float(plant.joint_bristle[i])

    def rub(bend: Bend, state: State) -> None:
        speed = float(state.data.qvel[i])
        level = shape["size"] * exp(-((speed / shape["slow"]) ** 2))
        state.torque[i] -= level * bend(speed, state.step)

    plant.body_devices.append(lambda: partial(rub, Bend(travel)))


def _rubbing(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind not in DRIVEN:
        return []
    return [Structure("gear_friction", (joint,), 0.1, 0.5) for joint in stranger.joints]


def _tune_rubbing(plant: Plant, effect: Effect) -> None:
    i, share = joint_of(plant, effect.elements[0]), effect.parameters["size"]
    travel = float(plant.joint_bristle[i])

    def rub(bend: Bend, state: State) -> None:
        level = share * abs(float(state.force[i]))
        state.torque[i] -= level * bend(float(state.data.qvel[i]), state.step)

    plant.body_devices.append(lambda: partial(rub, Bend(travel)))


class Windup:
    """Elastic gear: the encoder on the motor is ahead of the joint by the windup."""

    def __init__(self, index: int, compliance: float, stiffness: float, step: float) -> None:
        self.index, self.compliance, self.windup = index, compliance, 0.0
        time = max(QUICKEST, 4.0 * step * (1.0 + compliance * stiffness))
        self.share = 1.0 - exp(-step / time)

    def __call__(self, state: State) -> None:
        """Add the windup to the encoder reading."""
        target = self.compliance * float(state.force[self.index])
        self.windup += self.share * (target - self.windup)
        state.encoder[self.index] += self.windup


def _elastic(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind not in DRIVEN or stranger.traits.velocities:
        return []  # sensors of speed are at the joints of these machines
    soft = (stranger.travel / stranger.design.peak).tolist()
    return [
        Structure("joint_elasticity", (joint,), 0.01 * size, 0.2 * size)
        for joint, size in zip(stranger.joints, soft, strict=True)
    ]


class ServoBehindSpring:
    """Servo on a motor without inertia, which pulls the joint through an elastic gear.

    The windup ``w`` of the compliance ``c`` obeys ``kd (w' + v) = kp (u - q - w) - w / c``.
    """

    def __init__(self, index: int, compliance: float, stiffness: float, damping: float) -> None:
        self.index, self.stiffness, self.damping = index, stiffness, damping
        self.compliance, self.windup = compliance, 0.0
        self.total = stiffness + 1.0 / compliance

    def read(self, state: State) -> None:
        """Read the encoder on the motor."""
        state.encoder[self.index] += self.windup

    def act(self, state: State) -> None:
        """Let the gear give way, and exert its force."""
        i = self.index
        error = float(state.command[i]) - (float(state.encoder[i]) - self.windup)
        end = (self.stiffness * error - self.damping * float(state.velocity[i])) / self.total
        keep = exp(-self.total / self.damping * state.step)
        self.windup = end + (self.windup - end) * keep
        state.force[i] = self.windup / self.compliance


def _tune_elastic(plant: Plant, effect: Effect) -> None:
    i, compliance, law = joint_of(plant, effect.elements[0]), effect.parameters["size"], plant.law
    stiffness, damping = float(abs(law.position[i])), float(abs(law.rate[i]))
    if not stiffness:
        plant.encoder_devices.insert(0, lambda: Windup(i, compliance, stiffness, plant.step))
        return
    here: list[ServoBehindSpring] = []

    def make() -> Device:
        here[:] = [ServoBehindSpring(i, compliance, stiffness, damping)]
        return here[0].read

    plant.encoder_devices.insert(0, make)
    plant.law_devices.append(lambda: here[0].act)


def _coupled(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind not in DRIVEN:
        return []
    found, links = [], {link.index: link for link in stranger.skeleton.links}
    for link in stranger.skeleton.links:
        before = links.get(link.parent)
        if before is not None and before.slides == link.slides:
            names = (link.joint, before.joint)
            found.append(Structure("motor_coupling", names, 0.05, 0.5, {"sign": sign(rng)}))
    return found


def _tune_coupled(plant: Plant, effect: Effect) -> None:
    """Let a motor turn with its joint and with the one before it."""
    i, k = (joint_of(plant, name) for name in effect.elements)
    ratio, rate = size_of(effect), float(plant.law.rate[i])
    speeds = {s.index: s.name for s in plant.stranger.sensors if s.kind == "velocity"}

    def read(state: State) -> None:
        state.encoder[i] += ratio * float(state.data.qpos[k])

    def damp(state: State) -> None:
        state.force[i] += rate * ratio * float(state.data.qvel[k])

    def pull(state: State) -> None:
        state.torque[k] += ratio * float(state.pull[i])

    def turn(readings: Readings, time: Floats) -> None:
        if i in speeds and k in speeds:
            readings[speeds[i]] = readings[speeds[i]] + ratio * readings[speeds[k]]

    plant.encoder_devices.insert(0, lambda: read)
    plant.law_devices.append(lambda: damp)
    plant.body_devices.append(lambda: pull)
    plant.reading_effects.append(turn)


MECHANISMS = (
    Mechanism("stribeck_friction", _sticking, _tune_sticking),
    Mechanism("gear_friction", _rubbing, _tune_rubbing),
    Mechanism("joint_elasticity", _elastic, _tune_elastic),
    Mechanism("motor_coupling", _coupled, _tune_coupled),
)
