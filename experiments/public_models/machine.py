"""Machine: a public model on a stand, with names and sensors, and with a payload if wanted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.public_models.catalogue import PublicModel

HINGE, SLIDE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE
FREE = mujoco.mjtJoint.mjJNT_FREE
TENDON = mujoco.mjtTrn.mjTRN_TENDON
BALL_RADIUS = 0.01
"""Radius of the payload [m]."""


@dataclass(frozen=True)
class Sensor:
    """A sensor that is logged.

    Attributes:
        name: of the sensor.
        element: joint or tendon.
        unit: SI unit.
        range: range of its readings [unit].
    """

    name: str
    element: str
    unit: str
    range: float


@dataclass(frozen=True)
class Machine:
    """A model on a stand.

    Attributes:
        path: its original file.
        spec: the model that is written.
        sensors: the sensors that are logged.
        end: name of the body that carries the payload.
        torques: whether torques are logged in place of commands.
        home: positions of joints from which it starts [m or rad].
        notes: a sentence on each change of the original model.
    """

    path: Path
    spec: mujoco.MjSpec
    sensors: tuple[Sensor, ...]
    end: str
    torques: bool
    home: dict[str, float]
    notes: tuple[str, ...]


def make_machine(path: Path, model: PublicModel) -> Machine:
    """Put a model on a stand, name its elements and add sensors.

    Raises:
        ExperimentError: the model cannot be loaded, or nothing drives it.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        if model.merged:
            spec.compiler.degree, spec.compiler.autolimits = 0, 1
            spec.compiler.inertiagrouprange = (0, 0)
        spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ExperimentError(f"{path} cannot be loaded: {reason}") from error
    notes = _put_on_stand(spec, model)
    _name(spec)
    driven = _driven(spec)
    if not driven:
        raise ExperimentError(f"no actuator of {path} drives a joint or a tendon")
    compiled = spec.copy().compile()
    sensors = tuple(_add_sensor(spec, compiled, element) for element in driven)
    spec.compile()
    end = _end_body(compiled)
    return Machine(path, spec, sensors, end, model.torques, dict(model.home or {}), tuple(notes))


def with_payload(machine: Machine, mass: float) -> mujoco.MjSpec:
    """Return the model with a ball of a mass [kg] at a site of the end, or its centre of mass.

    Sites on the path of a tendon are no places for a payload.
    """
    spec = machine.spec.copy()
    if mass:
        compiled = machine.spec.copy().compile()
        body = compiled.body(machine.end)
        on_tendons = compiled.wrap_objid[compiled.wrap_type == int(mujoco.mjtWrap.mjWRAP_SITE)]
        sites = np.setdiff1d(np.flatnonzero(compiled.site_bodyid == body.id), on_tendons)
        location = compiled.site_pos[sites[0]] if len(sites) else body.ipos
        ball = spec.body(machine.end).add_body(name="hidden_ball", pos=location)
        ball.mass, ball.ipos, ball.explicitinertial = mass, np.zeros(3), True
        ball.inertia = np.full(3, 0.4 * mass * BALL_RADIUS**2)
    return spec


def _put_on_stand(spec: mujoco.MjSpec, model: PublicModel) -> list[str]:
    """Remove free bases, other objects and the floor."""
    notes = []
    for key in list(spec.keys):
        spec.delete(key)
    for name in model.without:
        for element in (spec.body(name), spec.joint(name)):
            if element is not None:
                spec.delete(element)
                notes.append(f"{name} was removed.")
                break
    for joint in [j for j in spec.joints if j.type == FREE]:
        notes.append(f"The free base {joint.parent.name} was welded to the world.")
        spec.delete(joint)
    planes = [g for g in spec.geoms if g.type == mujoco.mjtGeom.mjGEOM_PLANE]
    for geom in planes:
        geom.contype = geom.conaffinity = 0
    if planes:
        notes.append("The floor was removed.")
    return notes


def _name(spec: mujoco.MjSpec) -> None:
    for kind, elements in (
        ("joint", spec.joints),
        ("tendon", spec.tendons),
        ("actuator", spec.actuators),
        ("body", spec.bodies[1:]),
    ):
        for i, element in enumerate(elements):
            if not element.name:
                element.name = f"{kind}_{i}"


def _driven(spec: mujoco.MjSpec) -> list[tuple[str, bool]]:
    """Return the joints and tendons that actuators drive, and whether each one is a tendon."""
    found: dict[tuple[str, bool], None] = {}
    for actuator in spec.actuators:
        if actuator.trntype in (mujoco.mjtTrn.mjTRN_JOINT, TENDON):
            found[(actuator.target, actuator.trntype == TENDON)] = None
    return list(found)


def _add_sensor(spec: mujoco.MjSpec, model: mujoco.MjModel, driven: tuple[str, bool]) -> Sensor:
    element, is_tendon = driven
    kinds, objects = mujoco.mjtSensor, mujoco.mjtObj
    name = f"at_{element}"
    spec.add_sensor(
        name=name,
        type=kinds.mjSENS_TENDONPOS if is_tendon else kinds.mjSENS_JOINTPOS,
        objtype=objects.mjOBJ_TENDON if is_tendon else objects.mjOBJ_JOINT,
        objname=element,
    )
    if is_tendon:
        return Sensor(name, element, "m", np.nan)
    joint = model.joint(element)
    low, high = joint.range
    slides = int(joint.type[0]) == int(SLIDE)
    width = float(high - low) if high > low else (1.0 if slides else 2.0 * np.pi)
    return Sensor(name, element, "m" if slides else "rad", width)


def _end_body(model: mujoco.MjModel) -> str:
    """Return the body with a mass at the end of the longest chain of joints."""

    def depth(body: int) -> int:
        joints = 0
        while body:
            joints += int(model.body_jntnum[body])
            body = int(model.body_parentid[body])
        return joints

    moving = [b for b in range(1, model.nbody) if model.body_jntnum[b] and model.body_mass[b] > 0.0]
    return str(model.body(max(moving, key=lambda b: (depth(b), -b))).name)
