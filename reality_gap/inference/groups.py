"""Groups of causes: what may be a little wrong at every joint and on every wire at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location
from reality_gap.inference.static_fit import Noise
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replay import Replay
from reality_gap.simulation.statics import Statics
from reality_gap.study.static_poses import Moments
from reality_gap.study.system import System
from reality_gap.types import Floats

EVERY = "every"
"""What notes of places begin with that have parameters of each of many elements."""
EACH = ("length_offset",)
"""Causes without a place on many elements with parameters of each: all their places are taken."""
SHARED = ("tendon_elasticity",)
"""Causes of which all wires share the parameters."""
OWN = "each its own"
"""Note of a place made of all places of a cause."""
LEAST = 2
"""Causes with places on many elements, without which a machine is too small for groups."""

SHARES = {
    int(mujoco.mjtSensor.mjSENS_TENDONPOS): 0.03,
    int(mujoco.mjtSensor.mjSENS_ACTUATORPOS): 0.03,
}
OTHERS = 0.015
"""What the groups cannot say of a reading, as wires that wrap around bodies: shares of the spread
of all readings of its kind at rest. A length of a wire that moves by 15 mm is believed to 0.5 mm,
a marker that moves by 70 mm to 1 mm."""
FRICTION = 0.5
"""The same of forces in the balance: friction holds a machine at rest anywhere within it."""
MISSING = 0.015
"""The same of the balance itself, as a share of the torques of gravity and springs."""


@dataclass(frozen=True)
class Group:
    """Suspects that are named together: one on many elements, or all single ones of a cause."""

    candidates: tuple[Candidate, ...]

    @property
    def id(self) -> str:
        """Of the cause."""
        return self.candidates[0].cause.id

    def named(self) -> Candidate:
        """The group as one suspect, whose parameters bear the names of `label`."""
        first = self.candidates[0]
        if len(self.candidates) == 1:
            return first
        elements = tuple(name for s in self.candidates for name in s.location.elements)
        parameters = tuple(
            replace(p, name=self.label(s, p.name)) for s in self.candidates for p in s.parameters
        )
        return Candidate(first.cause, Location(first.location.kind, elements, OWN), parameters)

    def label(self, candidate: Candidate, parameter: str) -> str:
        """Name of a suspect's parameter within the group."""
        if len(self.candidates) == 1:
            return parameter
        return f"{' '.join(candidate.location.elements)}.{parameter}"


def find_groups(system: System, causes: Sequence[Cause]) -> tuple[Group, ...]:
    """Groups of a machine; none where it has too few parts, or joints other than hinges and slides.

    Args:
        system: the machine.
        causes: of the catalogue.
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
            single = tuple(s for s in found if len(s.location.elements) == 1)
            each += [Group(single)] if len(single) > 1 else []
    if len(large) < LEAST:
        return ()
    return (*large, *shared, *each)


def noise_at_rest(system: System, statics: Statics, noise: Floats, qpos: Floats) -> Noise:
    """Standard deviations of a fit of groups.

    Args:
        system: the machine.
        statics: of the moments of rest.
        noise: (c,) of one reading of each channel.
        qpos: (k, nq) positions in the model's replay.
    """
    kinds = np.array([int(system.model.sensor(c.sensor).type[0]) for c in system.study.channels])
    spread = np.array([_spread(statics.moments.value[:, kinds == kind]) for kind in kinds])
    share = np.array([SHARES.get(kind, OTHERS) for kind in kinds])
    found = statics.look(build(system, []), qpos)
    force = FRICTION * _spread(found.force)
    torque = MISSING * float(np.sqrt(np.mean(found.weight**2)))
    return Noise(np.hypot(noise, share * spread), force + 1e-9, torque + 1e-3 * force + 1e-9)


def _spread(values: Floats) -> float:
    """RMS of columns (k, c) about their means, all together; nan cells are left out."""
    seen = values[:, np.isfinite(values).any(axis=0)]
    if seen.size == 0:
        return 0.0
    return float(np.sqrt(np.nanmean((seen - np.nanmean(seen, axis=0)) ** 2)))


def positions_at(moments: Moments, replayed: Replay) -> Floats:
    """Where joints stand in a replay at moments of rest (k, nq)."""
    rows = []
    for time, episode in zip(moments.time, moments.episode, strict=True):
        record = replayed.records[episode]
        step = record.time[1] - record.time[0]
        rows.append(record.qpos[min(round(time / step), len(record.qpos) - 1)])
    return np.array(rows)
