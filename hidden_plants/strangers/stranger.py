"""Nominal machine of a seed: its model, drives, sensors and motion."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element, tostring

import mujoco
import numpy as np

from hidden_plants.strangers.design import Design, bare_root, design
from hidden_plants.strangers.drives import Law, Sensor, commands, joint_law, tendon_law
from hidden_plants.strangers.mjcf import (
    complete_joints,
    to_text,
    write_actuators,
    write_defaults,
    write_sensors,
)
from hidden_plants.strangers.postures import Path, sample_paths
from hidden_plants.strangers.routes import Route, add_routes, write_routes
from hidden_plants.strangers.skeleton import Skeleton, sample_skeleton, text
from hidden_plants.strangers.traits import Traits, sample_traits
from hidden_plants.types import Floats

SETTLE = 1.0
"""Time for which the first command is held before an episode [s]."""


@dataclass(frozen=True, eq=False)
class Stranger:
    """One nominal machine and what it does.

    Attributes:
        seed: that determines all.
        traits, skeleton, design, routes: parts of the machine.
        xml: text of the nominal model.
        model: compiled; it is shared, do not edit it.
        law: of the drives.
        moved: joint or tendon of each drive.
        sensors: what is measured, in the order of the log.
        paths: planned motion of each episode.
        commands: times (k,) [s] and commands (k, drives) of each episode.
        realisation: number of the real machine and its readings: those of each number have their
            own mismatches and noise, and the same time stamps.
    """

    seed: int
    traits: Traits
    skeleton: Skeleton
    design: Design
    routes: tuple[Route, ...]
    xml: str
    model: mujoco.MjModel
    law: Law
    moved: tuple[str, ...]
    sensors: tuple[Sensor, ...]
    paths: tuple[Path, ...]
    commands: tuple[tuple[Floats, Floats], ...]
    realisation: int = 0

    def generator(self, *purpose: int) -> np.random.Generator:
        """Random numbers of a purpose, in this realisation."""
        own = (self.realisation,) if self.realisation else ()
        return np.random.default_rng([self.seed, *purpose, *own])

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(link.joint for link in self.skeleton.links)

    @property
    def tendons(self) -> tuple[str, ...]:
        """Names of the tendons."""
        return tuple(route.name for route in self.routes)

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names of the actuators, also of the controller of a log of torques."""
        return tuple(f"m_{name}" for name in self.moved)

    @property
    def travel(self) -> Floats:
        """Distance that each joint travels in the plan (joints,) [rad or m]."""
        stops = [np.concatenate([p.stops[j] for p in self.paths]) for j in range(self.model.nv)]
        return np.array([max(float(np.ptp(s)), 1e-3) for s in stops])


def make_stranger(seed: int, seconds: float = 10.0) -> Stranger:
    """Make the machine of a seed.

    Args:
        seed: at least 0; seeds below 1000 are for tuning.
        seconds: length of the log [s].
    """
    rng = np.random.default_rng(seed)
    traits = sample_traits(rng, seconds)
    skeleton = sample_skeleton(rng, traits)
    paths = sample_paths(rng, traits, skeleton)
    numbers = design(rng, traits, skeleton, paths)
    root, bodies = bare_root(traits, skeleton)
    tendons = traits.kind == "tendons"
    routes = add_routes(rng, traits, skeleton, bodies) if tendons else ()
    write_routes(root, routes)
    complete_joints(root, traits, numbers, [text(link.range) for link in skeleton.links])
    passive = compiled(root)
    moved = tuple(w.name for w in routes) or tuple(link.joint for link in skeleton.links)
    law = joint_law(traits, numbers)
    if tendons:
        law = tendon_law(passive, numbers, paths[0].home, routes)
    sensors = _sensors(traits, skeleton, numbers, law, passive, moved)
    write_actuators(root, traits, law, list(moved))
    write_sensors(root, sensors)
    write_defaults(root, traits, numbers)
    return Stranger(
        seed=seed,
        traits=traits,
        skeleton=skeleton,
        design=numbers,
        routes=routes,
        xml=to_text(root),
        model=compiled(root),
        law=law,
        moved=moved,
        sensors=sensors,
        paths=paths,
        commands=commands(passive, traits, law, paths),
    )


def compiled(root: Element) -> mujoco.MjModel:
    """Compile a model."""
    return mujoco.MjModel.from_xml_string(tostring(root).decode())


def _sensors(
    traits: Traits,
    skeleton: Skeleton,
    numbers: Design,
    law: Law,
    passive: mujoco.MjModel,
    moved: tuple[str, ...],
) -> tuple[Sensor, ...]:
    """Sensors of the machine; positions of joints always, unless tendons measure their lengths."""
    found: list[Sensor] = []
    fine, coarse = 2.0**-traits.position_bits, 2.0**-traits.force_bits
    if traits.kind == "tendons":
        for i, name in enumerate(moved):
            span = float(passive.tendon_length0[i])
            found.append(
                Sensor(f"length_{name}", "length", name, i, span * fine, traits.noise * span)
            )
    else:
        for link in skeleton.links:
            span = 2.0 * link.range[1] if link.slides else 2 * np.pi
            noise = traits.noise * 2.0 * link.range[1]
            found.append(
                Sensor(f"at_{link.joint}", "position", link.joint, link.index, span * fine, noise)
            )
    if traits.velocities:
        for i, link in enumerate(skeleton.links):
            span = 2.0 * float(numbers.speed[i])
            found.append(
                Sensor(f"speed_{link.joint}", "velocity", link.joint, i, span / 4096, 2e-3 * span)
            )
    most = np.maximum(np.abs(law.low), np.abs(law.high))
    for i, name in enumerate(moved if traits.forces or traits.kind == "efforts" else ()):
        quantum, noise = 2.0 * float(most[i]) * coarse, traits.force_noise * float(most[i])
        if traits.kind == "efforts":
            found.append(Sensor(name, "effort", name, i, quantum, noise))
        else:
            found.append(Sensor(f"force_{name}", "force", f"m_{name}", i, quantum, noise))
    return tuple(found)
