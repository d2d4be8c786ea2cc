"""Gears and bearings: friction at rest, friction by load, elasticity, and motors that turn along.

Amplitudes: stribeck_friction, the dry friction at rest that is gone at several times the Stribeck
velocity ``slow`` [N or N m]; gear_friction, the ratio of dry friction to the drive's force [1];
joint_elasticity, the compliance between a motor with its encoder and the joint [rad/(N m) or m/N];
motor_coupling, the share of the motion of the joint before with which a motor turns, too [1].
"""

from __future__ import annotations

from functools import partial
from math import ceil, copysign, exp

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
SMOOTH = 0.1
"""Angle of a gear's vibration in one step of its integration [rad]."""


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


def _elastic(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    if stranger.traits.kind not in DRIVEN or stranger.traits.velocities:
        return []  # sensors of speed are at the joints of these machines
    soft = (stranger.travel / stranger.design.peak).tolist()
    return [
        Structure("joint_elasticity", (joint,), 0.01 * size, 0.2 * size)
        for joint, size in zip(stranger.joints, soft, strict=True)
    ]


class RotorBehindSpring:
    """Rotor with an encoder, which pulls its joint through an elastic gear.

    Both are integrated in short steps, in which all other forces accelerate the joint as in the
    step before. The joint's own inertia is ``link`` there.
    """

    def __init__(
        self, index: int, compliance: float, rotor: float, link: float, rate: float
    ) -> None:
        self.index, self.compliance, self.rate = index, compliance, rate
        self.rotor, self.link = rotor, link
        self.vibrates = ((1.0 / rotor + 1.0 / link) / compliance) ** 0.5
        self.position = self.speed = self.before = self.torque = 0.0
        self.is_new = True

    def read(self, state: State) -> None:
        """Read the encoder on the rotor."""
        i = self.index
        if self.is_new:
            self.position, self.is_new = float(state.position[i]), False
        state.encoder[i] += self.position - float(state.position[i])

    def brake(self, state: State) -> None:
        """Let the servo brake the rotor instead of the joint."""
        state.force[self.index] += self.rate * (self.speed - float(state.velocity[self.index]))

    def pull(self, state: State) -> None:
        """Exert the mean torque of the gear in this step."""
        i = self.index
        force, joint, speed = (float(x[i]) for x in (state.pull, state.position, state.velocity))
        others = (speed - self.before) / state.step - self.torque / self.link
        self.before, self.torque = speed, 0.0
        count = ceil(state.step * self.vibrates / SMOOTH)
        step = state.step / count
        for _ in range(count):
            torque = (self.position - joint) / self.compliance
            self.speed += step * (force - torque) / self.rotor
            speed += step * (others + torque / self.link)
            self.position += step * self.speed
            joint += step * speed
            self.torque += torque / count
        state.pull[i] = self.torque


def _tune_elastic(plant: Plant, effect: Effect) -> None:
    i, compliance = joint_of(plant, effect.elements[0]), effect.parameters["size"]
    rate, rotor = float(plant.law.rate[i]), float(plant.model.dof_armature[i])
    link = float(plant.stranger.design.inertia[i] - plant.stranger.design.armature[i])
    plant.model.dof_armature[i] = 0.0
    here: list[RotorBehindSpring] = []

    def make() -> Device:
        here[:] = [RotorBehindSpring(i, compliance, rotor, link, rate)]
        return here[0].read

    plant.encoder_devices.insert(0, make)
    plant.law_devices.append(lambda: here[0].brake)
    plant.pull_devices.append(lambda: here[0].pull)


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
