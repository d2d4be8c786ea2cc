"""Actuators of an extended model in the form of Isaac Lab's and mjlab's configurations.

A position servo of MuJoCo with the gain k, the bias (0, -k, -d) and the gear g acts on its joint
like a drive of the stiffness k g^2 and the damping d g^2, whose target is the command over g. The
dry friction of the joint, its viscous friction and its armature belong to the joint in MuJoCo, and
to the actuator there. All numbers are in SI units with radians, as in both configurations, whose
names are regular expressions: the characters of a name that mean something there are escaped.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from reality_gap.causes.support.lugre import SLIDING
from reality_gap.extended import Extended
from reality_gap.report.engines import actuator_name, friction_of, spec_of
from reality_gap.study.system import command_limits
from reality_gap.types import Floats


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
    """A position servo, seen at its joint or tendon, in SI units.

    ``element`` is the name of the joint or tendon, ``pattern`` the regular expression of it.
    """

    element: str
    on_tendon: bool
    stiffness: float
    damping: float
    limit: float | None
    armature: float
    friction: float
    viscous: float

    @property
    def pattern(self) -> str:
        return re.escape(self.element)


def isaac_lab_actuators(model: mujoco.MjSpec | Extended) -> ActuatorConfigs:
    """Return the arguments of an ``ImplicitActuatorCfg`` for all joints that servos move.

    Args:
        model: the model, such as ``load_extended(folder)``; it is not edited. Effects that an
            extended one has beside its spec are lacking.

    Raises:
        StudyError: ``model`` is something else.
    """
    spec, beside = spec_of(model)
    lacking, drives = [*beside], []
    for drive in _drives(spec, lacking):
        if drive.on_tendon:
            lacking.append(f"the actuator of {drive.element} pulls a tendon, not a joint")
        else:
            drives.append(drive)
    if not drives:
        return ActuatorConfigs((), tuple(lacking))
    limits = {d.pattern: d.limit for d in drives if d.limit is not None}
    arguments: dict[str, Any] = {
        "joint_names_expr": [drive.pattern for drive in drives],
        "stiffness": {drive.pattern: drive.stiffness for drive in drives},
        "damping": {drive.pattern: drive.damping for drive in drives},
        "armature": {drive.pattern: drive.armature for drive in drives},
        "friction": {drive.pattern: drive.friction for drive in drives},
        "dynamic_friction": {drive.pattern: drive.friction for drive in drives},
        "viscous_friction": {drive.pattern: drive.viscous for drive in drives},
    }
    if limits:
        arguments["effort_limit_sim"] = limits
    return ActuatorConfigs((arguments,), tuple(lacking))


def mjlab_actuators(model: mujoco.MjSpec | Extended) -> ActuatorConfigs:
    """Return the arguments of a ``BuiltinPositionActuatorCfg`` for each servo.

    Args:
        model: the model, such as ``load_extended(folder)``; it is not edited. Effects that an
            extended one has beside its spec are lacking.

    Raises:
        StudyError: ``model`` is something else.
    """
    spec, beside = spec_of(model)
    lacking = [*beside]
    arguments = tuple(
        {
            "target_names_expr": (drive.pattern,),
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
    """Yield a servo for each joint and tendon; add what is not in it to ``lacking``."""
    model, added = spec.compile(), dict[str, float]()
    frictions = set()
    for actuator in spec.actuators:
        element = friction_of(spec, actuator)
        if element is not None:
            force = float(actuator.biasprm[SLIDING]) * abs(float(actuator.gear[0]))
            key = f"{type(element).__name__} {element.name}"
            added[key] = added.get(key, 0.0) + force
            frictions.add(actuator.name)
    driven = set()
    for i in range(model.nactuator):
        name = actuator_name(model, i)
        if name in frictions:
            continue
        reason = _not_a_servo(model, i)
        if reason:
            lacking.append(f"the actuator {name} {reason}")
            continue
        drive = _drive(model, i, added)
        if (drive.on_tendon, drive.element) in driven:
            lacking.append(f"the actuator {name} is a second servo of {drive.element}")
            continue
        driven.add((drive.on_tendon, drive.element))
        yield drive
        lacking.extend(_lost(model, i))


def _lost(model: mujoco.MjModel, i: int) -> Iterator[str]:
    """Yield a sentence on each property of a servo that its configuration lacks."""
    name, gear = actuator_name(model, i), float(model.actuator_gear[i, 0])
    constant, (on_tendon, _, index) = float(model.actuator_biasprm[i, 0]), _element(model, i)
    if constant:
        slides = on_tendon or int(model.jnt_type[index]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
        unit = "N" if slides else "N m"
        yield f"the actuator {name} adds a constant force of {constant:.4g} {unit}"
    low, high = model.actuator_forcerange[i]
    if model.actuator_forcelimited[i] and not np.isclose(low, -high):
        yield f"the forces of the actuator {name} are from {low:.4g} to {high:.4g}"
    low, high = _element_range(model, i)
    if np.isfinite(high) and not np.isclose(low, -high):
        element = _element(model, i)[1]
        yield f"the forces of all actuators of {element} are from {low:.4g} to {high:.4g}"
    low, high = command_limits(model, i)
    if np.isfinite(high):
        yield f"commands of the actuator {name} are limited to {low:.4g} to {high:.4g}"
    if gear != 1.0:
        yield f"commands of the actuator {name} are {gear:.4g} times those of its element"


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
    if bias[1] > 0.0 or bias[2] > 0.0:
        return "has a negative stiffness or damping"
    if int(model.actuator_dyntype[i]) != int(mujoco.mjtDyn.mjDYN_NONE):
        return "has a state, as a filter of commands"
    return _unusable_element(model, i)


def _unusable_element(model: mujoco.MjModel, i: int) -> str:
    """Return why the joint or tendon of a servo has no drive; empty if it can have one."""
    on_tendon, name, index = _element(model, i)
    simple = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    if not on_tendon and int(model.jnt_type[index]) not in simple:
        return f"moves {name}, which is neither a hinge nor a slide"
    if not name:
        return f"moves a {'tendon' if on_tendon else 'joint'} without a name"
    if not model.actuator_gear[i, 0]:
        return f"does not move {name}, with a gear of 0"
    return ""


def _element(model: mujoco.MjModel, i: int) -> tuple[bool, str, int]:
    """Return whether an actuator pulls a tendon, and the name and index of its tendon or joint."""
    on_tendon = int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_TENDON)
    index = int(model.actuator_trnid[i, 0])
    return on_tendon, (model.tendon if on_tendon else model.joint)(index).name, index


def _element_range(model: mujoco.MjModel, i: int) -> Floats:
    """Return the limits of all forces on an actuator's joint or tendon, shape (2,) [N or N m]."""
    on_tendon, _, index = _element(model, i)
    kind = "tendon" if on_tendon else "jnt"
    if not getattr(model, f"{kind}_actfrclimited")[index]:
        return np.array([-np.inf, np.inf])
    return np.asarray(getattr(model, f"{kind}_actfrcrange")[index])


