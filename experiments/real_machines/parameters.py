"""Parameters of the baselines: edits of a nominal model that a person would make, and their sizes.

A parameter has a kind, such as "friction", and acts on one element, such as a joint. Its key is
both, "friction elbow", or the kind alone if it acts on all elements of its kind. Its size follows
from the machine: the inertia, the effort and the speed of the joint along the log.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from jmm_agent.types import Floats
from reality_gap.causes.base import Effects, Record
from reality_gap.simulation.hypothesis import Plant
from reality_gap.simulation.inverse_dynamics import inverse_replay
from reality_gap.simulation.replay import replay
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured, measured

JOINT, SERVO, BODY, MACHINE = "joint", "servo", "body", "machine"
ACTS_ON = {
    "armature": JOINT,
    "damping": JOINT,
    "friction": JOINT,
    "offset": JOINT,
    "bias": JOINT,
    "gain": SERVO,
    "servo_damping": SERVO,
    "mass": BODY,
    "delay": MACHINE,
}
"""Kinds of parameters, and on what each acts: rotor inertia, viscous and dry friction of a joint,
offset of its effort, zero of its encoder; relative error of a servo's stiffness, damping of a
servo; relative error of a link's mass and inertia; delay of all commands."""
TAKEN = {"armature": "armature", "damping": "damping", "friction": "frictionloss"}
"""Attribute of a joint by kind: what it has may be taken away, too."""
LARGEST = 200
"""Largest number of states in which the sizes are computed."""
LEAST = 1e-3
"""Least share of the largest effort or inertia that counts as the size of a joint's."""


class Sizes(NamedTuple):
    """Typical sizes along the log, in SI units: inertia, effort and speed of each joint."""

    inertia: Mapping[str, float]
    effort: Mapping[str, float]
    speed: Mapping[str, float]


@dataclass(frozen=True)
class Free:
    """A free parameter.

    Attributes:
        key: kind, or kind and element.
        scale: typical size in SI units.
        low, high: bounds in SI units.
    """

    key: str
    scale: float
    low: float
    high: float


def expand(study: Study, kinds: Sequence[str], shared: bool = False) -> list[Free]:
    """Free parameters of some kinds, one for each element of the machine.

    Args:
        study: a prepared study.
        kinds: keys of `ACTS_ON`.
        shared: whether all elements share one parameter of each kind.
    """
    sizes = find_sizes(study)
    found = []
    for kind in kinds:
        names = _elements(study, ACTS_ON[kind])
        scales = {name: _scale(kind, name, sizes) for name in names}
        nominal = {name: _nominal(study, kind, name) for name in names}
        if len(names) == 1 or (shared and names):
            scales, nominal = {"": max(scales.values())}, {"": max(nominal.values())}
        for name, scale in scales.items():
            low, high = _bounds(kind, scale, nominal[name])
            found.append(Free(f"{kind} {name}".strip(), scale, low, high))
    return found


def _elements(study: Study, acts_on: str) -> list[str]:
    spec = study.spec()
    if acts_on == MACHINE:
        return [""]
    if acts_on == JOINT:
        joints = [joint.name for joint in spec.joints]
        efforts = {channel.sensor for channel in study.channels if channel.kind == "effort"}
        return [name for name in joints if name in efforts] if study.inverse else joints
    if acts_on == SERVO:
        return [actuator.name for actuator in spec.actuators if actuator.biasprm[1] != 0.0]
    model = spec.compile()
    return [body.name for body in spec.bodies if model.body(body.id).weldid[0] and _mass(body)]


def _mass(body: mujoco.MjsBody) -> bool:
    return bool(body.explicitinertial) or any(True for _ in body.geoms)


def _scale(kind: str, name: str, sizes: Sizes) -> float:
    if kind in ("mass", "gain"):
        return 0.3
    if kind == "delay":
        return 0.02
    if kind == "bias":
        return 0.05
    if kind == "servo_damping":
        effort, speed = max(sizes.effort.values()), max(sizes.speed.values())
        return 0.2 * effort / speed
    return {
        "armature": 0.3 * sizes.inertia[name],
        "damping": 0.2 * sizes.effort[name] / sizes.speed[name],
        "friction": 0.2 * sizes.effort[name],
        "offset": 0.1 * sizes.effort[name],
    }[kind]


def _nominal(study: Study, kind: str, name: str) -> float:
    """Return what the model has of a property of a joint, which a fit may take away."""
    if kind not in TAKEN:
        return 0.0
    joint = study.spec().joint(name)
    return float(np.ravel(getattr(joint, TAKEN[kind]))[0])


def _bounds(kind: str, scale: float, nominal: float) -> tuple[float, float]:
    if kind in ("bias", "offset"):
        return -10.0 * scale, 10.0 * scale
    if kind in ("mass", "gain"):
        return -0.999, 3.0
    return -nominal, 20.0 * scale


