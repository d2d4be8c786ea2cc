"""Static poses: moments of rest in a log, at which forces balance and velocities are zero."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from reality_gap.study.data import Episode, Study
from reality_gap.types import Floats, Ints

WAIT = 0.5
"""How long a command must have been held until the machine counts as at rest [s]."""
WINDOW = 0.5
"""Longest interval over which readings at rest are averaged [s]."""
SHORTEST = 0.1
"""Shortest interval over which readings at rest are averaged [s]."""
STILL = 1e-6
"""A command counts as constant if it changes by less than this fraction of its range."""


@dataclass(frozen=True)
class Moments:
    """Moments of rest.

    Attributes:
        time: time from the first command of the episode, shape (k,) [s].
        episode: index into the study's episodes, shape (k,).
        command: the command that was held, shape (k, nu).
        value: mean reading of each channel in SI units, shape (k, c); NaN without readings.
    """

    time: Floats
    episode: Ints
    command: Floats
    value: Floats

    def __len__(self) -> int:
        return len(self.time)


def find_moments(study: Study) -> Moments:
    """Return all moments of rest of a study: the ends of the intervals of constant command."""
    commands = np.concatenate([episode.command for episode in study.episodes])
    least = STILL * np.ptp(commands, axis=0)
    found = [
        (e, begin, end)
        for e, episode in enumerate(study.episodes)
        for begin, end in _held(episode, least)
    ]
    rows, values = [], []
    for e, begin, end in found:
        episode = study.episodes[e]
        last = int(np.searchsorted(episode.time, end)) - 1
        rows.append(episode.command[max(last, 0)])
        values.append(_means(episode, begin, end))
    return Moments(
        time=np.array([0.5 * (begin + end) for _, begin, end in found]),
        episode=np.array([e for e, _, _ in found], dtype=np.int64),
        command=np.array(rows).reshape(len(found), commands.shape[1]),
        value=np.array(values).reshape(len(found), len(study.channels)),
    )


def _held(episode: Episode, least: Floats) -> list[tuple[float, float]]:
    """Return begin and end of a window at the end of each interval of constant command [s]."""
    changed = np.any(np.abs(np.diff(episode.command, axis=0)) > least, axis=1)
    edges = [episode.time[0], *episode.time[1:][changed], episode.duration]
    return [
        (float(max(begin + WAIT, end - WINDOW)), float(end))
        for begin, end in pairwise(edges)
        if end - begin > WAIT + SHORTEST
    ]


def _means(episode: Episode, begin: float, end: float) -> Floats:
    """Return the mean reading of each channel in a window, shape (c,)."""
    values = np.full(len(episode.readings), np.nan)
    for c, reading in enumerate(episode.readings):
        first, last = np.searchsorted(reading.time, [begin, end])
        if last > first:
            values[c] = reading.value[first:last].mean()
    return values
