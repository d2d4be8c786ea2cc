"""Statics: readings and force balance of a plant at rest, at given joint positions.

Nothing is simulated. Where the force of an actuator was measured, the measured value replaces that
of the model: if paths of tendons are wrong by millimetres, stiff actuators of the model would pull
the machine to another posture. Forces of constraints, such as limits of joints, are those of the
model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from reality_gap.causes.base import Record
from reality_gap.simulation.hypothesis import Plant
from reality_gap.study.data import Channel
from reality_gap.study.static_poses import Moments
from reality_gap.study.system import System
from reality_gap.types import Floats, Ints

APART = 1e6
"""Time between two moments in a record [s]; it is so long that all rates are negligible."""


@dataclass(frozen=True)
class Balance:
    """Readings and forces at k moments of rest.

    Attributes:
        reading: reading of each channel in SI units, shape (k, c).
        torque: sum of all forces on the joints, shape (k, nv) [N m or N].
        arms: force on the joints per force of each commanded actuator, shape (k, nu, nv);
            actuators without command, such as bristles of friction, exert none at rest.
        force: force of the same actuators, shape (k, nu) [N or N m].
        weight: force of gravity and springs on the joints, shape (k, nv) [N m or N].
    """

    reading: Floats
    torque: Floats
    arms: Floats
    force: Floats
    weight: Floats


class Statics:
    """Computes readings and force balance at moments of rest.

    Args:
        system: the study's model and its elements.
        moments: moments of rest in the study.

    Attributes:
        moments: moments of rest in the study.
        forces: channels that measure an actuator's force, each with the index of the actuator.
        positions: whether each channel depends on the positions of joints only, shape (c,).
    """

    def __init__(self, system: System, moments: Moments) -> None:
        self.moments = moments
        model, channels = system.model, system.study.channels
        sensors = [model.sensor(channel.sensor) for channel in channels]
        kinds = np.array([int(sensor.type[0]) for sensor in sensors])
        stage = np.array([int(model.sensor_needstage[sensor.id]) for sensor in sensors])
        self.forces = _forces(system, channels, kinds)
        self.positions = stage == int(mujoco.mjtStage.mjSTAGE_POS)
        self._columns = np.array(
            [int(s.adr[0]) + c.component for s, c in zip(sensors, channels, strict=True)]
        )
        self._quaternions = _quaternions(channels, kinds)

    def balance(self, plant: Plant, qpos: Floats) -> Balance:
        """Compute readings and forces of a plant.

        Args:
            plant: the model and its effects.
            qpos: positions of the joints at each moment, shape (k, nq).
        """
        record, weight, constraint, arms = self._evaluate(plant.spec.compile(), qpos)
        for channel, actuator in self.forces:
            measured = self.moments.value[:, channel]
            known = np.isfinite(measured)
            record.force[known, actuator] = measured[known]
            record.sensors[known, self._columns[channel]] = measured[known]
        exact = record.sensors[:, self._columns].copy()
        for effect in plant.effects.readings:
            effect(record)
        reading = record.sensors[:, self._columns].copy()
        for channel, actuator in self.forces:  # the true force is the measured one less its error
            record.force[:, actuator] -= reading[:, channel] - exact[:, channel]
        driven = record.model.actuator_ctrlnum > 0
        arms, force = arms[:, driven], record.force[:, driven]
        torque = weight + constraint + np.einsum("kuv,ku->kv", arms, force)
        return Balance(self._align(reading), torque, arms, force, weight)

    def _evaluate(
        self, model: mujoco.MjModel, qpos: Floats
    ) -> tuple[Record, Floats, Floats, Floats]:
        """Return record, weight, constraint force and arms with the joints at ``qpos`` (k, nq)."""
        data, k = mujoco.MjData(model), len(qpos)
        record = Record(
            time=APART * np.arange(k, dtype=np.float64),
            sensors=np.zeros((k, model.nsensordata)),
            force=np.zeros((k, model.nactuator)),
            length=np.zeros((k, model.ntendon)),
            velocity=np.zeros((k, model.ntendon)),
            qpos=qpos.copy(),
            qvel=np.zeros((k, model.nv)),
            model=model,
        )
        weight, constraint = np.zeros((k, model.nv)), np.zeros((k, model.nv))
        arms = np.zeros((k, model.nactuator, model.nv))
        for i, (joints, command) in enumerate(zip(qpos, self.moments.command, strict=True)):
            data.qpos[:], data.ctrl[:] = joints, command
            mujoco.mj_forward(model, data)
            record.sensors[i], record.force[i] = data.sensordata, data.actuator_force
            record.length[i] = data.ten_length
            weight[i] = data.qfrc_passive - data.qfrc_bias
            constraint[i] = data.qfrc_constraint
            mujoco.mju_sparse2dense(
                arms[i],
                data.actuator_moment,
                data.moment_rownnz,
                data.moment_rowadr,
                data.moment_colind,
            )
        return record, weight, constraint, arms

    def _align(self, reading: Floats) -> Floats:
        """Flip quaternions that have the opposite sign of the measured ones; q and -q are equal."""
        for four in self._quaternions:
            measured = self.moments.value[:, four]
            flip = np.nansum(reading[:, four] * measured, axis=1) < 0
            reading[np.ix_(flip, four)] *= -1
        return reading


def _forces(
    system: System, channels: Sequence[Channel], kinds: Ints
) -> tuple[tuple[int, int], ...]:
    """Return the channels that measure the force of one actuator, each with its index."""
    model, found = system.model, []
    pulled = [tendon.name for tendon in system.tendons]
    tendons = {s: t for t in system.tendons for s in t.tension_sensors if pulled.count(t.name) == 1}
    for c, channel in enumerate(channels):
        if kinds[c] == int(mujoco.mjtSensor.mjSENS_ACTUATORFRC):
            found.append((c, int(model.sensor(channel.sensor).objid[0])))
        elif channel.sensor in tendons:
            found.append((c, int(model.actuator(tendons[channel.sensor].actuator).id)))
    return tuple(found)


def _quaternions(channels: Sequence[Channel], kinds: Ints) -> list[Ints]:
    """Return the channels (4,) of each sensor that measures a quaternion."""
    quaternion = [int(mujoco.mjtSensor.mjSENS_FRAMEQUAT), int(mujoco.mjtSensor.mjSENS_BALLQUAT)]
    names = np.array([channel.sensor for channel in channels])
    chosen = dict.fromkeys(names[np.isin(kinds, quaternion)])
    found = [np.flatnonzero(names == name) for name in chosen]
    return [four for four in found if len(four) == 4]
