"""Groups of causes: parameters of all joints or all tendons that may be slightly wrong at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location
from reality_gap.causes.support.own_amounts import OWN
from reality_gap.inference.static_fit import Noise
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import Replay
from reality_gap.simulation.statics import Statics
from reality_gap.study.static_poses import Moments
from reality_gap.study.system import System
from reality_gap.types import Floats

EVERY = "every"
"""First word of the note of a location whose elements each have parameters of their own."""
EACH = ("length_offset",)
"""Causes without such a location; all their single locations form a group."""
SHARED = ("tendon_elasticity",)
"""Causes whose parameters all tendons share."""
LEAST = 2
"""Number of groups with location `EVERY` below which a machine is too small for groups."""

SHARES = {
    int(mujoco.mjtSensor.mjSENS_TENDONPOS): 0.03,
    int(mujoco.mjtSensor.mjSENS_ACTUATORPOS): 0.03,
}
"""Errors of readings that no group explains, such as those of wrapping, by kind of sensor: shares
of the spread of all readings of that kind at rest. A tendon length that varies by 15 mm is exact to
0.5 mm."""
OTHERS = 0.015
"""The same share for other kinds of sensors: a marker that moves by 70 mm is exact to 1 mm."""
FRICTION = 0.5
"""The same share for forces in the balance, because friction holds a machine anywhere within it."""
MISSING = 0.015
"""The same share for the balance, of the torques of gravity and springs."""


@dataclass(frozen=True)
class Group:
    """Candidates that are named together: one with many elements, or all single ones of a cause."""

    candidates: tuple[Candidate, ...]

    def merged(self) -> Candidate:
        """Return the group as one candidate, whose parameters are named by `label`."""
        first = self.candidates[0]
        if len(self.candidates) == 1:
            return first
        elements = tuple(name for s in self.candidates for name in s.location.elements)
        parameters = tuple(
            replace(p, name=self.label(s, p.name)) for s in self.candidates for p in s.parameters
        )
        return Candidate(first.cause, Location(first.location.kind, elements, OWN), parameters)

    def label(self, candidate: Candidate, parameter: str) -> str:
        """Return the name of a candidate's parameter within the group."""
        if len(self.candidates) == 1:
            return parameter
        return f"{' '.join(candidate.location.elements)}.{parameter}"


def find_groups(system: System, causes: Sequence[Cause]) -> tuple[Group, ...]:
    """Return the groups of a machine.

    There are none in a machine with too few parts, or with joints other than hinges and slides.

    Args:
        system: the study's model and its elements.
        causes: causes of the catalogue.
    """
    model = system.model
    if model.nq != model.nv or model.neq or system.study.inverse:
        return ()
    large, shared, each = [], [], []
    for cause in causes:
        found = [Candidate(cause, p, cause.parameters(system, p)) for p in cause.locations(system)]
        large += [Group((s,)) for s in found if s.location.note.startswith(EVERY)]
        if cause.id in SHARED:
            shared += [Group((s,)) for s in found if len(s.location.elements) > 1]
        if cause.id in EACH:
            single = tuple(
                s for s in found if len(s.location.elements) == 1 and not s.location.note
            )
            each += [Group(single)] if len(single) > 1 else []
    if len(large) < LEAST:
        return ()
    return (*large, *shared, *each)


def noise_at_rest(system: System, statics: Statics, noise: Floats, qpos: Floats) -> Noise:
    """Return the standard deviations for a fit of groups.

    Args:
        system: the study's model and its elements.
        statics: evaluates the moments of rest.
        noise: standard deviation of one reading of each channel in SI units, shape (c,).
        qpos: positions of the joints in the nominal replay, shape (k, nq).
    """
    kinds = np.array([int(system.model.sensor(c.sensor).type[0]) for c in system.study.channels])
    spread = np.array([_spread(statics.moments.value[:, kinds == kind]) for kind in kinds])
    share = np.array([SHARES.get(kind, OTHERS) for kind in kinds])
    found = statics.balance(build(system, []), qpos)
    force = FRICTION * _spread(found.force)
    torque = MISSING * float(np.sqrt(np.mean(found.weight**2)))
    return Noise(np.hypot(noise, share * spread), force + 1e-9, torque + 1e-3 * force + 1e-9)


def _spread(values: Floats) -> float:
    """Return the RMS of columns (k, c) about their means, all together, without NaN."""
    known = values[:, np.isfinite(values).any(axis=0)]
    if known.size == 0:
        return 0.0
    return float(np.sqrt(np.nanmean((known - np.nanmean(known, axis=0)) ** 2)))


def positions_at(moments: Moments, replayed: Replay) -> Floats:
    """Return the positions of the joints in a replay at moments of rest, shape (k, nq)."""
    rows = []
    for time, episode in zip(moments.time, moments.episode, strict=True):
        record = replayed.records[episode]
        step = record.time[1] - record.time[0]
        rows.append(record.qpos[min(round(time / step), len(record.qpos) - 1)])
    return np.array(rows)
