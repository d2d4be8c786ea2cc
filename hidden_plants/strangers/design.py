"""Design of drives: inertia, friction, gains and limits that suit the links and the motion."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, tostring

import mujoco
import numpy as np

from hidden_plants.strangers.postures import Path
from hidden_plants.strangers.skeleton import Skeleton, add_links, text
from hidden_plants.strangers.traits import Traits
from hidden_plants.types import Floats

GRAVITY = 9.81
"""Gravity [m/s^2]."""
STEPS = (0.0025, 0.002, 0.001, 0.0005, 0.00025)
"""Time steps of nominal models, from coarse to fine [s]."""
SMALLEST_ROTOR = 0.01
"""Least inertia of a rotor over the largest inertia of a joint."""
SMALLEST_DRIVE = 0.03
"""Least force of a drive over the largest one."""
FASTEST = 125.0
"""Largest frequency of a drive against its rotor [rad/s]."""
SAMPLES = 0.01
"""Interval between the samples of a path in a design [s]."""


@dataclass(frozen=True)
class Design:
    """Numbers of the joints and drives, each (joints,).

    Attributes:
        inertia: of each joint with its rotor at the first posture.
        armature, damping, friction, stiffness: of the joints.
        limit: largest force of each joint's drive.
        gain, rate_gain: of the position feedback of each joint.
        peak: largest force that the motion needs.
        speed: largest speed of the motion.
        step: time step of the nominal model [s].
    """

    inertia: Floats
    armature: Floats
    damping: Floats
    friction: Floats
    stiffness: Floats
    limit: Floats
    gain: Floats
    rate_gain: Floats
    peak: Floats
    speed: Floats
    step: float


def bare_root(traits: Traits, skeleton: Skeleton) -> tuple[Element, dict[int, Element]]:
    """Root element of a model of the links only, and the body element of each link."""
    root = Element("mujoco", model=f"{traits.kind} of {traits.joints} joints")
    SubElement(root, "compiler", angle="radian", autolimits="true")
    down = text([-GRAVITY * part for part in traits.up])
    SubElement(root, "option", gravity=down)
    return root, add_links(SubElement(root, "worldbody"), skeleton)


def design(
    rng: np.random.Generator, traits: Traits, skeleton: Skeleton, paths: tuple[Path, ...]
) -> Design:
    """Dimension the drives of a machine."""
    model = mujoco.MjModel.from_xml_string(tostring(bare_root(traits, skeleton)[0]).decode())
    home = paths[0].home
    link_inertia = np.diag(mass_matrix(model, home))
    rotor = np.maximum(link_inertia, SMALLEST_ROTOR * link_inertia.max())
    armature = rotor * np.exp(rng.uniform(np.log(0.1), np.log(1.5), model.nv))
    peak, weight, speed = _needs(model, paths, armature)
    peak = np.maximum(peak, SMALLEST_DRIVE * peak.max())
    reach = np.array([0.5 * (link.range[1] - link.range[0]) for link in skeleton.links])
    armature = np.maximum(armature, 5.0 * peak / reach / FASTEST**2)
    inertia = link_inertia + armature
    stiffness = np.zeros(model.nv)
    if traits.kind == "motors":
        frequency = 2 * np.pi * rng.uniform(0.8, 1.6, model.nv)
        stiffness = inertia * frequency**2 + 2.0 * weight
        damping = 2.0 * rng.uniform(0.3, 0.7) * np.sqrt(inertia * stiffness)
    else:
        damping = rng.uniform(0.03, 0.15, model.nv) * peak / speed
    bandwidth = 2 * np.pi * np.exp(rng.uniform(np.log(2.0), np.log(8.0), model.nv))
    gain = np.maximum(inertia * bandwidth**2, 5.0 * peak / reach)
    gain = np.minimum(gain, armature * FASTEST**2)
    rate_gain = 2.0 * rng.uniform(0.5, 1.1, model.nv) * np.sqrt(inertia * gain)
    if traits.kind == "tendons":
        damping = np.maximum(damping, rng.uniform(0.3, 0.6) * 2.0 * np.sqrt(inertia * gain))
    friction = rng.uniform(0.01, 0.05, model.nv) * peak * traits.modelled_friction
    limit = peak + damping * speed + friction + stiffness * 0.75 * reach
    limit *= rng.uniform(1.4, 2.5, model.nv)
    springs = stiffness if traits.kind == "motors" else gain
    return Design(
        inertia=inertia,
        armature=rounded(armature),
        damping=rounded(damping),
        friction=rounded(friction),
        stiffness=rounded(stiffness),
        limit=rounded(limit),
        gain=rounded(gain),
        rate_gain=rounded(rate_gain),
        peak=peak,
        speed=speed,
        step=_step(rng, traits, mass_matrix(model, home) + np.diag(armature), springs, damping),
    )


def _needs(
    model: mujoco.MjModel, paths: tuple[Path, ...], armature: Floats
) -> tuple[Floats, Floats, Floats]:
    """Largest force, weight and speed of each joint along the paths, each (joints,)."""
    data = mujoco.MjData(model)
    peak, weight, speed = (np.zeros(model.nv) for _ in range(3))
    for path in paths:
        position, velocity, acceleration = path.motion(np.arange(0.0, path.duration, SAMPLES))
        for q, v, a in zip(position, velocity, acceleration, strict=True):
            data.qpos, data.qvel, data.qacc = q, v, a
            mujoco.mj_inverse(model, data)
            peak = np.maximum(peak, np.abs(data.qfrc_inverse + armature * a))
            data.qvel, data.qacc = 0.0 * v, 0.0 * a
            mujoco.mj_inverse(model, data)
            weight = np.maximum(weight, np.abs(data.qfrc_inverse))
        speed = np.maximum(speed, np.abs(velocity).max(axis=0))
    return peak, weight, np.maximum(speed, 1e-3)


def mass_matrix(model: mujoco.MjModel, posture: Floats) -> Floats:
    """Mass matrix at a posture (joints, joints)."""
    data = mujoco.MjData(model)
    data.qpos[:] = posture
    mujoco.mj_forward(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return matrix


def _step(
    rng: np.random.Generator, traits: Traits, mass: Floats, springs: Floats, damping: Floats
) -> float:
    """One of the coarser time steps that resolve the drives and the log."""
    inverse = np.linalg.inv(mass)
    fastest = float(np.sqrt(np.abs(np.linalg.eigvals(inverse @ np.diag(springs))).max()))
    decay = float(np.abs(np.linalg.eigvals(inverse @ np.diag(damping))).max())
    most = min(0.15 / max(fastest, 1e-9), 0.3 / max(decay, 1e-9), 1.0 / traits.rate)
    fine = [step for step in STEPS if step <= most] or [STEPS[-1]]
    return float(rng.choice(fine[:2]))


def rounded(values: Floats) -> Floats:
    """Values with four digits, as people write them in a model."""
    return np.array([float(f"{value:.4g}") for value in values])
