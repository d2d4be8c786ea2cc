"""Drives of a machine: the law of each actuator, and the sensors."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.optimize import lsq_linear

from hidden_plants.strangers.design import SAMPLES, Design, rounded
from hidden_plants.strangers.postures import Path
from hidden_plants.strangers.routes import Route
from hidden_plants.strangers.traits import Traits
from hidden_plants.types import Floats

PLAN = 0.05
"""Interval between planned tensions, which are interpolated [s]."""
DELTA = 1e-5
"""Step of the numerical derivatives of tendon lengths [rad]."""
WEIGHT = 100.0
"""Weight of a balanced torque against a preferred tension."""


@dataclass(frozen=True)
class Law:
    """Force of each actuator: clip(gain u + bias + position x + rate v, low, high).

    u is the command, x and v are the position and speed of what the actuator moves. All fields have
    one entry for each actuator.
    """

    gain: Floats
    bias: Floats
    position: Floats
    rate: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Sensor:
    """One measured channel.

    Attributes:
        name: of the sensor in the model, or of the joint if ``kind`` is "effort".
        kind: "position", "velocity", "length", "force" or "effort".
        element: the joint, tendon or actuator that it measures.
        index: of the joint or actuator.
        quantum: step of its values.
        noise: standard deviation of its white noise.
    """

    name: str
    kind: str
    element: str
    index: int
    quantum: float
    noise: float

    @property
    def deviation(self) -> float:
        """Standard deviation of a reading, from noise and quantisation."""
        return float(np.hypot(self.noise, self.quantum / np.sqrt(12.0)))


def joint_law(traits: Traits, design: Design) -> Law:
    """Law of the drives of joints; in a log of torques, the position is a controller's."""
    zero = np.zeros_like(design.limit)
    if traits.kind == "motors":
        return Law(zero + 1.0, zero, zero, zero, -design.limit, design.limit)
    gain, rate = design.gain, -design.rate_gain
    return Law(gain, zero, -gain, rate, -design.limit, design.limit)


def tendon_law(
    model: mujoco.MjModel, design: Design, home: Floats, routes: tuple[Route, ...]
) -> Law:
    """Law of tendons; a pull is a negative force and grows with the length."""
    joints = np.array([route.joint for route in routes])
    arms = np.abs(moment_arms(model, home)[np.arange(len(routes)), joints])
    stiffness = rounded(design.gain[joints] / (2.0 * arms**2))
    least = rounded(0.1 * design.peak[joints] / arms)
    most = rounded((2.5 * design.limit[joints]) / arms)
    return Law(stiffness, -least, -stiffness, 0.0 * least, -most, -least)


def moment_arms(model: mujoco.MjModel, posture: Floats) -> Floats:
    """Derivatives of the tendon lengths by the joints (tendons, joints) [m/rad]."""
    shifts = DELTA * np.vstack([np.eye(model.nv), -np.eye(model.nv)])
    lengths = tendon_lengths(model, posture + shifts)
    return (lengths[: model.nv] - lengths[model.nv :]).T / (2.0 * DELTA)


def tendon_lengths(model: mujoco.MjModel, postures: Floats) -> Floats:
    """Tendon lengths at postures (k, joints), shape (k, tendons) [m]."""
    data, rows = mujoco.MjData(model), []
    for posture in postures:
        data.qpos[:] = posture
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        rows.append(data.ten_length.copy())
    return np.array(rows)


def efforts_along(model: mujoco.MjModel, path: Path, time: Floats) -> Floats:
    """Forces of the joints that a motion of the nominal model needs (k, joints), without friction.

    Tendons without a force exert none.
    """
    data, rows = mujoco.MjData(model), []
    for q, v, a in zip(*path.motion(time), strict=True):
        data.qpos, data.qvel, data.qacc = q, v, a
        mujoco.mj_inverse(model, data)
        friction = data.qfrc_constraint.copy()
        rows.append(data.qfrc_inverse + friction)
    return np.array(rows)


def target_lengths(model: mujoco.MjModel, law: Law, path: Path, time: Floats) -> Floats:
    """Target lengths of all tendons for a motion (k, tendons) [m]."""
    coarse = np.arange(0.0, path.duration + PLAN, PLAN)
    needed, postures = efforts_along(model, path, coarse), path.at(coarse)
    least, most = -law.high, -law.low
    preferred = least + 0.25 * (most - least)
    rows = []
    for posture, effort in zip(postures, needed, strict=True):
        arms = moment_arms(model, posture)
        scale = WEIGHT / np.abs(arms).max()
        matrix = np.vstack([-scale * arms.T, np.eye(len(preferred))])
        goal = np.concatenate([scale * effort, preferred])
        tension = lsq_linear(matrix, goal, (1.2 * least, 0.9 * most), method="bvls").x
        rows.append((least - tension) / -law.position)
    table = tendon_lengths(model, postures) + np.array(rows)
    return np.stack([np.interp(time, coarse, column) for column in table.T], axis=1)


def commands(
    model: mujoco.MjModel, traits: Traits, law: Law, paths: tuple[Path, ...]
) -> tuple[tuple[Floats, Floats], ...]:
    """Times (k,) [s] and commands (k, actuators) of every episode."""
    found = []
    for path in paths:
        time = np.arange(0.0, path.duration - 1e-9, 1.0 / traits.rate)
        if traits.kind == "motors":
            command = efforts_along(model, path, time)
        elif traits.kind == "tendons":
            command = target_lengths(model, law, path, time)
        else:
            command = path.at(time)
        found.append((time, command))
    return tuple(found)


def feedforward(model: mujoco.MjModel, path: Path) -> tuple[Floats, Floats]:
    """Times (k,) and torques (k, joints) that the controller of a log of torques adds."""
    time = np.arange(0.0, path.duration + SAMPLES, SAMPLES)
    return time, efforts_along(model, path, time)
