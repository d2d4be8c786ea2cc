"""Actuators of an extended model in the form of Isaac Lab's and mjlab's configurations.

A position servo of MuJoCo with the gain k, the bias (0, -k, -d) and the gear g acts on its joint
like a drive of the stiffness k g^2 and the damping d g^2, whose target is the command over g. The
dry friction of the joint, its viscous friction and its armature belong to the joint in MuJoCo, and
to the actuator there. All numbers are in SI units with radians, as in both configurations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from reality_gap.causes.support.lugre import SLIDING
from reality_gap.report.engines import friction_of


@dataclass(frozen=True)
class ActuatorConfigs:
    """Arguments of configurations.

    Attributes:
        arguments: keyword arguments; of one ``ImplicitActuatorCfg`` of Isaac Lab, with a value for
            each joint, or of one ``BuiltinPositionActuatorCfg`` of mjlab for each actuator.
        lacking: sentences on what the configurations cannot express.
    """

    arguments: tuple[dict[str, Any], ...]
    lacking: tuple[str, ...]


@dataclass(frozen=True)
class _Drive:
    """A position servo, seen at its joint or tendon, in SI units."""

    element: str
    on_tendon: bool
    stiffness: float
    damping: float
    limit: float | None
    armature: float
    friction: float
    viscous: float


def isaac_lab_actuators(spec: mujoco.MjSpec) -> ActuatorConfigs:
    """Return the arguments of an ``ImplicitActuatorCfg`` for all joints that servos move.

    Args:
        spec: the model, such as ``load_extended(folder).spec``; it is not edited.
    """
    lacking: list[str] = []
    drives = []
    for drive in _drives(spec, lacking):
        if drive.on_tendon:
            lacking.append(f"the actuator of {drive.element} pulls a tendon, not a joint")
        else:
            drives.append(drive)
    if not drives:
        return ActuatorConfigs((), tuple(lacking))
    limits = {d.element: d.limit for d in drives if d.limit is not None}
    arguments: dict[str, Any] = {
        "joint_names_expr": [drive.element for drive in drives],
        "stiffness": {drive.element: drive.stiffness for drive in drives},
        "damping": {drive.element: drive.damping for drive in drives},
        "armature": {drive.element: drive.armature for drive in drives},
        "friction": {drive.element: drive.friction for drive in drives},
        "dynamic_friction": {drive.element: drive.friction for drive in drives},
        "viscous_friction": {drive.element: drive.viscous for drive in drives},
    }
    if limits:
        arguments["effort_limit_sim"] = limits
    return ActuatorConfigs((arguments,), tuple(lacking))


def mjlab_actuators(spec: mujoco.MjSpec) -> ActuatorConfigs:
    """Return the arguments of a ``BuiltinPositionActuatorCfg`` for each servo.

    Args:
        spec: the model, such as ``load_extended(folder).spec``; it is not edited.
    """
    lacking: list[str] = []
    arguments = tuple(
        {
            "target_names_expr": (drive.element,),
            "transmission_type": "tendon" if drive.on_tendon else "joint",
            "stiffness": drive.stiffness,
            "damping": drive.damping,
            "effort_limit": drive.limit,
            "armature": drive.armature,
            "frictionloss": drive.friction,
            "viscous_damping": drive.viscous,
        }
        for drive in _drives(spec, lacking)
    )
    return ActuatorConfigs(arguments, tuple(lacking))


def _drives(spec: mujoco.MjSpec, lacking: list[str]) -> Iterator[_Drive]:
    """Yield the servos of a model; add a sentence on each actuator that is none to ``lacking``."""
    model, added = spec.compile(), dict[str, float]()
    frictions = set()
    for actuator in spec.actuators:
        element = friction_of(spec, actuator)
        if element is not None:
            force = float(actuator.biasprm[SLIDING]) * abs(float(actuator.gear[0]))
            key = f"{type(element).__name__} {element.name}"
            added[key] = added.get(key, 0.0) + force
            frictions.add(actuator.name)
    for i in range(model.nactuator):
        name = model.actuator(i).name
        if name in frictions:
            continue
        reason = _not_a_servo(model, i)
        if reason:
            lacking.append(f"the actuator {name} {reason}")
            continue
        drive = _drive(model, i, added)
        yield drive
        if abs(float(model.actuator_biasprm[i, 0])) > 0.0:
            force = float(model.actuator_biasprm[i, 0])
            lacking.append(f"the actuator {name} adds a constant force of {force:.4g} N or N m")
        low, high = model.actuator_forcerange[i]
        if model.actuator_forcelimited[i] and not np.isclose(low, -high):
            lacking.append(f"the forces of the actuator {name} are from {low:.4g} to {high:.4g}")
        if abs(float(model.actuator_gear[i, 0])) != 1.0:
            gear = float(model.actuator_gear[i, 0])
            lacking.append(f"commands of {name} are {gear:.4g} times those of its element")


def _not_a_servo(model: mujoco.MjModel, i: int) -> str:
    """Return why an actuator is no position servo of a joint or tendon; empty if it is one."""
    joint, tendon = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_TENDON)
    if int(model.actuator_trntype[i]) not in (joint, tendon):
        return "moves neither a joint nor a tendon"
    gain, bias = model.actuator_gainprm[i], model.actuator_biasprm[i]
    fixed = int(model.actuator_gaintype[i]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    affine = int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
    if not fixed or not affine or not bias[1]:
        return "is no position servo"
    if not np.isclose(gain[0], -bias[1]):
        return "scales its commands, by a gain other than its stiffness"
    if int(model.actuator_dyntype[i]) != int(mujoco.mjtDyn.mjDYN_NONE):
        return "has a state, as a filter of commands"
    return ""


def _drive(model: mujoco.MjModel, i: int, added: dict[str, float]) -> _Drive:
    """Return a servo, seen at its joint or tendon."""
    gear = abs(float(model.actuator_gear[i, 0]))
    on_tendon = int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_TENDON)
    target = int(model.actuator_trnid[i, 0])
    kind, name = ("tendon", model.tendon(target).name) if on_tendon else ("dof", "")
    at = target
    if not on_tendon:
        name, at = model.joint(target).name, int(model.jnt_dofadr[target])
    armature, friction, viscous = (
        float(np.ravel(getattr(model, f"{kind}_{field}")[at])[0])
        for field in ("armature", "frictionloss", "damping")
    )
    key = f"{'MjsTendon' if on_tendon else 'MjsJoint'} {name}"
    limited = bool(model.actuator_forcelimited[i])
    return _Drive(
        element=name,
        on_tendon=on_tendon,
        stiffness=float(model.actuator_gainprm[i, 0]) * gear**2,
        damping=-float(model.actuator_biasprm[i, 2]) * gear**2,
        limit=float(np.abs(model.actuator_forcerange[i]).max()) * gear if limited else None,
        armature=armature,
        friction=friction + added.get(key, 0.0),
        viscous=viscous,
    )
