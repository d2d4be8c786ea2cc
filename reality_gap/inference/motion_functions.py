"""Functions of a motion, of which errors of a model may consist, and banks of their effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.causes.base import Record
from reality_gap.causes.support.machine_size import dof, machine_size
from reality_gap.study.measurements import Measured
from reality_gap.study.system import System
from reality_gap.types import Floats

WAVES = 28
"""Largest number of half waves over the range of a joint."""
BUMPS = 8
"""Number of positions along the range at which the direction of motion may matter."""
EDGES = (0.8, 0.9, 0.96)
"""Shares of the range from which on there may be an obstacle, from either end."""
SLOW = 4
"""Largest number of half waves over the time of a log, for errors that drift."""
STILL = 1e-3
"""Travel of a joint that stands still, over half of its range."""
MOST = 200
"""Largest number of replays; with many joints there are fewer waves."""


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


def moving_joints(system: System, records: Sequence[Record]) -> list[str]:
    """Return the joints that move in some episode."""
    half = machine_size(system).travel
    return [n for n in system.joints if _travel(records, n) > STILL * half[dof(system, n)]]


def wave_count(moving: Sequence[str]) -> int:
    """Return the number of half waves over the range of each moving joint."""
    return min(WAVES, max(4, MOST // (2 * len(moving))))


def bank(name: str, columns: Sequence[Floats]) -> Bank:
    """Return a bank of effects on the readings, shape (n,) each [noise]."""
    return Bank(name, unit_size(np.nan_to_num(np.column_stack(columns))))


def _travel(records: Sequence[Record], joint: str) -> float:
    column = records[0].model.joint(joint).qposadr[0]
    return float(np.ptp(np.concatenate([r.qpos[:, column] for r in records])))


def functions_of_position(records: Sequence[Record], joint: str, waves: int) -> list[list[Floats]]:
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


def unit_size(columns: Floats) -> Floats:
    """Scale columns (n, k) to a mean square of 1; those that are zero are left out."""
    size = np.sqrt(np.mean(columns**2, axis=0))
    return columns[:, size > 1e-9] / size[size > 1e-9]


def slow_waves(measured: Measured, records: Sequence[Record]) -> tuple[Floats, Floats]:
    """Return a constant and slow waves over the time of a log, and their slopes [1/s].

    Args:
        measured: all readings (n,).
        records: simulated signals of each episode.

    Returns:
        Two arrays (n, `SLOW` + 1).
    """
    time = measured.time + np.array([r.time[0] for r in records])[measured.episode]
    seconds = max(float(np.ptp(time)), 1e-9)
    order = np.pi * np.arange(SLOW + 1)
    phase = (time - time.min())[:, None] / seconds * order
    return np.cos(phase), -order / seconds * np.sin(phase)
