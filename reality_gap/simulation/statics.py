"""What a machine at rest would read, and which forces would be left over, in any posture.

Nothing is simulated: joints are put where a hypothesis has them. Forces that were measured stand
for those of the actuators, since a model whose wires are a few millimetres wrong would have its
stiff motors pull the machine to somewhere else. What the ends of a joint's range take up is as in
the model's own balance.
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
"""Time between two moments [s], so that nothing changes from one to the next at any rate."""


@dataclass(frozen=True)
class Balance:
    """A machine at k moments of rest.

    Attributes:
        reading: (k, c) by channel in SI units.
        torque: (k, nv) sum of all forces on the joints [N m or N].
        arms: (k, nu, nv) force on the joints by each actuator's; those without input, such as
            bristles, hold nothing.
        force: (k, nu) of the same actuators [N or N m].
        weight: (k, nv) of gravity and springs on the joints [N m or N].
    """

    reading: Floats
    torque: Floats
    arms: Floats
    force: Floats
    weight: Floats


class Statics:
    """Looks at a machine at moments of rest.

    Args:
        system: the machine.
        moments: of rest.

    Attributes:
        moments: of rest.
        forces: channels that read an actuator's force, each with the index of the actuator.
        positions: (c,) which channels read what the positions of joints make of it.
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

    def look(self, plant: Plant, qpos: Floats) -> Balance:
        """The machine with its joints at ``qpos`` (k, nq)."""
        record, weight, held, arms = self._location(plant.spec.compile(), qpos)
        for channel, actuator in self.forces:
            measured = self.moments.value[:, channel]
            known = np.isfinite(measured)
            record.force[known, actuator] = measured[known]
            record.sensors[known, self._columns[channel]] = measured[known]
        felt = record.sensors[:, self._columns].copy()
        for sense in plant.effects.readings:
            sense(record)
        reading = record.sensors[:, self._columns].copy()
        for channel, actuator in self.forces:  # the force is what was read, less what reads wrong
            record.force[:, actuator] -= reading[:, channel] - felt[:, channel]
        driven = record.model.actuator_ctrlnum > 0
        arms, force = arms[:, driven], record.force[:, driven]
        torque = weight + held + np.einsum("kuv,ku->kv", arms, force)
        return Balance(self._align(reading), torque, arms, force, weight)

    def _location(
        self, model: mujoco.MjModel, qpos: Floats
    ) -> tuple[Record, Floats, Floats, Floats]:
        """Record, weight, what constraints hold, and arms, with joints at ``qpos`` (k, nq)."""
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
        weight, held = np.zeros((k, model.nv)), np.zeros((k, model.nv))
        arms = np.zeros((k, model.nactuator, model.nv))
        for i, (joints, command) in enumerate(zip(qpos, self.moments.command, strict=True)):
            data.qpos[:], data.ctrl[:] = joints, command
            mujoco.mj_forward(model, data)
            record.sensors[i], record.force[i] = data.sensordata, data.actuator_force
            record.length[i] = data.ten_length
            weight[i] = data.qfrc_passive - data.qfrc_bias
            held[i] = data.qfrc_constraint
            mujoco.mju_sparse2dense(
                arms[i],
                data.actuator_moment,
                data.moment_rownnz,
                data.moment_rowadr,
                data.moment_colind,
            )
        return record, weight, held, arms

    def _align(self, reading: Floats) -> Floats:
        """A quaternion and its negative are one: the one nearer to what was measured."""
        for four in self._quaternions:
            measured = self.moments.value[:, four]
            away = np.nansum(reading[:, four] * measured, axis=1) < 0
            reading[np.ix_(away, four)] *= -1
        return reading


def _forces(
    system: System, channels: Sequence[Channel], kinds: Ints
) -> tuple[tuple[int, int], ...]:
    """Channels that read the force of one actuator, with its index."""
    model, found = system.model, []
    pulled = [tendon.name for tendon in system.tendons]
    tendons = {s: w for w in system.tendons for s in w.tension_sensors if pulled.count(w.name) == 1}
    for c, channel in enumerate(channels):
        if kinds[c] == int(mujoco.mjtSensor.mjSENS_ACTUATORFRC):
            found.append((c, int(model.sensor(channel.sensor).objid[0])))
        elif channel.sensor in tendons:
            found.append((c, int(model.actuator(tendons[channel.sensor].actuator).id)))
    return tuple(found)


def _quaternions(channels: Sequence[Channel], kinds: Ints) -> list[Ints]:
    """Channels (4,) of each sensor that reads a whole quaternion."""
    turns = [int(mujoco.mjtSensor.mjSENS_FRAMEQUAT), int(mujoco.mjtSensor.mjSENS_BALLQUAT)]
    names = np.array([channel.sensor for channel in channels])
    chosen = dict.fromkeys(names[np.isin(kinds, turns)])
    found = [np.flatnonzero(names == name) for name in chosen]
    return [four for four in found if len(four) == 4]
