"""Planned postures: every joint moves between random stops and rests in between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hidden_plants.strangers.skeleton import Skeleton
from hidden_plants.strangers.traits import Traits
from hidden_plants.types import Floats

REST = (0.15, 0.8)
"""Shortest and longest rest of a joint between two moves [s]."""
PAUSE = 0.7
"""Rest of all joints at the start of an episode [s]."""
END = 0.3
"""Rest of all joints at the end of an episode [s]."""
DERIVED = 1e-3
"""Step of the numerical derivatives of a path [s]."""


@dataclass(frozen=True)
class Path:
    """Path of all joints in one episode.

    Attributes:
        begin, end: times of each move, by joint [s].
        stops: positions between the moves, by joint; one more than there are moves.
        duration: of the episode [s].
    """

    begin: tuple[Floats, ...]
    end: tuple[Floats, ...]
    stops: tuple[Floats, ...]
    duration: float

    @property
    def home(self) -> Floats:
        """Positions at the start (joints,)."""
        return np.array([stops[0] for stops in self.stops])

    def at(self, time: Floats) -> Floats:
        """Positions at ``time`` (k,), shape (k, joints)."""
        columns = []
        for begin, end, stops in zip(self.begin, self.end, self.stops, strict=True):
            share = np.clip((time[:, None] - begin) / (end - begin), 0.0, 1.0)
            ease = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
            columns.append(stops[0] + ease @ np.diff(stops))
        return np.stack(columns, axis=1)

    def motion(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Positions, velocities and accelerations at ``time`` (k,), each (k, joints)."""
        before, here, after = (self.at(time + shift) for shift in (-DERIVED, 0.0, DERIVED))
        return here, (after - before) / (2 * DERIVED), (after - 2 * here + before) / DERIVED**2


def sample_paths(rng: np.random.Generator, traits: Traits, skeleton: Skeleton) -> tuple[Path, ...]:
    """Sample the path of every episode; all begin at the same posture."""
    home = [0.3 * rng.uniform(*link.range) for link in skeleton.links]
    quick = 0.5 + 0.5 * traits.reach**0.5
    duration = traits.seconds / traits.episodes
    return tuple(_path(rng, skeleton, home, duration, quick) for _ in range(traits.episodes))


def _path(
    rng: np.random.Generator, skeleton: Skeleton, home: list[float], duration: float, quick: float
) -> Path:
    """Sample one episode; a move takes about ``quick`` seconds."""
    begins: list[Floats] = []
    ends: list[Floats] = []
    stops: list[Floats] = []
    for link, start in zip(skeleton.links, home, strict=True):
        begin: list[float] = []
        end: list[float] = []
        stop = [start]
        now = PAUSE + rng.uniform(0.0, 0.3)
        half = 0.5 * (link.range[1] - link.range[0])
        while True:
            length = quick * rng.uniform(0.8, 1.6)
            if not begin:
                length = min(length, duration - END - now)
            if now + length > duration - END:
                break
            far = rng.uniform(0.25, 0.75) * half * (1.0 if stop[-1] < 0.0 else -1.0)
            begin.append(now)
            end.append(now + length)
            stop.append(float(far))
            now += length + rng.uniform(*REST)
        begins.append(np.array(begin))
        ends.append(np.array(end))
        stops.append(np.array(stop))
    return Path(tuple(begins), tuple(ends), tuple(stops), duration)