def _limit(model: mujoco.MjModel, i: int) -> float | None:
    """Return the largest force of a servo on its joint or tendon; None without a limit."""
    ends = np.array([-np.inf, np.inf])
    if model.actuator_forcelimited[i]:
        ends = model.actuator_forcerange[i] * model.actuator_gear[i, 0]
    limit = float(np.abs(np.clip(ends, *_element_range(model, i))).max())
    return limit if np.isfinite(limit) else None


def _drive(model: mujoco.MjModel, i: int, added: dict[str, float]) -> _Drive:
    """Return a servo, seen at its joint or tendon."""
    gear = float(model.actuator_gear[i, 0])
    on_tendon, name, index = _element(model, i)
    kind, at = ("tendon", index) if on_tendon else ("dof", int(model.jnt_dofadr[index]))
    armature, friction, viscous = (
        float(np.ravel(getattr(model, f"{kind}_{field}")[at])[0])
        for field in ("armature", "frictionloss", "damping")
    )
    key = f"{'MjsTendon' if on_tendon else 'MjsJoint'} {name}"
    return _Drive(
        element=name,
        on_tendon=on_tendon,
        stiffness=float(model.actuator_gainprm[i, 0]) * gear**2,
        damping=-float(model.actuator_biasprm[i, 2]) * gear**2,
        limit=_limit(model, i),
        armature=armature,
        friction=friction + added.get(key, 0.0),
        viscous=viscous,
    )
