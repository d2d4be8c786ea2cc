"""Unmodelled forces: forces on joints or tendons that follow a time series, as candidates."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, Record, Values
from reality_gap.causes.support.new_elements import add_actuator
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.system import System
from reality_gap.types import Floats

FORCE = {"joint": 0.1, "tendon": 1.0}
"""Size of an unmodelled force [N m or N], small compared with the forces of a machine."""


def unmodelled_force(
    kind: str, name: str, records: Sequence[Record], series: list[Floats]
) -> Candidate:
    """Return a candidate that exerts a force with a given time series.

    Args:
        kind: "joint" or "tendon".
        name: name of the joint or tendon.
        records: replays of the episodes, at whose times the series is given.
        series: the force in each episode in units of `FORCE`, shape (k,) each.
    """
    time = np.concatenate([r.time for r in records])
    force = FORCE[kind] * np.concatenate(series)
    attach = partial(_add_command, time, force)
    cause = Cause("", "", "", _no_locations, _no_parameters, _add_force_actuator, attach)
    return Candidate(cause, Location(kind, (name,)), (Parameter("size", "1", 1.0, 0.0, 0.0, 1.0),))


def _no_locations(system: System) -> tuple[Location, ...]:
    return ()


def _no_parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return ()


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
