"""The machine as its model has it, looked at once: what moves, what pulls, what is read."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.study.data import Study


@dataclass(frozen=True)
class ActuatedTendon:
    """A tendon that an actuator pulls.

    Attributes:
        name: of the tendon.
        actuator: name of the actuator on it.
        length_sensors: sensors that read its length (tendonpos).
        tension_sensors: sensors that read its force (actuatorfrc, tendonactuatorfrc).
        servo: the actuator feeds the tendon's length back (an affine bias on it), so that an
            error of the encoder moves the machine.
        gain: force per metre of length, -biasprm[1] [N/m]; 0 without servo.
        length0: length in the model's ``qpos0`` [m].
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


@dataclass(frozen=True)
class System:
    """What causes ask of a machine.

    Attributes:
        study: with model and data.
        model: the study's model, compiled, unchanged; read-only by agreement.
        tendons: those with an actuator.
        joints: names of hinge and slide joints.
        bodies: names of bodies that move and have mass.
        sensed: names of the sensors that the study measured.
        duration: of the longest episode [s].
    """

    study: Study
    model: mujoco.MjModel
    tendons: tuple[ActuatedTendon, ...]
    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    sensed: tuple[str, ...]
    duration: float

    def tendon(self, name: str) -> ActuatedTendon:
        """The actuated tendon of a name."""
        return next(tendon for tendon in self.tendons if tendon.name == name)


def look_at(study: Study) -> System:
    """Compile the study's model and name its parts."""
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
    """The actuators that take a command, in the order of a command's columns; one column each."""
    return tuple(np.flatnonzero(model.actuator_ctrlnum).tolist())


def column(model: mujoco.MjModel, actuator: str) -> int:
    """The column of an actuator's command."""
    return int(model.actuator_ctrladr[model.actuator(actuator).id])
