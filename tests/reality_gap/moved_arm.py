"""Torque logs of an arm of three joints, written without this package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from reality_gap import Study, load_study

ARM = """<mujoco><compiler angle="radian"/><option timestep="0.002"/><worldbody>
<body name="upper"><joint name="shoulder" axis="0 1 0" damping="{damping}"/>
<geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.04" mass="{mass}" contype="0" conaffinity="0"/>
<body name="fore" pos="0.4 0 0"><joint name="elbow" axis="0 1 0" damping="{damping}"/>
<geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="2" contype="0" conaffinity="0"/>
<body name="hand" pos="0.3 0 0"><joint name="wrist" axis="1 0 0" damping="{damping}"/>
<geom type="box" pos="0.05 0.03 0" size="0.05 0.04 0.01" mass="0.6" contype="0" conaffinity="0"/>
</body></body></body></worldbody><sensor><jointpos name="shoulder" joint="shoulder"/>
<jointpos name="elbow" joint="elbow"/><jointpos name="wrist" joint="wrist"/></sensor></mujoco>"""
JOINTS = ("shoulder", "elbow", "wrist")
NOISE = (0.2, 0.1, 0.01)
"""Standard deviation of the torques [N m]."""
RATE = 125.0
"""Samples in one second."""


@dataclass(frozen=True)
class Machine:
    """What the arm is: the numbers of its model, and what no model of it has.

    Attributes:
        mass: of the upper arm [kg].
        damping: of each joint [N m s/rad].
        friction, rotor: Coulomb friction [N m] and inertia of the rotor [kg m^2] by joint.
    """

    mass: float = 4.0
    damping: float = 0.1
    friction: Mapping[str, float] | None = None
    rotor: Mapping[str, float] | None = None


def moved_arm(folder: Path, machine: Machine, seconds: float = 12.0, seed: int = 0) -> Study:
    """Write the nominal model and a log of a machine that follows a path; return the study."""
    model = mujoco.MjModel.from_xml_string(ARM.format(mass=machine.mass, damping=machine.damping))
    time = np.arange(0.0, seconds, 1.0 / RATE)
    rates = np.array([[0.5, 1.3, 2.9], [0.7, 1.9, 3.3], [0.6, 1.7, 3.9]])
    size, shift = np.array([0.5, 0.25, 0.12]), np.arange(3)[:, None]
    phase = rates[:, :, None] * time + shift[:, :, None]
    position = np.einsum("k,jkt->tj", size, np.sin(phase))
    velocity = np.einsum("k,jk,jkt->tj", size, rates, np.cos(phase))
    acceleration = -np.einsum("k,jk,jkt->tj", size, rates**2, np.sin(phase))
    data, rng, torque = mujoco.MjData(model), np.random.default_rng(seed), []
    for q, v, a in zip(position, velocity, acceleration, strict=True):
        data.qpos, data.qvel, data.qacc = q, v, a
        mujoco.mj_inverse(model, data)
        torque.append(data.qfrc_inverse.copy())
    friction, rotor = (
        np.array([(some or {}).get(name, 0.0) for name in JOINTS])
        for some in (machine.friction, machine.rotor)
    )
    found = np.array(torque) + friction * np.sign(velocity) + rotor * acceleration
    found += np.array(NOISE) * rng.standard_normal(found.shape)
    names = [f"{kind}_{name}" for kind in ("position", "torque") for name in JOINTS]
    table = np.column_stack([time, position + 1e-6 * rng.standard_normal(position.shape), found])
    header = ",".join(["time", *names])
    np.savetxt(folder / "log.csv", table, "%.9g", ",", header=header, comments="")
    (folder / "model.xml").write_text(ARM.format(mass=4.0, damping=0.1))
    (folder / "STUDY.yaml").write_text(_study())
    return load_study(folder / "STUDY.yaml")


def _study() -> str:
    lines = ["name: arm", "model: model.xml", "episodes: [{commands: log.csv}]"]
    lines += ["time: {column: time, unit: s}", "sensors:"]
    lines += [f"  {n}: {{column: position_{n}, unit: rad, noise: 1e-6}}" for n in JOINTS]
    lines += ["efforts:"]
    lines += [
        f"  {n}: {{column: torque_{n}, unit: N m, noise: {noise}}}"
        for n, noise in zip(JOINTS, NOISE, strict=True)
    ]
    return "\n".join([*lines, "initial: {joints: first_reading, settle: 0}", ""])
