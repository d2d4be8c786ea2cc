"""Motions that a machine can perform: moves through commands that a study contains already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from reality_gap.study.data import Study
from reality_gap.types import Floats

SECONDS = 60.0
"""Duration of a motion [s]."""
PERIOD = 0.02
"""Time between two commands [s]."""
PEAK = 1.875
"""Ratio of peak to mean speed of a smooth move."""
KINDS = (
    ("slow sweeps", 0.0, 2.0),
    ("steps with rests", 0.7, 0.05),
    ("quick reversals", 0.0, 0.25),
    ("moves and rests", 0.4, 0.4),
)
"""Title, duration of a rest [s] and duration of a move [s] of each kind of motion."""
TIGHTER = (0.0, 0.15)
"""By how much commands are shortened, as shares of their range."""


@dataclass(frozen=True)
class Motion:
    """A motion.

    Attributes:
        title: what kind of motion it is.
        command: command every `PERIOD`, within the range of the study's commands, shape (n, nu).
    """

    title: str
    command: Floats


def motions(study: Study, seed: int = 0) -> tuple[Motion, ...]:
    """Return motions through commands of a study.

    No actuator's command changes faster than in the study, nor do all of them together in the root
    mean square. A faster motion might damage the machine, and would increase the effects of
    tolerances beyond those in the study.

    Args:
        study: the study.
        seed: seed of the selection of commands.
    """
    rng = np.random.default_rng(seed)
    rows = np.concatenate([episode.command for episode in study.episodes])
    spread, fastest = np.ptp(rows, axis=0), _fastest(study)
    usual = _rms_speed([(e.time, e.command) for e in study.episodes], spread)
    found = []
    for title, hold, travel in KINDS:
        for tighter in TIGHTER:
            points = _distant_commands(rows, round(SECONDS / (hold + travel)) + 2, rng)
            command = _through(points, hold, travel, fastest)
            time = PERIOD * np.arange(len(command), dtype=np.float64)
            speed = _rms_speed([(time, command)], spread)
            if speed > usual > 0.0:
                slower = speed / usual
                command = _through(points, slower * hold, slower * travel, fastest / slower)
            suffix = ", wires tighter" if tighter else ""
            low = rows.min(axis=0)
            found.append(Motion(title + suffix, np.maximum(command - tighter * spread, low)))
    return tuple(found)


def _distant_commands(rows: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Select commands so that each is far from the one before."""
    spread = np.ptp(rows, axis=0)
    scaled = rows / np.where(spread > 0, spread, 1.0)
    chosen = [int(rng.integers(len(rows)))]
    while len(chosen) < count:
        some = rng.integers(len(rows), size=40)
        gap = np.linalg.norm(scaled[some] - scaled[chosen[-1]], axis=1)
        chosen.append(int(some[np.argmax(gap)]))
    return rows[chosen]


def _fastest(study: Study) -> Floats:
    """Return the highest speed of each actuator's command (nu,) [its unit/s]."""
    speeds = [
        np.abs(np.diff(episode.command, axis=0)) / np.diff(episode.time)[:, None]
        for episode in study.episodes
    ]
    return np.asarray(np.max(np.concatenate(speeds), axis=0, initial=0.0), dtype=np.float64)


def _rms_speed(episodes: Sequence[tuple[Floats, Floats]], spread: Floats) -> float:
    """Return the root mean square of the speeds of all commands, relative to ``spread`` [1/s].

    Args:
        episodes: times (n,) [s] and commands (n, nu) of each episode.
        spread: range of each command, shape (nu,).
    """
    unit, power, seconds = np.where(spread > 0, spread, 1.0), 0.0, 0.0
    for time, command in episodes:
        steps = np.diff(time)
        power += float(np.sum((np.diff(command, axis=0) / unit) ** 2 / steps[:, None]))
        seconds += float(steps.sum())
    return float(np.sqrt(power / seconds))


def _through(points: Floats, hold: float, travel: float, fastest: Floats) -> Floats:
    """Return smooth moves between points of at least ``travel`` s, with rests of ``hold`` s.

    A move follows the minimum-jerk polynomial 10 s^3 - 15 s^4 + 6 s^5.
    """
    speed = np.where(fastest > 0, fastest, np.inf)
    parts = list[Floats]()
    for here, there in pairwise(points):
        needed = PEAK * float(np.max(np.abs(there - here) / speed))
        steps = max(1, round(max(travel, needed) / PERIOD))
        share = np.arange(1, steps + 1) / steps
        share = share**3 * (10 - 15 * share + 6 * share**2)
        parts += [np.tile(here, (round(hold / PERIOD), 1)), here + share[:, None] * (there - here)]
    return np.concatenate(parts)[: round(SECONDS / PERIOD)]
