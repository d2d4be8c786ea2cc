"""Forces that nobody commanded, as causes without a name."""

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
"""Size of a force that nobody commanded [N m or N]: small beside what a machine does."""


def push(kind: str, name: str, records: Sequence[Record], series: list[Floats]) -> Candidate:
    """A force on a joint or tendon that follows a series, as a cause without a name."""
    clock = np.concatenate([r.time for r in records])
    force = FORCE[kind] * np.concatenate(series)
    attach = partial(_attach_push, clock, force)
    cause = Cause("", "", "", _nowhere, _no_parameters, _edit_push, attach)
    return Candidate(cause, Location(kind, (name,)), (Parameter("size", "1", 1.0, 0.0, 0.0, 1.0),))


def _nowhere(system: System) -> tuple[Location, ...]:
    return ()


def _no_parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return ()


def _edit_push(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    kinds = {"joint": mujoco.mjtTrn.mjTRN_JOINT, "tendon": mujoco.mjtTrn.mjTRN_TENDON}
    name = location.elements[0]
    add_actuator(spec, name=f"unnamed/{name}", trntype=kinds[location.kind], target=name)


def _attach_push(
    clock: Floats,
    force: Floats,
    effects: Effects,
    system: System,
    location: Location,
    values: Values,
) -> None:
    def add(model: mujoco.MjModel, time: Floats, command: Floats) -> Floats:
        return np.column_stack([command, np.interp(time, clock, force)])

    effects.commands.append(add)
