"""Findings about logs: values of a cause in each of several logs, and what a log cannot show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from reality_gap.simulation.hypothesis import Candidate


@dataclass(frozen=True)
class Estimate:
    """Value of a parameter with its 95 % interval in SI units."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class LogValue:
    """Values of a cause in one log.

    Attributes:
        log: name of the log.
        parameters: estimates by name; empty if the cause does not show in this log.
    """

    log: str
    parameters: Mapping[str, Estimate]


@dataclass(frozen=True)
class LogComparison:
    """Values of a cause in several logs.

    Attributes:
        values: those of each log.
        agreement: "same", "changed", or "unknown" if the values are too uncertain to compare.
        chance: probability of such differences by chance if the cause is the same in all logs; None
            if it shows in fewer than two of them.
    """

    values: tuple[LogValue, ...]
    agreement: Literal["same", "changed", "unknown"]
    chance: float | None


@dataclass(frozen=True)
class Remedy:
    """What would show something that a log cannot show.

    Attributes:
        motion: title of a motion through commands of the log.
        seconds: its duration [s].
        mass: mass to be added [kg]; 0 for none.
        body: where.
        change: predicted change of the readings, or distance of two causes [noise].
    """

    motion: str
    seconds: float
    mass: float
    body: str
    change: float


@dataclass(frozen=True)
class FlatDirection:
    """Something that a log cannot show.

    Attributes:
        candidates: one cause at locations where it does not show, or causes of which each can have
            the effect of the others.
        separable: whether the candidates are separate, so that none of them shows; if not, they
            show, but not which of them it is.
        change: largest change of the readings by a typical fault if none shows, or else the
            largest distance between two of them [noise].
        remedy: what would show it; None if nothing that was tried.
        tried: whether anything was tried.
    """

    candidates: tuple[Candidate, ...]
    separable: bool
    change: float
    remedy: Remedy | None = None
    tried: bool = True
