"""Encoders: sensors of a tendon's length or a joint's position, and the servo that uses them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.causes.base import Location, Record
from reality_gap.causes.support import elements
from reality_gap.causes.support.model_overrides import ModelOffset
from reality_gap.study.system import System, commanded
from reality_gap.types import Floats

READING = "reading only"
"""Note of a location where the servo's feedback is right."""
POSITION = "position only"
"""Note of a location where speeds, of readings and of the servo, are right: they have another
source, such as a tachometer, or the servo's damping is that of its motor (back-EMF)."""
EXACT = 0.2
"""Tolerance of an error of the reading alone, or of positions alone, over that of the encoder: a
log has the readings that the servo uses, and all deviate together."""


@dataclass(frozen=True)
class Encoder:
    """The encoder of a tendon or joint.

    Attributes:
        kind: "tendon" or "joint".
        element: name of the tendon or joint.
        sensors: measured sensors of its length or position.
        actuator: the affine actuator that feeds the position back; empty without one.
    """

    kind: str
    element: str
    sensors: tuple[str, ...]
    actuator: str


def encoders(system: System, location: Location) -> tuple[Encoder, ...]:
    """Return an encoder for each element of a location of tendons or joints."""
    encoder_of = _of_tendon if location.kind == "tendon" else _of_joint
    return tuple(encoder_of(system, name) for name in location.elements)


def is_used(encoder: Encoder) -> bool:
    """Return whether an error of the encoder shows in a measured channel or in the motion."""
    return bool(encoder.sensors or encoder.actuator)


def tolerance(location: Location, own: float) -> float:
    """Return the tolerance of an error at a location, from that of its encoder."""
    return EXACT * own if location.note in (READING, POSITION) else own


def readings_only(system: System, locations: Iterable[Location]) -> tuple[Location, ...]:
    """Return those of single elements whose encoder is read and feeds a servo, for its reading."""
    return tuple(
        Location(p.kind, p.elements, READING)
        for p in locations
        if len(p.elements) == 1 and all(e.sensors and e.actuator for e in encoders(system, p))
    )


def positions_only(system: System, locations: Iterable[Location]) -> tuple[Location, ...]:
    """Return those of single elements whose servo is damped or whose speed is read, for positions.

    Scales of encoders differ there from those that speeds have, too.
    """
    found = list[Location]()
    for location in locations:
        if len(location.elements) == 1:
            [encoder] = encoders(system, location)
            servo = encoder.actuator
            damped = servo and bool(system.model.actuator(servo).biasprm[2])
            has_speed = encoder.kind == "joint" and speed_sensors(system, encoder.element)
            if encoder.sensors and (damped or has_speed):
                found.append(Location(location.kind, location.elements, POSITION))
    return tuple(found)


def joints_with_encoders(system: System) -> tuple[Location, ...]:
    """Return the joints an error of whose encoder shows; all, if efforts are computed along it."""
    return tuple(
        joint
        for joint in elements.each_joint(system)
        if system.study.inverse or is_used(*encoders(system, joint))
    )


def true_position(record: Record, encoder: Encoder) -> Floats:
    """Return the true position of an encoder's element along a record, shape (k,) [m or rad]."""
    if encoder.kind == "tendon":
        return record.length[:, record.model.tendon(encoder.element).id]
    return record.qpos[:, record.model.joint(encoder.element).qposadr[0]]


def add_to_reading(record: Record, encoder: Encoder, error: Floats) -> None:
    """Add an error, shape (k,), to the readings of an encoder."""
    for sensor in encoder.sensors:
        record.sensors[:, record.column(sensor)] += error


def zero(system: System, joint: str) -> float:
    """Return the position of a joint at which its encoder is zeroed [rad or m]."""
    return float(system.model.joint(joint).qpos0[0])


def speed_sensors(system: System, joint: str) -> tuple[str, ...]:
    """Return the measured sensors of a joint's velocity, which come from its encoder."""
    model = system.model
    return tuple(
        name
        for name in system.sensed
        if int(model.sensor(name).type[0]) == int(mujoco.mjtSensor.mjSENS_JOINTVEL)
        and int(model.sensor(name).objid[0]) == model.joint(joint).id
    )


class Feedback:
    """Position feedback of encoders in a model, for hooks that let it be wrong.

    The force of an affine actuator is ``gain ctrl + bias[0] + bias[1] position``, so that an error
    of the position is equivalent to an offset of ``bias[0]``. This offset is not subject to the
    dynamics of the actuator or to the range of ctrl.

    Args:
        model: the model whose biases are written.
        chosen: encoders of one kind; those without an actuator only have a position.

    Attributes:
        slope: force per position of each encoder with an actuator, shape (k,) [N/m or N m/rad].
    """

    def __init__(self, model: mujoco.MjModel, chosen: tuple[Encoder, ...]) -> None:
        self._of_tendons = chosen[0].kind == "tendon"
        self._fresh = False
        self._elements = np.array([_index(model, encoder) for encoder in chosen])
        self._fed = np.flatnonzero([bool(encoder.actuator) for encoder in chosen])
        actuators = [model.actuator(chosen[i].actuator).id for i in self._fed]
        self.slope = model.actuator_biasprm[actuators, 1] * model.actuator_gear[actuators, 0]
        self._bias = ModelOffset(model.actuator_biasprm[:, 0], np.array(actuators, dtype=np.int64))

    def position(self, model: mujoco.MjModel, data: mujoco.MjData) -> Floats:
        """Return the true positions before a step, shape (n,) [m or rad].

        MuJoCo's lengths of tendons are those of the previous step; they are extrapolated.
        """
        if not self._of_tendons:
            return data.qpos[self._elements]
        if not self._fresh:
            mujoco.mj_fwdPosition(model, data)
            self._fresh = True
        ids = self._elements
        return data.ten_length[ids] + model.opt.timestep * data.ten_velocity[ids]

    def set_error(self, error: Floats) -> None:
        """Let actuators feed back positions that are wrong by ``error``, shape (n,)."""
        self._bias.set(self.slope * error[self._fed])


def _of_tendon(system: System, name: str) -> Encoder:
    tendon = system.tendon(name)
    return Encoder("tendon", name, tendon.length_sensors, tendon.actuator if tendon.servo else "")


def _of_joint(system: System, joint: str) -> Encoder:
    model = system.model
    id_ = model.joint(joint).id
    servos = [
        model.actuator(i).name
        for i in commanded(model)
        if int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_JOINT)
        and int(model.actuator_trnid[i, 0]) == id_
        and int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        and model.actuator_biasprm[i, 1] != 0.0
    ]
    sensors = tuple(
        name
        for name in system.sensed
        if int(model.sensor(name).type[0]) == int(mujoco.mjtSensor.mjSENS_JOINTPOS)
        and int(model.sensor(name).objid[0]) == id_
    )
    return Encoder("joint", joint, sensors, servos[0] if servos else "")


def _index(model: mujoco.MjModel, encoder: Encoder) -> int:
    if encoder.kind == "tendon":
        return int(model.tendon(encoder.element).id)
    return int(model.joint(encoder.element).qposadr[0])
