"""The agent's own time: it never repeats, goes back or jumps, for any time stamps.

A stamp that is not later than the one before is skipped and counted. Where stamps jump forward, or
stay behind for good, the clock was set or readings paused: the agent's time goes on by one period,
and later stamps are converted to it. Without such a jump the agent's time is the stamp, to the bit.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import CLOCK_JUMPED, STAMPS_SKIPPED, Fault
from jmm_agent.observation import CONTROL_PERIOD

AHEAD = 1.0
"""Frames whose time is farther ahead of the readings are not used [s]."""
LONGEST = 10.0
"""Time after which nothing is left of an estimate [s]."""


@dataclass(frozen=True)
class TimeLineOptions:
    """Thresholds of time stamps.

    Attributes:
        pause: a stamp that is later than the one before by more is a jump [s].
        behind: stamps that stay behind for longer than this, by themselves, are a jump back [s].
        named: how long a jump is named as a fault [s].
        run: number of readings that are skipped in a row, from which on that is named.
        share: share of the last `of` readings that are skipped, from which on that is named [1].
        of: number of readings over which that share is counted.
    """

    pause: float = 0.5
    behind: float = 0.2
    named: float = 1.0
    run: int = 10
    share: float = 0.25
    of: int = 100


class Tick(NamedTuple):
    """A time stamp that is used.

    Attributes:
        stamp: the time stamp [s].
        time: on the agent's own time [s].
        offset: what the agent's time is behind the stamps [s].
        jump: by how much the stamps jumped [s]; 0 if they did not.
    """

    stamp: float
    time: float
    offset: float
    jump: float = 0.0

    def passed(self, before: float) -> float:
        """Time since the readings before [s]; after a jump, what it may have been at most.

        Args:
            before: time of the readings before, on the agent's own time [s].
        """
        return min(abs(self.jump), LONGEST) if self.jump else self.time - before

    def frame_time(self, frame_time: float) -> float:
        """Time at which a frame was taken, on the agent's own time [s].

        Args:
            frame_time: by the clock of the time stamps [s].

        Returns:
            The time; -inf if it is not finite or far ahead of the readings, as after the clock was
            set back.
        """
        own = frame_time - self.offset
        return own if np.isfinite(own) and own <= self.time + AHEAD else -np.inf


class TimeLine:
    """Converts time stamps to the agent's own time.

    Args:
        options: thresholds.

    Attributes:
        skipped: number of readings that were skipped since the agent was made.
        jumps: number of jumps since then.
    """

    def __init__(self, options: TimeLineOptions) -> None:
        self._options = options
        self.skipped = self.jumps = 0
        self.reset()

    def reset(self) -> None:
        """Begin with the next stamp, as before a new episode."""
        self._last: Tick | None = None
        self._period = CONTROL_PERIOD
        self._behind: tuple[float, float] | None = None
        self._recent: deque[bool] = deque(maxlen=self._options.of)
        self._jumped: Fault | None = None
        self._skipping: Fault | None = None

    def tick(self, stamp: float) -> Tick | None:
        """What a time stamp is on the agent's time; None if its readings are to be skipped.

        Args:
            stamp: time of new readings [s].

        Raises:
            AgentError: the stamp is not finite.
        """
        if not np.isfinite(stamp):
            raise AgentError(f"Agent: time must be finite, got {stamp} s.")
        last = self._last
        if last is None:
            return Tick(stamp, stamp, 0.0)
        ahead = stamp - last.stamp
        if 0.0 < ahead <= self._options.pause:
            return Tick(stamp, stamp - last.offset, last.offset)
        if ahead <= 0.0 and not self._stays_behind(stamp):
            self.skipped += 1
            self._recent.append(True)
            self._name_skipped()
            return None
        time = last.time + self._period
        return Tick(stamp, time, stamp - time, ahead)

    def own_time(self, stamp: float) -> float:
        """A time by the clock of the time stamps [s], on the agent's own time [s]."""
        return stamp if self._last is None else stamp - self._last.offset

    def accept(self, tick: Tick) -> None:
        """Go on from a tick whose readings are used."""
        if tick.jump:
            self.jumps += 1
            detail = f"time stamps jumped by {tick.jump:.6g} s"
            self._recent.clear()
            self._jumped = Fault(CLOCK_JUMPED, "clock", tick.time, detail)
        elif self._last is not None:
            self._period = tick.time - self._last.time
        self._last, self._behind = tick, None
        self._recent.append(False)
        self._name_skipped()

    def found(self) -> Iterator[Fault]:
        """Faults of the clock that are found now."""
        jumped, last = self._jumped, self._last
        if jumped and last and last.time - jumped.since <= self._options.named:
            yield jumped
        if self._skipping is not None:
            yield self._skipping

    def _stays_behind(self, stamp: float) -> bool:
        """Whether stamps that are not later advance by themselves: the clock was set back."""
        begin, newest = self._behind or (stamp, stamp)
        if stamp < begin:
            begin = newest = stamp
        self._behind = begin, max(newest, stamp)
        return stamp - begin > self._options.behind

    def _name_skipped(self) -> None:
        """Name that readings are skipped while many are."""
        options, recent = self._options, self._recent
        count = sum(recent)
        in_a_row = count >= options.run and all(islice(reversed(recent), options.run))
        if not (in_a_row or count > options.share * options.of):
            self._skipping = None
        elif self._skipping is None:
            since = np.nan if self._last is None else self._last.time
            detail = (
                f"{count} of the last {len(recent)} readings have a time stamp that is not later"
            )
            self._skipping = Fault(STAMPS_SKIPPED, "clock", since, detail)
