"""Unmodelled forces: forces on joints or tendons that follow a time series, as candidates."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import mujoco
import numpy as np

from reality_gap.causes.base import (
    Effects,
    Location,
    Parameter,
    Record,
    Values,
    unlisted_cause,
)
from reality_gap.causes.support import typical_scales
from reality_gap.causes.support.new_elements import add_actuator
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.system import System
from reality_gap.types import Floats

SMALL = 0.01
"""Size of an unmodelled force over the typical force of its joint or tendon."""


def unit_force(system: System, kind: str, name: str) -> float:
    """Return the size of an unmodelled force on a joint or tendon [N m or N].

    Args:
        system: the machine.
        kind: "joint" or "tendon".
        name: name of the joint or tendon.
    """
    location = Location(kind, (name,))
    if kind == "tendon":
        return SMALL * typical_scales.tendon_force(system, location)
    return SMALL * typical_scales.joint_force(system, location)[1]


def unmodelled_force(
    system: System, kind: str, name: str, records: Sequence[Record], series: list[Floats]
) -> Candidate:
    """Return a candidate that exerts a force with a given time series.

    Args:
        system: the machine.
        kind: "joint" or "tendon".
        name: name of the joint or tendon.
        records: replays of the episodes, at whose times the series is given.
        series: the force in each episode in units of `unit_force`, shape (k,) each.
    """
    time = np.concatenate([r.time for r in records])
    force = unit_force(system, kind, name) * np.concatenate(series)
    attach = partial(_add_command, time, force)
    cause = unlisted_cause(edit=_add_force_actuator, attach=attach)
    return Candidate(cause, Location(kind, (name,)), (Parameter("size", "1", 1.0, 0.0, 0.0, 1.0),))


def _add_force_actuator(
    spec: mujoco.MjSpec, system: System, location: Location, values: Values
) -> None:
    kinds = {"joint": mujoco.mjtTrn.mjTRN_JOINT, "tendon": mujoco.mjtTrn.mjTRN_TENDON}
    name = location.elements[0]
    add_actuator(spec, name=f"unmodelled/{name}", trntype=kinds[location.kind], target=name)


def _add_command(
    times: Floats,
    force: Floats,
    effects: Effects,
    system: System,
    location: Location,
    values: Values,
) -> None:
    def add(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        return np.column_stack([command, np.interp(time, times, force)])

    effects.commands.append(add)
