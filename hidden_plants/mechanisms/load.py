"""Loads: masses, springs and forces that the nominal model lacks, and the direction of gravity.

Parameters and amplitudes:

* link_mass: ``mass`` [kg] is added to the body; its inertia scales with its mass.
* centre_of_mass: moves by ``x, y, z`` [m] in the frame of the body.
* payload: ``mass`` [kg] at ``x, y, z`` [m] in the frame of the body.
* joint_stiffness: ``stiffness`` [N m/rad] about the angle ``rest`` [rad].
* gravity_direction: gravity turns by ``tilt`` [rad] towards ``azimuth`` [rad] (from x to y).
* external_force: ``x, y, z`` [N] in the world's frame at the body's centre of mass, from ``start``
  [s] for ``duration`` [s]: in every episode (``every_episode`` 1), or once in log time.
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
    random_direction,
    scaled,
    shapes_of,
    vector,
)
from hidden_plants.robot import Device, Robot, State
from hidden_plants.secret import Effect

LINKS = {"elbow": ("ulna", "radius", HAND), "arm": ("humerus", "ulna", "radius", HAND)}
EDGE = 0.06
"""Rise and fall time of an external force [s]."""
SPAN = 3.0
"""Stretch of a joint's two rubber bands at the rest angle [rad]."""


def _links(machine: Machine) -> list[Structure]:
    return [Structure("link_mass", (link,)) for link in LINKS[machine.name]]


def _tune_mass(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        body = robot.model.body(name).id
        factor = 1.0 + effect.parameters["mass"] / float(robot.model.body_mass[body])
        robot.model.body_mass[body] *= factor
        robot.model.body_inertia[body] *= factor


def _centres(machine: Machine) -> list[Structure]:
    id, structures = "centre_of_mass", []
    for link in LINKS[machine.name]:
        rng = shapes_of(id, machine.name, link)
        structures += [Structure(id, (link,), random_direction(rng)) for _ in range(3)]
    return structures


def _tune_centre(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.model.body_ipos[robot.model.body(name).id] += vector(effect)


def _payloads(machine: Machine) -> list[Structure]:
    rng = shapes_of("payload", machine.name)
    positions = np.round(rng.uniform([-0.02, 0.02, -0.09], [0.02, 0.05, -0.05], (2, 3)), 3)
    return [
        Structure("payload", (HAND,), {"x": float(x), "y": float(y), "z": float(z)})
        for x, y, z in positions
    ]


def _add_payload(spec: mujoco.MjSpec, effect: Effect) -> None:
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
        robot.body_devices.append(partial(_bands, address, dof, stiffness, rest))


def _bands(address: int, dof: int, stiffness: float, rest: float) -> Device:
    """Two rubber bands that pull a joint in opposite directions, each only while stretched."""

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


def _forces(machine: Machine) -> list[Structure]:
    rng = shapes_of("external_force", machine.name)
    structures = []
    for every in (1.0, 1.0, 1.0, 0.0, 0.0):
        shape = {
            "start": round(rng.uniform(0.8, 2.6) if every else rng.uniform(5.0, 15.0), 3),
            "duration": round(rng.uniform(0.2, 1.0), 3),
            "every_episode": every,
            **random_direction(rng),
        }
        structures.append(Structure("external_force", (HAND,), shape))
    return structures


def _tune_force(robot: Robot, effect: Effect) -> None:
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
        robot.body_devices.append(partial(device, robot.model.body(name).id))


MECHANISMS = (
    Mechanism(
        id="link_mass",
        unit="kg",
        typical=0.1,
        bound=1.0,
        structures=_links,
        parameters=scaled("mass"),
        tune=_tune_mass,
    ),
    Mechanism(
        id="centre_of_mass",
        unit="m",
        typical=0.02,
        bound=0.08,
        structures=_centres,
        parameters=along,
        tune=_tune_centre,
    ),
    Mechanism(
        id="payload",
        unit="kg",
        typical=0.1,
        bound=1.0,
        structures=_payloads,
        parameters=scaled("mass"),
        reshape=_add_payload,
    ),
    Mechanism(
        id="joint_stiffness",
        unit="N m/rad",
        typical=0.5,
        bound=8.0,
        structures=_springs,
        parameters=scaled("stiffness"),
        tune=_tune_spring,
    ),
    Mechanism(
        id="gravity_direction",
        unit="rad",
        typical=0.05,
        bound=0.35,
        structures=_tilts,
        parameters=scaled("tilt"),
        tune=_tune_gravity,
    ),
    Mechanism(
        id="external_force",
        unit="N",
        typical=3.0,
        bound=40.0,
        structures=_forces,
        parameters=along,
        tune=_tune_force,
    ),
)