def find_sizes(study: Study) -> Sizes:
    """Find the typical sizes of a prepared machine along its log."""
    readings = measured(study)
    spec = study.spec()
    plant = Plant(spec, Effects())
    play = inverse_replay if study.inverse else replay
    records = play(plant, study, readings).records
    model = spec.compile()
    efforts = np.sqrt(np.mean(np.vstack([_efforts(model, r) for r in records]) ** 2, axis=0))
    speeds = np.sqrt(np.mean(np.concatenate([r.qvel for r in records]) ** 2, axis=0))
    for c, channel in enumerate(study.channels):
        if channel.kind == "effort":
            dof = model.joint(channel.sensor).dofadr[0]
            size = float(np.sqrt(np.mean(readings.value[readings.channel == c] ** 2)))
            efforts[dof] = max(efforts[dof], size)
    efforts = np.maximum(efforts, LEAST * efforts.max())
    inertia = np.maximum(model.dof_M0, LEAST * model.dof_M0.max())
    speeds = np.maximum(speeds, 1e-3)
    dofs = {joint.name: int(model.joint(joint.name).dofadr[0]) for joint in spec.joints}
    return Sizes(
        *(
            {name: float(size[dof]) for name, dof in dofs.items()}
            for size in (inertia, efforts, speeds)
        )
    )


def _efforts(model: mujoco.MjModel, record: Record) -> Floats:
    """Efforts of the actuators, or else of the model along its motion, shape (n, nv)."""
    some = np.unique(np.linspace(0, len(record.time) - 1, LARGEST).astype(int))
    data = mujoco.MjData(model)
    acceleration = np.gradient(record.qvel, record.time, axis=0)
    rows = []
    for k in some:
        data.qpos, data.qvel = record.qpos[k], record.qvel[k]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        rows.append(data.qfrc_bias + model.dof_M0 * acceleration[k])
        if model.nu:
            rows[-1] = _moments(model, data).T @ record.force[k]
    return np.array(rows)


def _moments(model: mujoco.MjModel, data: mujoco.MjData) -> Floats:
    """Moment arms of the actuators, shape (nu, nv)."""
    dense = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        dense,
        data.actuator_moment.ravel(),
        data.moment_rownnz,
        data.moment_rowadr,
        data.moment_colind.ravel(),
    )
    return dense


def predict(study: Study, readings: Measured, values: Mapping[str, float]) -> Floats:
    """Predict the readings of a prepared study, shape (n,).

    Args:
        study: the study.
        readings: its readings.
        values: parameters by key in SI units; mass and gain are relative errors.
    """
    spec = study.spec()

    def value(kind: str, name: str) -> float:
        return values.get(kind, 0.0) + values.get(f"{kind} {name}", 0.0)

    for joint in spec.joints:
        joint.armature = max(joint.armature + value("armature", joint.name), 0.0)
        joint.damping[0] = max(joint.damping[0] + value("damping", joint.name), 0.0)
        joint.frictionloss = max(joint.frictionloss + value("friction", joint.name), 0.0)
    for body in spec.bodies:
        _scale_mass(body, 1.0 + value("mass", body.name))
    for actuator in spec.actuators:
        if actuator.biasprm[1] != 0.0:
            factor = 1.0 + value("gain", actuator.name)
            actuator.gainprm[0] *= factor
            actuator.biasprm[1] *= factor
            actuator.biasprm[2] -= value("servo_damping", actuator.name)
    joints = [joint.name for joint in spec.joints]
    bias = {name: value("bias", name) for name in joints}
    offset = {name: value("offset", name) for name in joints}
    plant = Plant(spec, _effects(study, bias, offset, values.get("delay", 0.0)))
    if study.inverse:
        return inverse_replay(plant, study, readings).prediction
    return replay(plant, study, readings).prediction


def _scale_mass(body: mujoco.MjsBody, factor: float) -> None:
    """Multiply mass and inertia of a link."""
    if body.explicitinertial:
        body.mass *= factor
        body.inertia *= factor
        body.fullinertia *= factor
    for geom in body.geoms:  # whose mass is NaN if it follows from the density
        geom.mass *= factor
        geom.density *= factor


def _effects(
    study: Study, bias: Mapping[str, float], offset: Mapping[str, float], delay: float
) -> Effects:
    effects = Effects()

    def command(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        late = np.column_stack([np.interp(time - delay, time, column) for column in command.T])
        for k in range(model.nu):
            servo = model.actuator_biasprm[k, 1] != 0.0
            if servo and model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_JOINT:
                late[:, k] -= bias[model.joint(model.actuator_trnid[k, 0]).name]
        return late

    def reading(record: Record) -> None:
        model = record.model
        for channel in study.channels:
            sensor = model.sensor(channel.sensor)
            if sensor.type[0] == mujoco.mjtSensor.mjSENS_JOINTPOS:
                column = record.column(channel.sensor, channel.component)
                record.sensors[:, column] += bias[model.joint(sensor.objid[0]).name]

    def effort(model: mujoco.MjModel, time: Floats, effort: Floats) -> None:
        for name, size in offset.items():
            column = effort[:, model.joint(name).dofadr[0]]
            column[:] = np.interp(time - delay, time, column) + size

    if study.inverse:
        effects.efforts.append(effort)
    else:
        effects.commands.append(command)
        effects.readings.append(reading)
    return effects
