"""The control loop: readings in, commands out, and the robot stopped whenever it ends in error."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.command_limits import CommandLimits
from jmm_agent.driving.autosave import Autosave
from jmm_agent.driving.call_watch import CallWatch
from jmm_agent.driving.driver import Driver, PausingDriver
from jmm_agent.driving.emergency_stop import EmergencyStop
from jmm_agent.driving.endings import endings_raised
from jmm_agent.driving.robot_stop import RobotStop
from jmm_agent.driving.short_collections import short_collections
from jmm_agent.errors import AgentError
from jmm_agent.gap_detector import GapDetector
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats

Watcher = Callable[[SensorReadings, Floats], None]
"""Called with the readings and the target lengths (m,) [m] after every step."""

ROUNDING = 1e-9
"""Difference below which two times are the same [s]."""

_log = logging.getLogger(__name__)


class LostReadingsError(AgentError):
    """Too many control periods without readings that can be used."""


@dataclass(frozen=True)
class DriveOptions:
    """What a `drive` tolerates, and the limits of its commands.

    Attributes:
        timeout: longest duration of a call of `Driver.read` or `Driver.write` [s]; infinite for
            none. Some control periods for a real robot.
        lost: number of control periods in a row without usable readings, at the end of which the
            robot is stopped; until then the last command is held.
        limits: of rate and tension; `Agent.limits` if left out, and `CommandLimits.of` the agent's
            map and motors where that is None, too.

    Raises:
        AgentError: the timeout is not positive, or less than one period may be lost.
    """

    timeout: float = 5.0
    lost: int = 4
    limits: CommandLimits | None = None

    def __post_init__(self) -> None:
        if not self.timeout > 0.0:
            raise AgentError(f"DriveOptions: the timeout is {self.timeout} s; it must be positive.")
        if not self.lost >= 1:
            raise AgentError(f"DriveOptions: lost is {self.lost}; it must be at least 1 period.")


class DriveReport(NamedTuple):
    """What happened during a drive.

    Attributes:
        cycles: number of control periods with readings that the agent used.
        lost: number without, in which the last command was held.
        reasons: what was wrong with lost readings, and how often.
        gaps: number of gaps in time, in which the trajectory paused.
        longest_gap: of these [s].
    """

    cycles: int = 0
    lost: int = 0
    reasons: tuple[tuple[str, int], ...] = ()
    gaps: int = 0
    longest_gap: float = 0.0


def drive(
    agent: Agent,
    driver: Driver,
    seconds: float,
    watch: Watcher = lambda readings, target_lengths: None,
    options: DriveOptions | None = None,
    emergency_stop: EmergencyStop | None = None,
    memory: str | os.PathLike[str] | None = None,
) -> DriveReport:
    """Let an agent drive a robot for some time of the robot's clock.

    Call it again for the next posture (`Agent.go`). The caller calls `Driver.stop` at the very end;
    here it is called after any error, even an invalid argument; its own failure becomes a note.
    SIGTERM and SIGHUP count as errors in the main thread, where Python handles signals; a handler
    that the caller has installed stays in place.

    Without usable readings the last command is held for a while, see `DriveOptions`. A gap in the
    robot's time does not count: the motion goes on from where it was.

    Args:
        agent: the agent.
        driver: the robot.
        seconds: duration [s].
        watch: called with the readings and the target lengths (m,) [m] after every step.
        options: what is tolerated; the defaults if left out.
        emergency_stop: ends the drive when it is triggered, also from another thread.
        memory: file that holds what the agent has learned after each step in which it learned
            something, written beside the loop; `Agent.load` reads it. None for none.

    Returns:
        What happened, such as the number of lost readings.

    Raises:
        AgentError: the duration or the readings cannot be used; the robot was stopped.
        SystemExit: a signal asked the process to end; the robot was stopped.
    """
    stop, emergency_stop = RobotStop(driver), emergency_stop or EmergencyStop()
    saved: AbstractContextManager[Autosave | None]
    saved = nullcontext() if memory is None else Autosave(agent, memory)
    with endings_raised(), short_collections(), saved as autosave:
        try:
            _check_duration(seconds)
            emergency_stop.check()
            options = options or DriveOptions()
            with (
                _limited(agent, options.limits),
                CallWatch(stop, options.timeout, emergency_stop) as calls,
            ):
                loop = _Loop(agent, driver, options.lost, calls, emergency_stop)
                report = loop.run(seconds, _both(watch, autosave))
            if autosave is not None:
                autosave.finish()
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                emergency_stop.trigger("the drive was interrupted (Ctrl-C)")
            stop.after(error)
            raise
        if isinstance(driver, PausingDriver):
            driver.pause()
        return report


def _check_duration(seconds: float) -> None:
    """Raise an `AgentError` if a duration would never end."""
    if not 0.0 <= seconds < np.inf:
        raise AgentError(f"drive: the duration is {seconds} s; it must be finite and not negative.")


def _both(watch: Watcher, autosave: Autosave | None) -> Watcher:
    """Calls ``watch`` after what was learned is about to be saved."""

    def saved(readings: SensorReadings, target_lengths: Floats) -> None:
        if autosave is not None:
            autosave.step()
        watch(readings, target_lengths)

    return saved


@contextmanager
def _limited(agent: Agent, limits: CommandLimits | None) -> Iterator[None]:
    """Limit the agent's commands within this context."""
    own = agent.limits
    if limits is None and own is None:
        limits = CommandLimits.of(agent.map, agent.kinematics.limits, agent.motors)
    agent.limits = limits or own
    try:
        yield
    finally:
        agent.limits = own


