"""Encoders: what reads the position of a wire or joint, and the actuator that feeds it back."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.causes.base import Location, Record
from reality_gap.causes.support.model_overrides import Extra
from reality_gap.study.system import System, commanded
from reality_gap.types import Floats


@dataclass(frozen=True)
class Encoder:
    """What reads the length of a wire or the position of a joint.

    Attributes:
        kind: "tendon" or "joint".
        element: its name.
        sensors: measured sensors that read it.
        actuator: the affine actuator that feeds it back; empty where there is none.
    """

    kind: str
    element: str
    sensors: tuple[str, ...]
    actuator: str


def encoders(system: System, location: Location) -> tuple[Encoder, ...]:
    """One for each element of a place of wires or joints."""
    of_one = _of_tendon if location.kind == "tendon" else _of_joint
    return tuple(of_one(system, name) for name in location.elements)


def matters(encoder: Encoder) -> bool:
    """Whether a wrong reading would show: in a measured channel or in the motion."""
    return bool(encoder.sensors or encoder.actuator)


def _of_tendon(system: System, name: str) -> Encoder:
    tendon = system.tendon(name)
    return Encoder("tendon", name, tendon.length_sensors, tendon.actuator if tendon.servo else "")


def _of_joint(system: System, joint: str) -> Encoder:
    model = system.model
    here = model.joint(joint).id
    servos = [
        model.actuator(i).name
        for i in commanded(model)
        if int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_JOINT)
        and int(model.actuator_trnid[i, 0]) == here
        and int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        and model.actuator_biasprm[i, 1] != 0.0
    ]
    sensors = tuple(
        name
        for name in system.sensed
        if int(model.sensor(name).type[0]) == int(mujoco.mjtSensor.mjSENS_JOINTPOS)
        and int(model.sensor(name).objid[0]) == here
    )
    return Encoder("joint", joint, sensors, servos[0] if servos else "")


def recorded(record: Record, encoder: Encoder) -> Floats:
    """Its true position along a record (k,) [m or rad]."""
    if encoder.kind == "tendon":
        return record.length[:, record.model.tendon(encoder.element).id]
    return record.qpos[:, record.model.joint(encoder.element).qposadr[0]]


def add_to_reading(record: Record, encoder: Encoder, error: Floats) -> None:
    """Add an error (k,) to what its sensors read."""
    for sensor in encoder.sensors:
        record.sensors[:, record.column(sensor)] += error


class Feedback:
    """The position feedback of encoders in a model, for hooks that falsify it.

    An affine actuator's force is ``gain ctrl + bias[0] + bias[1] position``, so that an error of
    the position is one of ``bias[0]``; that way it passes neither the actuator's dynamics nor the
    range of ctrl.

    Args:
        model: whose biases it writes.
        chosen: encoders of one kind; those that are not fed back are looked at only.

    Attributes:
        slope: (k,) of those fed back: force of the actuator per unit of position [N/m or N].
    """

    def __init__(self, model: mujoco.MjModel, chosen: tuple[Encoder, ...]) -> None:
        self._of_tendons = chosen[0].kind == "tendon"
        self._fresh = False
        self._elements = np.array([_index(model, encoder) for encoder in chosen])
        self._fed = np.flatnonzero([bool(encoder.actuator) for encoder in chosen])
        actuators = [model.actuator(chosen[i].actuator).id for i in self._fed]
        self.slope = model.actuator_biasprm[actuators, 1] * model.actuator_gear[actuators, 0]
        self._bias = Extra(model.actuator_biasprm[:, 0], np.array(actuators, dtype=np.int64))

    def position(self, model: mujoco.MjModel, data: mujoco.MjData) -> Floats:
        """True positions (n,) [m or rad] before a step; a wire's length is carried on to now."""
        if not self._of_tendons:
            return data.qpos[self._elements]
        if not self._fresh:
            mujoco.mj_fwdPosition(model, data)
            self._fresh = True
        here = self._elements
        return data.ten_length[here] + model.opt.timestep * data.ten_velocity[here]

    def falsify(self, error: Floats) -> None:
        """Let the actuators see positions that are wrong by ``error`` (n,), until the next call."""
        self._bias.write(self.slope * error[self._fed])


def _index(model: mujoco.MjModel, encoder: Encoder) -> int:
    if encoder.kind == "tendon":
        return int(model.tendon(encoder.element).id)
    return int(model.joint(encoder.element).qposadr[0])
