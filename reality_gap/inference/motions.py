"""Motions that a machine can surely do: through commands that a study gave already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from reality_gap.study.data import Study
from reality_gap.types import Floats

SECONDS = 60.0
"""How long a motion lasts."""
PERIOD = 0.02
"""From one command to the next [s]."""
PEAK = 1.875
"""Peak over mean speed of a smooth move."""


@dataclass(frozen=True)
class Motion:
    """A candidate: ``command`` (n, nu) every `PERIOD`, within what the study commanded."""

    title: str
    command: Floats


def motions(study: Study, seed: int = 0) -> tuple[Motion, ...]:
    """Motions through commands that the study gave already, so that the machine can do them.

    No actuator's command moves faster than it did in the study, nor all of them by more in the root
    mean square: faster than that, the machine may break, and what every honest drawing is off by
    grows beyond what was judged harmless.
    """
    rng = np.random.default_rng(seed)
    rows = np.concatenate([episode.command for episode in study.episodes])
    spread, fastest = np.ptp(rows, axis=0), _fastest(study)
    usual = _liveliness([(e.time, e.command) for e in study.episodes], spread)
    found = []
    for title, hold, travel in (
        ("slow sweeps", 0.0, 2.0),
        ("steps with rests", 0.7, 0.05),
        ("quick reversals", 0.0, 0.25),
        ("moves and rests", 0.4, 0.4),
    ):
        for tighter in (0.0, 0.15):
            points = _far_apart(rows, round(SECONDS / (hold + travel)) + 2, rng)
            command = _through(points, hold, travel, fastest)
            time = PERIOD * np.arange(len(command), dtype=np.float64)
            haste = _liveliness([(time, command)], spread)
            if haste > usual > 0.0:
                slower = haste / usual
                command = _through(points, slower * hold, slower * travel, fastest / slower)
            word = ", wires tighter" if tighter else ""
            low = rows.min(axis=0)
            found.append(Motion(title + word, np.maximum(command - tighter * spread, low)))
    return tuple(found)


def _far_apart(rows: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Commands far from one another, in an order that makes every move long."""
    spread = np.ptp(rows, axis=0)
    scaled = rows / np.where(spread > 0, spread, 1.0)
    chosen = [int(rng.integers(len(rows)))]
    while len(chosen) < count:
        some = rng.integers(len(rows), size=40)
        gap = np.linalg.norm(scaled[some] - scaled[chosen[-1]], axis=1)
        chosen.append(int(some[np.argmax(gap)]))
    return rows[chosen]


def _fastest(study: Study) -> Floats:
    """How fast each actuator's command moved at most (nu,) [its unit/s]."""
    speeds = [
        np.abs(np.diff(episode.command, axis=0)) / np.diff(episode.time)[:, None]
        for episode in study.episodes
    ]
    return np.asarray(np.max(np.concatenate(speeds), axis=0, initial=0.0), dtype=np.float64)


def _liveliness(told: Sequence[tuple[Floats, Floats]], spread: Floats) -> float:
    """Root mean square of the commands' speeds, each in its ``spread`` (nu,) [1/s].

    Args:
        told: times (n,) [s] and commands (n, nu) of each episode.
        spread: range of each command.
    """
    unit, power, seconds = np.where(spread > 0, spread, 1.0), 0.0, 0.0
    for time, command in told:
        steps = np.diff(time)
        power += float(np.sum((np.diff(command, axis=0) / unit) ** 2 / steps[:, None]))
        seconds += float(steps.sum())
    return float(np.sqrt(power / seconds))


def _through(points: Floats, hold: float, travel: float, fastest: Floats) -> Floats:
    """Smooth moves between points of ``travel`` s, or slower; ``hold`` s at each."""
    speed = np.where(fastest > 0, fastest, np.inf)
    parts = list[Floats]()
    for here, there in pairwise(points):
        needed = PEAK * float(np.max(np.abs(there - here) / speed))
        steps = max(1, round(max(travel, needed) / PERIOD))
        share = np.arange(1, steps + 1) / steps
        share = share**3 * (10 - 15 * share + 6 * share**2)
        parts += [np.tile(here, (round(hold / PERIOD), 1)), here + share[:, None] * (there - here)]
    return np.concatenate(parts)[: round(SECONDS / PERIOD)]
