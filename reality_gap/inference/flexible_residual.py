"""Flexible residual: what any mechanism could explain of a residual, in the catalogue or not.

Banks of functions stand for the mechanisms that the catalogue lacks:

- a torque at each joint that is any function of its position, with or without its direction of
  motion,
- a force on each tendon that is any function of its length, measured by its tension sensor or not,
- readings of a channel that depend on those of another channel,
- errors of a channel that are constant, or any function of a joint's position, or a slow one of the
  time.

Forces are simulated; their effects on the readings are the columns of a bank, of which
`reality_gap.inference.learned_residual` learns a few.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.causes.base import Record
from reality_gap.causes.support import typical_scales
from reality_gap.causes.support.machine_size import dof, machine_size
from reality_gap.inference.unmodelled_forces import unit_force, unmodelled_force
from reality_gap.simulation.hypothesis import Hypothesis, build
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import Measured
from reality_gap.study.system import ActuatedTendon, System
from reality_gap.types import Floats

WAVES = 28
"""Largest number of half waves over the range of a joint."""
BUMPS = 8
"""Number of positions along the range at which the direction of motion may matter."""
EDGES = (0.8, 0.9, 0.96)
"""Shares of the range from which on there may be an obstacle, from either end."""
PITCH = 0.0415
"""Shortest wave over the length of a tendon, over the typical travel of tendons."""
SLOW = 4
"""Largest number of half waves over the time of a log, for errors that drift."""
STILL = 1e-3
"""Travel of a joint that stands still, over half of its range."""
MOST = 200
"""Largest number of replays; with many joints there are fewer waves."""
MOST_CHANNELS = 20
"""Largest number of channels whose dependence on each other is tried."""
MOST_JOINTS = 3
"""Largest number of moving joints for which errors of channels by position are tried."""


@dataclass(frozen=True)
class Bank:
    """Functions of one kind.

    Attributes:
        name: what they are functions of.
        columns: change of the readings by each function in units of noise, scaled to a mean square
            of 1, shape (n, k).
    """

    name: str
    columns: Floats


def banks(replayer: Replayer, base: Hypothesis, records: Sequence[Record]) -> tuple[Bank, ...]:
    """Return all banks.

    Args:
        replayer: replays of the study.
        base: the hypothesis whose remainder is to be learned.
        records: simulated signals of ``base`` in each episode.
    """
    found = [_crosstalk(replayer), _drifts(replayer, records), *_errors(replayer, records)]
    if not replayer.system.study.inverse:
        found += _forces(replayer, base, records)
    return tuple(found)


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
    return Bank("readings of each other", _unit(stacked))


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
    moving = _moving(replayer.system, records)
    found = []
    for name in moving:
        at = records[0].model.joint(name).qposadr[0]
        position = np.zeros(len(measured.value))
        for e, record in enumerate(records):
            here = measured.episode == e
            now = measured.time[here] + record.time[0]
            position[here] = np.interp(now, record.time, record.qpos[:, at])
        phase = (position - position.min()) / np.ptp(position)
        waves = np.cos(np.pi * phase[:, None] * np.arange(2, _wave_count(moving) + 1))
        columns = [
            np.where((measured.channel == c)[:, None], waves, 0.0)
            for c in np.unique(measured.channel)
            if len(moving) <= MOST_JOINTS
        ]
        if columns:
            found.append(Bank(f"readings by position of {name}", _unit(np.hstack(columns))))
    return found


def _drifts(replayer: Replayer, records: Sequence[Record]) -> Bank:
    """Return the bank in which a channel has an error that is constant or changes slowly."""
    measured = replayer.measured
    time = measured.time + np.array([r.time[0] for r in records])[measured.episode]
    phase = (time - time.min()) / max(float(np.ptp(time)), 1e-9)
    waves = np.cos(np.pi * phase[:, None] * np.arange(SLOW + 1))
    columns = [
        np.where((measured.channel == c)[:, None], waves, 0.0) for c in np.unique(measured.channel)
    ]
    return Bank("readings by the time", _unit(np.hstack(columns)))


def _moving(system: System, records: Sequence[Record]) -> list[str]:
    half = machine_size(system).travel
    return [n for n in system.joints if _travel(records, n) > STILL * half[dof(system, n)]]


def _wave_count(moving: Sequence[str]) -> int:
    return min(WAVES, max(4, MOST // (2 * len(moving))))


def _forces(replayer: Replayer, base: Hypothesis, records: Sequence[Record]) -> list[Bank]:
    """Return the banks of forces on joints and tendons."""
    system = replayer.system
    # Hooks are slow, and a small force has about the same effect without them.
    quick = [part for part in base if not build(system, [part]).effects.hooks]
    before = replayer.residuals([quick], replayer.coarse)[0]

    moving = _moving(system, records)
    forces = {
        f"position of {name}": [
            unmodelled_force(system, "joint", name, records, series)
            for series in _functions(records, name, _wave_count(moving))
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
    found = [_bank(name, some) for name, some in columns.items() if some]
    for tendon, series in along.items():
        readings = [_tension_readings(replayer, tendon, records, one) for one in series]
        own = columns[f"length of {tendon.name}"]
        both = [a + b for a, b in zip(own, readings, strict=True)]
        if both:
            found.append(_bank(f"length of {tendon.name}, measured by its sensor", both))
    return found


def _bank(name: str, columns: Sequence[Floats]) -> Bank:
    return Bank(name, _unit(np.nan_to_num(np.column_stack(columns))))


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


def _travel(records: Sequence[Record], joint: str) -> float:
    column = records[0].model.joint(joint).qposadr[0]
    return float(np.ptp(np.concatenate([r.qpos[:, column] for r in records])))


def _functions(records: Sequence[Record], joint: str, waves: int) -> list[list[Floats]]:
    """Return series of torque by episode, in units of `unit_force`.

    They are waves over the range of the joint, ramps near its ends, and bumps whose sign is that of
    the direction of motion.
    """
    model = records[0].model
    at, dof = model.joint(joint).qposadr[0], model.joint(joint).dofadr[0]
    position = [r.qpos[:, at] for r in records]
    low = min(float(p.min()) for p in position)
    width = max(float(p.max()) for p in position) - low
    speed = 0.1 * float(np.sqrt(np.mean(np.concatenate([r.qvel[:, dof] for r in records]) ** 2)))
    phase = [(p - low) / width for p in position]
    direction = [np.tanh(r.qvel[:, dof] / (speed + 1e-9)) for r in records]
    found = []
    for m in range(1, waves + 1):
        found.append([np.cos(np.pi * m * x) for x in phase])
    for edge in EDGES:
        found.append([np.maximum(0.0, x - edge) for x in phase])
        found.append([np.maximum(0.0, (1.0 - edge) - x) for x in phase])
    count = max(2, BUMPS * waves // WAVES)
    for centre in (np.arange(count) + 0.5) / count:
        bump = [np.exp(-0.5 * ((x - centre) * count) ** 2) for x in phase]
        found.append([b * d for b, d in zip(bump, direction, strict=True)])
    return found


def _unit(columns: Floats) -> Floats:
    """Scale columns (n, k) to a mean square of 1; those that are zero are left out."""
    size = np.sqrt(np.mean(columns**2, axis=0))
    return columns[:, size > 1e-9] / size[size > 1e-9]
