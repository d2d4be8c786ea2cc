"""Effort residual: what any mechanism could explain of the residual of compared efforts."""

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
from reality_gap.causes.support.machine_size import dof, machine_size
from reality_gap.inference.motion_functions import (
    Bank,
    bank,
    functions_of_position,
    moving_joints,
    slow_waves,
)
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.simulation.prepared_episode import prepared_episodes
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.system import System
from reality_gap.types import Floats

FINE_WAVES = 80
"""Largest number of half waves over the range of a joint; none of them needs a replay."""
SHIFT = 1e-4
"""Error whose effect is computed: of a position, over half of its range, or of a velocity, over
that in a second."""


def effort_banks(replayer: Replayer, base: Hypothesis, records: Sequence[Record]) -> list[Bank]:
    """Return the banks of a study in which efforts are compared.

    Args:
        replayer: replays of the study.
        base: the hypothesis whose remainder is to be learned.
        records: the motion in each episode.
    """
    return [*_by_position(replayer, records), *_encoder_drifts(replayer, base, records)]


def _by_position(replayer: Replayer, records: Sequence[Record]) -> list[Bank]:
    """Return the banks of torques by the position of each joint that has an effort."""
    study, measured = replayer.system.study, replayer.measured
    channels = {channel.sensor: c for c, channel in enumerate(study.channels)}
    episodes = prepared_episodes(study)
    found = []
    for name in moving_joints(replayer.system, records):
        if name not in channels:
            continue
        columns = []
        for series in functions_of_position(records, name, FINE_WAVES):
            column = np.zeros(len(measured.value))
            for e, (force, episode) in enumerate(zip(series, episodes, strict=True)):
                at = (measured.episode == e) & (measured.channel == channels[name])
                column[at] = episode.samples(channels[name], force)
            columns.append(column / measured.noise)
        found.append(bank(f"position of {name}", columns))
    return found


def _encoder_drifts(replayer: Replayer, base: Hypothesis, records: Sequence[Record]) -> list[Bank]:
    """Return the bank in which the error of a joint's position changes slowly, if one moves."""
    waves, slopes = slow_waves(replayer.measured, records)
    names = moving_joints(replayer.system, records)
    before = replayer.residual(base)
    trials = [
        [*base, (_with_error(name, kind), {"size": 1.0})]
        for name in names
        for kind in ("qpos", "qvel")
    ]
    changes = iter(before - after for after in replayer.residuals(trials))
    columns = list[Floats]()
    for _ in names:
        by_position, by_velocity = next(changes), next(changes)
        moved = by_position[:, None] * waves + by_velocity[:, None] * slopes
        columns += list(moved.T)
    return [bank("position errors by the time", columns)] if columns else []


def _with_error(joint: str, kind: str) -> Candidate:
    """Return the candidate in which a joint's position or velocity is measured too large."""
    cause = unlisted_cause(attach=partial(_attach_error, kind))
    return Candidate(
        cause, Location("joint", (joint,)), (Parameter("size", "1", 1.0, 0.0, 0.0, 1.0),)
    )


def _attach_error(
    kind: str, effects: Effects, system: System, location: Location, values: Values
) -> None:
    at = dof(system, location.elements[0])
    error = SHIFT * float(machine_size(system).travel[at])

    def shift(model: mujoco.MjModel, qpos: Floats, qvel: Floats, qacc: Floats) -> None:
        if kind == "qpos":
            qpos[:, model.jnt_qposadr[model.dof_jntid[at]]] -= error
        else:
            qvel[:, at] -= error

    effects.motions.append(shift)
