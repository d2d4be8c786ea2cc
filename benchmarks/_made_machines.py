"""Made machines: an arm with meshes and a finger with muscles, and their logs with a payload."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from experiments.public_models.catalogue import PublicModel
from experiments.public_models.machine import make_machine
from experiments.public_models.motion import Motion
from experiments.public_models.study import noise_of, payload_mass, write_study

POINTS = 4000
"""Number of points of a mesh."""
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
"""Axes of the arm's joints."""


def arm(folder: Path) -> None:
    """Write a study of an arm of six servos whose links are meshes."""
    rng = np.random.default_rng(0)
    meshes, inner = "", ""
    for i, axis in reversed(list(enumerate(AXES))):
        points = rng.standard_normal((POINTS, 3))
        points *= np.array([0.06, 0.03, 0.03]) / np.linalg.norm(points, axis=1, keepdims=True)
        text = " ".join(f"{x:.5f}" for x in (points + np.array([0.06, 0.0, 0.0])).ravel())
        meshes += f'<mesh name="m{i}" vertex="{text}"/>'
        inner = (
            f'<body name="link{i}" pos="0.12 0 0"><joint name="j{i}" axis="{axis}" range="-3 3" '
            f'damping="0.5" armature="0.05"/><geom type="mesh" mesh="m{i}" mass="{1.5 - 0.2 * i}"/>'
            f"{inner}</body>"
        )
    servos = "".join(
        f'<position name="a{i}" joint="j{i}" kp="{400 - 50 * i}" dampratio="1" '
        'ctrlrange="-1 1" ctrllimited="true"/>'
        for i in range(len(AXES))
    )
    _write(folder, 20.0, f"<asset>{meshes}</asset>", inner, f"<actuator>{servos}</actuator>")


def finger(folder: Path) -> None:
    """Write a study of a finger of four joints and five muscles."""
    joints = (("abduct", "0 0 1"), ("mcp", "0 1 0"), ("pip", "0 1 0"), ("dip", "0 1 0"))
    inner = ""
    for k, (name, axis) in reversed(list(enumerate(joints))):
        length = 0.002 if k == 0 else 0.04
        geom = f'<geom type="capsule" fromto="0 0 0 {length} 0 0" size="0.006" mass="0.02"/>'
        sites = "".join(
            f'<site name="{name}_{side}" pos="{0.4 * length:.4f} {y} {z}"/>'
            for side, y, z in (("up", 0, 0.009), ("down", 0, -0.009), ("left", 0.009, 0.002))
        )
        location = 0.0 if k == 0 else (0.002 if k == 1 else 0.04)
        inner = (
            f'<body name="{name}_link" pos="{location} 0 0"><joint name="{name}" axis="{axis}" '
            f'range="-1 1" damping="0.004" stiffness="0.05" armature="2e-5"/>{geom}{sites}'
            f"{inner}</body>"
        )
    anchors = "".join(
        f'<site name="base_{side}" pos="-0.03 {y} {z}"/>'
        for side, y, z in (("up", 0, 0.009), ("down", 0, -0.009), ("left", 0.009, 0.002))
    )
    paths = {
        "extensor": ("up", 4),
        "flexor": ("down", 4),
        "short_flexor": ("down", 3),
        "lumbrical": ("up", 2),
        "abductor": ("left", 2),
    }
    tendons = muscles = ""
    for name, (side, count) in paths.items():
        locations = ["base", *(joint for joint, _ in joints[:count])]
        sites = "".join(f'<site site="{location}_{side}"/>' for location in locations)
        tendons += f'<spatial name="{name}">{sites}</spatial>'
        muscles += f'<muscle name="{name}_muscle" tendon="{name}" force="8"/>'
    more = f"<tendon>{tendons}</tendon><actuator>{muscles}</actuator>"
    _write(folder, 10.0, "", anchors + inner, more)


def _write(folder: Path, seconds: float, assets: str, bodies: str, more: str) -> None:
    """Write the study of a model with a payload."""
    option = '<option timestep="0.002" integrator="implicitfast"/>'
    text = (
        f'<mujoco><compiler angle="radian"/>{option}{assets}<worldbody>{bodies}</worldbody>{more}'
    )
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "machine.xml"
        path.write_text(f"{text}</mujoco>", encoding="utf-8")
        machine = make_machine(path, PublicModel("machine.xml", "made"))
        motion = Motion(machine, 0, seconds)
        noise = noise_of(machine, motion.log(0.0), quantised=False)
        mass, _ = payload_mass(motion, noise)
        write_study(folder, machine, motion.log(mass), noise, 0)
