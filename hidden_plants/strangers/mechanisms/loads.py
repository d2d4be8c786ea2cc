"""Masses and forces that the model lacks, and the direction of gravity.

Amplitudes: link_mass [kg]; centre_of_mass [m] in a direction of the link's frame; payload [kg] at
the end of a last link; gravity_direction [rad]; external_force [N], from ``start`` for
``duration`` [s of log time].
"""

from __future__ import annotations

import mujoco
import numpy as np

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms.mechanism import (
    Mechanism,
    Structure,
    direction,
    size_of,
    vector_of,
)
from hidden_plants.strangers.plant import Plant, State
from hidden_plants.strangers.stranger import Stranger

EDGE = 0.02
"""Time in which an external force rises and falls [s]."""


def _masses(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    found = []
    for link in stranger.skeleton.links:
        for sign, most in ((1.0, 2.0 * link.mass), (-1.0, 0.7 * link.mass)):
            found.append(
                Structure("link_mass", (link.body,), 0.1 * link.mass, most, {"sign": sign})
            )
    return found


def _tune_mass(plant: Plant, effect: Effect) -> None:
    body = plant.model.body(effect.elements[0]).id
    factor = 1.0 + size_of(effect) / float(plant.model.body_mass[body])
    plant.model.body_mass[body] *= factor
    plant.model.body_inertia[body] *= factor


def _centres(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    return [
        Structure("centre_of_mass", (link.body,), 0.05 * size, 0.4 * size, direction(rng))
        for link in stranger.skeleton.links
        for size in (link.length,)
    ]


def _tune_centre(plant: Plant, effect: Effect) -> None:
    plant.model.body_ipos[plant.model.body(effect.elements[0]).id] += vector_of(effect)


def _payloads(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    links = [stranger.skeleton.links[i] for i in stranger.skeleton.ends]
    return [
        Structure("payload", (link.body,), 0.1 * link.mass, 3.0 * link.mass, {"at": link.length})
        for link in links
    ]


def _tune_payload(plant: Plant, effect: Effect) -> None:
    """Combine a point mass at the end of a link with the link's own mass."""
    model, mass = plant.model, effect.parameters["size"]
    body = model.body(effect.elements[0]).id
    own = float(model.body_mass[body])
    far = np.array([effect.parameters["at"], 0.0, 0.0]) - model.body_ipos[body]
    reduced = own * mass / (own + mass)
    frame = np.zeros(9)
    mujoco.mju_quat2Mat(frame, model.body_iquat[body])
    axes = frame.reshape(3, 3)
    tensor = axes @ np.diag(model.body_inertia[body]) @ axes.T
    tensor += reduced * (far @ far * np.eye(3) - np.outer(far, far))
    values, vectors = np.linalg.eigh(tensor)
    if np.linalg.det(vectors) < 0.0:
        vectors[:, 0] *= -1.0
    mujoco.mju_mat2Quat(model.body_iquat[body], np.ascontiguousarray(vectors).ravel())
    model.body_inertia[body] = values
    model.body_ipos[body] += far * mass / (own + mass)
    model.body_mass[body] = own + mass


def _gravity(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    up = np.array(stranger.traits.up)
    across = np.cross(up, rng.standard_normal(3))
    across /= np.linalg.norm(across)
    shape = {axis: round(float(part), 4) for axis, part in zip("xyz", across, strict=True)}
    return [Structure("gravity_direction", (), 0.05, 0.6, shape)]


def _tune_gravity(plant: Plant, effect: Effect) -> None:
    turn = vector_of(effect)
    angle, quat = float(np.linalg.norm(turn)), np.zeros(4)
    mujoco.mju_axisAngle2Quat(quat, turn / angle, angle)
    turned = np.zeros(3)
    mujoco.mju_rotVecQuat(turned, plant.model.opt.gravity.copy(), quat)
    plant.model.opt.gravity[:] = turned


def _pushes(stranger: Stranger, rng: np.random.Generator) -> list[Structure]:
    found = []
    for i in stranger.skeleton.ends:
        link = stranger.skeleton.links[i]
        size = float(stranger.design.peak[i]) / link.length
        shape = {
            **direction(rng),
            "start": round(stranger.traits.seconds * rng.uniform(0.15, 0.75), 3),
            "duration": round(rng.uniform(0.3, 1.2), 3),
        }
        found.append(Structure("external_force", (link.body,), 0.2 * size, 2.0 * size, shape))
    return found


def _tune_push(plant: Plant, effect: Effect) -> None:
    body, force = plant.model.body(effect.elements[0]).id, vector_of(effect)
    begin = effect.parameters["start"]
    end = begin + effect.parameters["duration"]

    def act(state: State) -> None:
        share = min(max((state.time - begin) / EDGE, 0.0), max((end - state.time) / EDGE, 0.0), 1.0)
        state.data.xfrc_applied[body, :3] += share * force

    plant.body_devices.append(lambda: act)


MECHANISMS = (
    Mechanism("link_mass", _masses, _tune_mass),
    Mechanism("centre_of_mass", _centres, _tune_centre),
    Mechanism("payload", _payloads, _tune_payload),
    Mechanism("gravity_direction", _gravity, _tune_gravity),
    Mechanism("external_force", _pushes, _tune_push),
)