class _Loop:
    """Control periods of one drive."""

    def __init__(
        self,
        agent: Agent,
        driver: Driver,
        tolerated: int,
        calls: CallWatch,
        emergency_stop: EmergencyStop,
    ) -> None:
        self._agent, self._driver, self._tolerated = agent, driver, tolerated
        self._calls, self._emergency_stop = calls, emergency_stop
        self._dead_encoders_allowed = not isinstance(agent.guard, NullGuard)
        self._gaps = GapDetector()
        self._command: Floats | None = None
        self._stamp: float | None = None
        self._time = self._begin = -np.inf
        self._in_a_row = 0
        self._reasons: dict[str, int] = {}
        self._report = DriveReport()

    def run(self, seconds: float, watch: Watcher) -> DriveReport:
        """Run control periods for a time [s]."""
        while True:
            self._calls.begin("read")
            readings = self._driver.read()
            self._calls.end()
            reason = self._unusable(readings)
            if readings is None or reason:
                self._lose(reason)
                self._write()
                continue
            self._note_time(readings.time)
            self._command = self._checked(self._agent.step(readings))
            self._write()
            watch(readings, self._command)
            if self._time - self._begin >= seconds - ROUNDING:
                return self._report._replace(reasons=tuple(self._reasons.items()))

    def _write(self) -> None:
        """Command the newest target lengths, if there are any."""
        self._emergency_stop.check()
        if self._command is not None:
            self._calls.begin("write")
            self._driver.write(self._command)
            self._calls.end()

    def _unusable(self, readings: SensorReadings | None) -> str:
        """What is wrong with readings that may be lost or broken on their way; empty if nothing."""
        if readings is None:
            return "no readings came"
        if not np.isfinite(readings.time):
            return "their time is not finite"
        last, self._stamp = self._stamp, readings.time
        if readings.time == last:
            return "their time is that of the readings before"
        finite = np.isfinite(np.asarray(readings.lengths, dtype=float))
        if not finite.any():
            return "no length is finite"
        if self._dead_encoders_allowed:
            return ""
        if not finite.all():
            return "a length is not finite (without a guard all must be)"
        if not np.isfinite(np.asarray(readings.tensions, dtype=float)).all():
            return "a tension is not finite (without a guard all must be)"
        return ""

    def _lose(self, reason: str) -> None:
        """Count a control period without usable readings; an error if there are too many."""
        self._in_a_row += 1
        self._reasons[reason] = self._reasons.get(reason, 0) + 1
        self._report = self._report._replace(lost=self._report.lost + 1)
        if self._in_a_row == 1:
            _log.warning("Readings lost (%s); the last command is held.", reason)
        if self._in_a_row >= self._tolerated:
            raise LostReadingsError(
                f"No usable readings in {self._in_a_row} control periods in a row ({reason}); the "
                "robot was stopped. DriveOptions.lost is the number that ends a drive."
            )

    def _note_time(self, time: float) -> None:
        """Count a control period, and leave a gap out of the time that is driven."""
        self._in_a_row = 0
        gap = self._gaps.update(time)
        if (step := self._gaps.steps_too_long) > 0.0:
            raise AgentError(
                f"drive: by their time stamps the readings come every {step:.3g} s. Stamps must be "
                "in seconds, not in ms, us or ns, and the control period of an agent is 5 to 50 ms."
            )
        self._begin = time if self._time == -np.inf else self._begin + gap
        self._time = time
        report = self._report._replace(cycles=self._report.cycles + 1)
        if gap > 0.0:
            _log.warning("The robot's time has a gap of %.3g s; the trajectory paused.", gap)
            report = report._replace(gaps=report.gaps + 1, longest_gap=max(gap, report.longest_gap))
        self._report = report

    def _checked(self, command: Floats) -> Floats:
        """A command that a robot may get; an error otherwise."""
        command = np.asarray(command, dtype=float)
        if not np.isfinite(command).all():
            raise AgentError(
                "drive: the agent commanded a length that is not finite; it was not written, and "
                "the robot was stopped."
            )
        return command
