"""Bones that are heavier, springs and pushes that nobody drew, and where down really is.

Parameters and amplitudes:

* link_mass: ``mass`` [kg] more.
* centre_of_mass: moved by ``x, y, z`` [m] in the body's frame.
* payload: ``mass`` [kg] at ``x, y, z`` [m] of the body's frame.
* joint_stiffness: ``stiffness`` [N m/rad] about ``rest`` [rad].
* gravity_direction: down is turned by ``tilt`` [rad] towards ``azimuth`` [rad] (from x to y).
* external_force: ``x, y, z`` [N] in the world's frame on the centre of the body, from ``start``
  [s] for ``duration`` [s]; in every episode's own time (``every_episode`` 1), or once, in log
  time.
"""

from __future__ import annotations

from functools import partial
from math import cos, pi

import mujoco
import numpy as np

from hidden_plants.machine import HAND, Machine
from hidden_plants.mechanisms.mechanism import (
    Mechanism,
    Structure,
    along,
    random_way,
    scaled,
    shapes_of,
    vector,
)
from hidden_plants.robot import Device, Robot, State
from hidden_plants.secret import Effect

LINKS = {"elbow": ("ulna", "radius", HAND), "arm": ("humerus", "ulna", "radius", HAND)}
EDGE = 0.06
"""How long a push grows and fades [s]."""
SPAN = 3.0
"""Turn by which each of a joint's two rubber bands is stretched in the middle [rad]."""


def _links(machine: Machine) -> list[Structure]:
    return [Structure("link_mass", (link,)) for link in LINKS[machine.name]]


def _tune_mass(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        body = robot.model.body(name).id
        factor = 1.0 + effect.parameters["mass"] / float(robot.model.body_mass[body])
        robot.model.body_mass[body] *= factor
        robot.model.body_inertia[body] *= factor


def _ways(id: str, machine: Machine, places: tuple[str, ...], count: int) -> list[Structure]:
    structures = []
    for place in places:
        rng = shapes_of(id, machine.name, place)
        structures += [Structure(id, (place,), random_way(rng)) for _ in range(count)]
    return structures


def _tune_centre(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.model.body_ipos[robot.model.body(name).id] += vector(effect)


def _payloads(machine: Machine) -> list[Structure]:
    rng = shapes_of("payload", machine.name)
    places = np.round(rng.uniform([-0.02, 0.02, -0.09], [0.02, 0.05, -0.05], (2, 3)), 3)
    return [
        Structure("payload", (HAND,), {"x": float(x), "y": float(y), "z": float(z)})
        for x, y, z in places
    ]


def _hold(spec: mujoco.MjSpec, effect: Effect) -> None:
    size, mass = 0.02, effect.parameters["mass"]
    for name in effect.elements:
        load = spec.body(name).add_body(name="payload", pos=vector(effect))
        load.mass, load.explicitinertial = mass, True
        load.inertia[:] = 0.4 * mass * size * size


def _springs(machine: Machine) -> list[Structure]:
    structures = []
    for joint in machine.joints:
        rng = shapes_of("joint_stiffness", joint)
        low, high = machine.model.joint(joint).range
        for _ in range(2):
            rest = round(float(low + (high - low) * rng.uniform(0.2, 0.8)), 3)
            structures.append(Structure("joint_stiffness", (joint,), {"rest": rest}))
    return structures


def _tune_spring(robot: Robot, effect: Effect) -> None:
    stiffness, rest = effect.parameters["stiffness"], effect.parameters["rest"]
    for name in effect.elements:
        joint = robot.model.joint(name)
        address, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        robot.body.append(partial(_bands, address, dof, stiffness, rest))


def _bands(address: int, dof: int, stiffness: float, rest: float) -> Device:
    """Two stretched rubber bands that pull a joint from both sides, each only while stretched."""

    def act(state: State) -> None:
        turn = float(state.data.qpos[address]) - rest
        one, other = max(0.0, SPAN + turn), max(0.0, SPAN - turn)
        state.data.qfrc_applied[dof] -= 0.5 * stiffness * (one - other)

    return act


def _tilts(machine: Machine) -> list[Structure]:
    angles = (0.4, 2.2, 3.7, 5.4)
    return [Structure("gravity_direction", (), {"azimuth": angle}) for angle in angles]


def _tune_gravity(robot: Robot, effect: Effect) -> None:
    tilt, azimuth = effect.parameters["tilt"], effect.parameters["azimuth"]
    size = float(np.linalg.norm(robot.model.opt.gravity))
    side = np.array([np.cos(azimuth), np.sin(azimuth), 0.0]) * np.sin(tilt)
    robot.model.opt.gravity[:] = size * (side - np.array([0.0, 0.0, np.cos(tilt)]))


def _pushes(machine: Machine) -> list[Structure]:
    rng = shapes_of("external_force", machine.name)
    structures = []
    for every in (1.0, 1.0, 1.0, 0.0, 0.0):
        shape = {
            "start": round(rng.uniform(0.8, 2.6) if every else rng.uniform(5.0, 15.0), 3),
            "duration": round(rng.uniform(0.2, 1.0), 3),
            "every_episode": every,
            **random_way(rng),
        }
        structures.append(Structure("external_force", (HAND,), shape))
    return structures


def _tune_push(robot: Robot, effect: Effect) -> None:
    force, numbers = vector(effect), effect.parameters
    start, end = numbers["start"], numbers["start"] + numbers["duration"]

    def device(body: int) -> Device:
        def act(state: State) -> None:
            time = state.time if numbers["every_episode"] else state.log_time
            if start < time < end:
                edge = min(1.0, (time - start) / EDGE, (end - time) / EDGE)
                state.data.xfrc_applied[body, :3] += force * 0.5 * (1.0 - cos(pi * edge))

        return act

    for name in effect.elements:
        robot.body.append(partial(device, robot.model.body(name).id))


MECHANISMS = (
    Mechanism("link_mass", "kg", 0.1, 1.0, _links, scaled("mass"), tune=_tune_mass),
    Mechanism(
        "centre_of_mass",
        "m",
        0.02,
        0.08,
        lambda machine: _ways("centre_of_mass", machine, LINKS[machine.name], 3),
        along,
        tune=_tune_centre,
    ),
    Mechanism("payload", "kg", 0.1, 1.0, _payloads, scaled("mass"), reshape=_hold),
    Mechanism(
        "joint_stiffness", "N m/rad", 0.5, 8.0, _springs, scaled("stiffness"), tune=_tune_spring
    ),
    Mechanism("gravity_direction", "rad", 0.05, 0.35, _tilts, scaled("tilt"), tune=_tune_gravity),
    Mechanism("external_force", "N", 3.0, 40.0, _pushes, along, tune=_tune_push),
)
