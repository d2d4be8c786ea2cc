"""System: the elements of a compiled model that causes refer to."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from reality_gap.study.data import Study

_SENSOR = mujoco.mjtSensor
_FORCES = (
    *(_SENSOR.mjSENS_ACTUATORFRC, _SENSOR.mjSENS_JOINTACTFRC, _SENSOR.mjSENS_TENDONACTFRC),
    *(_SENSOR.mjSENS_FORCE, _SENSOR.mjSENS_TORQUE),
)


@dataclass(frozen=True)
class ActuatedTendon:
    """A tendon that an actuator pulls.

    Attributes:
        name: name of the tendon.
        actuator: name of its actuator.
        length_sensors: measured sensors of its length (tendonpos).
        tension_sensors: measured sensors of its force (actuatorfrc, tendonactuatorfrc).
        servo: whether the actuator feeds the tendon's length back through an affine bias; an
            error of the encoder then moves the machine.
        gain: force per length, -biasprm[1] times the gear [N/m]; 0 without servo.
        length0: length at the model's ``qpos0`` [m].
        sites: names of the sites of its path, in order.
    """

    name: str
    actuator: str
    length_sensors: tuple[str, ...]
    tension_sensors: tuple[str, ...]
    servo: bool
    gain: float
    length0: float
    sites: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class System:
    """A study with its compiled model and the names of the elements that causes act on.

    Systems are compared by identity, so that what follows from one is computed once.

    Attributes:
        study: model and data.
        model: the study's nominal model, compiled; it is shared, do not edit it.
        tendons: tendons with an actuator.
        joints: names of hinge and slide joints.
        bodies: names of bodies that move and have mass.
        sensed: names of the sensors that the study measured.
        duration: duration of the longest episode [s].
    """

    study: Study
    model: mujoco.MjModel
    tendons: tuple[ActuatedTendon, ...]
    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    sensed: tuple[str, ...]
    duration: float

    def tendon(self, name: str) -> ActuatedTendon:
        """Return the actuated tendon of this name."""
        return next(tendon for tendon in self.tendons if tendon.name == name)


def with_step(system: System, step: float) -> System:
    """Return the same system with another physics step, relative to that of its model."""
    model = copy(system.model)
    model.opt.timestep *= step
    return replace(system, model=model)


def compile_system(study: Study) -> System:
    """Compile the study's model and collect the names of its elements."""
    model = study.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    sensed = tuple(dict.fromkeys(c.sensor for c in study.channels if c.kind == "sensor"))
    simple = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    moving = [
        i for i in range(1, model.nbody) if model.body_weldid[i] != 0 and model.body_mass[i] > 0
    ]
    return System(
        study=study,
        model=model,
        tendons=_tendons(model, data, sensed),
        joints=tuple(
            model.joint(i).name for i in range(model.njnt) if int(model.jnt_type[i]) in simple
        ),
        bodies=tuple(model.body(i).name for i in moving),
        sensed=sensed,
        duration=max(episode.duration for episode in study.episodes),
    )


def _tendons(
    model: mujoco.MjModel, data: mujoco.MjData, sensed: tuple[str, ...]
) -> tuple[ActuatedTendon, ...]:
    tendons = []
    for i in commanded(model):
        if int(model.actuator_trntype[i]) != int(mujoco.mjtTrn.mjTRN_TENDON):
            continue
        tendon = int(model.actuator_trnid[i, 0])
        feedback = float(model.actuator_biasprm[i, 1] * model.actuator_gear[i, 0])
        affine = int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        servo = affine and feedback != 0.0
        tendons.append(
            ActuatedTendon(
                name=model.tendon(tendon).name,
                actuator=model.actuator(i).name,
                length_sensors=_sensors(model, sensed, mujoco.mjtSensor.mjSENS_TENDONPOS, tendon),
                tension_sensors=_sensors(model, sensed, mujoco.mjtSensor.mjSENS_ACTUATORFRC, i)
                + _sensors(model, sensed, mujoco.mjtSensor.mjSENS_TENDONACTFRC, tendon),
                servo=servo,
                gain=-feedback if servo else 0.0,
                length0=float(data.ten_length[tendon]),
                sites=_path_sites(model, tendon),
            )
        )
    return tuple(tendons)


def _sensors(
    model: mujoco.MjModel, sensed: tuple[str, ...], kind: mujoco.mjtSensor, element: int
) -> tuple[str, ...]:
    return tuple(
        name
        for name in sensed
        if int(model.sensor(name).type[0]) == int(kind)
        and int(model.sensor(name).objid[0]) == element
    )


def _path_sites(model: mujoco.MjModel, tendon: int) -> tuple[str, ...]:
    start, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
    wraps = range(start, start + count)
    sites = np.array([int(mujoco.mjtWrap.mjWRAP_SITE)])
    return tuple(
        model.site(int(model.wrap_objid[i])).name for i in wraps if model.wrap_type[i] in sites
    )


def commanded(model: mujoco.MjModel) -> tuple[int, ...]:
    """Return the ids of the actuators that take a command, in the order of the command columns."""
    return tuple(np.flatnonzero(model.actuator_ctrlnum).tolist())


def command_limits(model: mujoco.MjModel, actuator: int) -> tuple[float, float]:
    """Return the least and the largest command that acts; infinite ones without limits or input."""
    i = int(model.actuator_ctrladr[actuator])  # MuJoCo has them by input, which not all have
    free = int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    if free or not model.actuator_ctrlnum[actuator] or not model.actuator_ctrllimited[i]:
        return -math.inf, math.inf
    low, high = model.actuator_ctrlrange[i]
    return float(low), float(high)


def column(model: mujoco.MjModel, actuator: str) -> int:
    """Return the index of an actuator's column in the commands."""
    return int(model.actuator_ctrladr[model.actuator(actuator).id])


def measures_forces(system: System) -> bool:
    """Return whether any force, torque or effort is measured.

    If none is, a machine moves the same with all masses and forces twice as large.
    """
    kinds = {int(system.model.sensor(name).type[0]) for name in system.sensed}
    efforts = any(one.kind == "effort" for one in system.study.channels)
    return efforts or bool(kinds & {int(kind) for kind in _FORCES})
