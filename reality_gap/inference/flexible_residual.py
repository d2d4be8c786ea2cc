"""Flexible residual: what any mechanism could explain of a residual, in the catalogue or not.

Banks of functions stand for the mechanisms that the catalogue lacks:

- a torque at each joint that is any function of its position, with or without its direction of
  motion,
- a force on each tendon that is any function of its length, measured by its tension sensor or not,
- readings of a channel that depend on those of another channel,
- errors of a channel that are constant, or any function of a joint's position, or a slow one of the
  time,
- in logs of efforts, errors of a joint's position that are a slow function of the time.

Forces are simulated, unless efforts are compared; their effects on the readings are the columns of
a bank, of which `reality_gap.inference.learned_residual` learns a few.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.causes.base import Record
from reality_gap.causes.support import typical_scales
from reality_gap.inference.effort_residual import effort_banks
from reality_gap.inference.motion_functions import (
    MOST,
    Bank,
    bank,
    functions_of_position,
    moving_joints,
    slow_waves,
    unit_size,
    wave_count,
)
from reality_gap.inference.unmodelled_forces import unit_force, unmodelled_force
from reality_gap.simulation.hypothesis import Hypothesis, build
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import Measured
from reality_gap.study.system import ActuatedTendon, System
from reality_gap.types import Floats

PITCH = 0.0415
"""Shortest wave over the length of a tendon, over the typical travel of tendons."""
MOST_CHANNELS = 20
"""Largest number of channels whose dependence on each other is tried."""
MOST_JOINTS = 3
"""Largest number of moving joints for which errors of channels by position are tried."""


def banks(replayer: Replayer, base: Hypothesis, records: Sequence[Record]) -> tuple[Bank, ...]:
    """Return all banks.

    Args:
        replayer: replays of the study.
        base: the hypothesis whose remainder is to be learned.
        records: simulated signals of ``base`` in each episode.
    """
    if replayer.system.study.inverse:
        own = effort_banks(replayer, base, records)
    else:
        own = [*_errors(replayer, records), *_forces(replayer, base, records)]
    return (_crosstalk(replayer), _drifts(replayer, records), *own)


def _crosstalk(replayer: Replayer) -> Bank:
    """Return the bank in which each channel depends on each other channel."""
    measured, count = replayer.measured, len(replayer.system.study.channels)
    columns = []
    for source in range(count):
        signal = _signal(measured, source)
        for channel in range(count):
            if channel != source and count <= MOST_CHANNELS:
                columns.append(np.where(measured.channel == channel, signal, 0.0))
    stacked = np.column_stack(columns) if columns else np.zeros((len(measured.value), 0))
    return Bank("readings of each other", unit_size(stacked))


def _signal(measured: Measured, channel: int) -> Floats:
    """Return the readings of a channel at the times of all readings, shape (n,)."""
    signal = np.zeros(len(measured.value))
    for e in np.unique(measured.episode):
        here = measured.episode == e
        own = here & (measured.channel == channel)
        if own.any():
            signal[here] = np.interp(measured.time[here], measured.time[own], measured.value[own])
    return signal


def _errors(replayer: Replayer, records: Sequence[Record]) -> list[Bank]:
    """Return the banks in which a channel has an error that depends on a joint's position."""
    measured = replayer.measured
    moving = moving_joints(replayer.system, records)
    found = []
    for name in moving:
        at = records[0].model.joint(name).qposadr[0]
        position = np.zeros(len(measured.value))
        for e, record in enumerate(records):
            here = measured.episode == e
            now = measured.time[here] + record.time[0]
            position[here] = np.interp(now, record.time, record.qpos[:, at])
        phase = (position - position.min()) / np.ptp(position)
        waves = np.cos(np.pi * phase[:, None] * np.arange(2, wave_count(moving) + 1))
        columns = [
            np.where((measured.channel == c)[:, None], waves, 0.0)
            for c in np.unique(measured.channel)
            if len(moving) <= MOST_JOINTS
        ]
        if columns:
            found.append(Bank(f"readings by position of {name}", unit_size(np.hstack(columns))))
    return found


def _drifts(replayer: Replayer, records: Sequence[Record]) -> Bank:
    """Return the bank in which a channel has an error that is constant or changes slowly."""
    channel, (waves, _) = replayer.measured.channel, slow_waves(replayer.measured, records)
    columns = [np.where((channel == c)[:, None], waves, 0.0) for c in np.unique(channel)]
    return Bank("readings by the time", unit_size(np.hstack(columns)))


def _forces(replayer: Replayer, base: Hypothesis, records: Sequence[Record]) -> list[Bank]:
    """Return the banks of forces on joints and tendons."""
    system = replayer.system
    # Hooks are slow, and a small force has about the same effect without them.
    quick = [part for part in base if not build(system, [part]).effects.hooks]
    before = replayer.residuals([quick], replayer.coarse)[0]

    moving = moving_joints(system, records)
    forces = {
        f"position of {name}": [
            unmodelled_force(system, "joint", name, records, series)
            for series in functions_of_position(records, name, wave_count(moving))
        ]
        for name in moving
    }
    along = {tendon: _by_length(system, records, tendon) for tendon in system.tendons}
    for tendon, series in along.items():
        forces[f"length of {tendon.name}"] = [
            unmodelled_force(system, "tendon", tendon.name, records, one) for one in series
        ]
    trials = [[*quick, (one, {"size": 1.0})] for some in forces.values() for one in some]
    moved = iter(replayer.residuals(trials, replayer.coarse))
    columns = {name: [before - next(moved) for _ in some] for name, some in forces.items()}
    found = [bank(name, some) for name, some in columns.items() if some]
    for tendon, series in along.items():
        readings = [_tension_readings(replayer, tendon, records, one) for one in series]
        own = columns[f"length of {tendon.name}"]
        both = [a + b for a, b in zip(own, readings, strict=True)]
        if both:
            found.append(bank(f"length of {tendon.name}, measured by its sensor", both))
    return found


def _by_length(
    system: System, records: Sequence[Record], tendon: ActuatedTendon
) -> list[list[Floats]]:
    """Return series of force by episode, in units of `unit_force`: waves over a tendon's length."""
    at = records[0].model.tendon(tendon.name).id
    length = [r.length[:, at] for r in records]
    travel = float(np.ptp(np.concatenate(length)))
    shortest = PITCH * typical_scales.tendon_travel(system)
    count = min(int(travel / shortest), MOST // (2 * len(system.tendons)))
    if count < 2:
        return []
    phase = [2 * np.pi * x / travel for x in length]
    return [[wave(m * x) for x in phase] for m in range(1, count + 1) for wave in (np.cos, np.sin)]


def _tension_readings(
    replayer: Replayer, tendon: ActuatedTendon, records: Sequence[Record], series: list[Floats]
) -> Floats:
    """Return what a force on a tendon adds to the readings of its tension (n,) [noise]."""
    measured, study = replayer.measured, replayer.system.study
    force = unit_force(replayer.system, "tendon", tendon.name) * np.concatenate(series)
    time = np.concatenate([r.time for r in records])
    start = np.array([r.time[0] for r in records])[measured.episode]
    added = np.interp(measured.time + start, time, force)
    own = [
        c for c, channel in enumerate(study.channels) if channel.sensor in tendon.tension_sensors
    ]
    return np.where(np.isin(measured.channel, own), added, 0.0) / measured.noise
