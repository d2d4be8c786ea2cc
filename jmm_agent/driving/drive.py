"""The control loop: readings in, commands out, and the robot stopped whenever it ends in error."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.command_limits import CommandLimits
from jmm_agent.driving.autosave import Autosave
from jmm_agent.driving.call_watch import CallWatch
from jmm_agent.driving.driver import Driver, PausingDriver, StiffnessDriver, check_methods
from jmm_agent.driving.emergency_stop import EmergencyStop
from jmm_agent.driving.endings import endings_raised
from jmm_agent.driving.lost_readings import why_lost
from jmm_agent.driving.robot_stop import RobotStop
from jmm_agent.driving.short_pauses import short_pauses
from jmm_agent.errors import AgentError
from jmm_agent.gap_detector import GapDetector
from jmm_agent.guard.null_guard import NullGuard
from jmm_agent.memory_file import check_path
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats

Watcher = Callable[[SensorReadings, Floats], None]
"""Called with the readings and the target lengths (m,) [m] after every step."""

ROUNDING = 1e-6
"""Difference below which two times are the same [s]; stamps since 1970 are rounded to 2e-7 s."""
SLOW = 1.0
"""No control loop has only longer periods [s]."""
APART = 50
"""Number of usable readings in a row after which a loss is logged again."""
REPEATED = "their time is that of the readings before"
"""Reason why readings are lost; the agent names a fault if it is frequent."""

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
        AgentError: the timeout is not positive, or ``lost`` is not a whole number from 1 on.
    """

    timeout: float = 5.0
    lost: int = 4
    limits: CommandLimits | None = None

    def __post_init__(self) -> None:
        if not self.timeout > 0.0:
            raise AgentError(f"DriveOptions: the timeout is {self.timeout} s; it must be positive.")
        if not (self.lost >= 1 and float(self.lost).is_integer()):
            raise AgentError(
                f"DriveOptions: lost is {self.lost}; it must be a whole number of periods, at "
                "least 1."
            )


class DriveReport(NamedTuple):
    """What happened during a drive.

    Attributes:
        cycles: number of control periods with readings that the agent used.
        lost: number of control periods without, in which the last command was held.
        reasons: what was wrong with lost readings, and how often.
        gaps: number of gaps in time, in which the trajectory paused.
        longest_gap: of these [s].
        left_out: muscles that were out of use at the end, as they had snapped.
    """

    cycles: int = 0
    lost: int = 0
    reasons: tuple[tuple[str, int], ...] = ()
    gaps: int = 0
    longest_gap: float = 0.0
    left_out: tuple[str, ...] = ()


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
        AgentError: driver, duration, memory or readings cannot be used; the robot was stopped.
        SystemExit: a signal asked the process to end; the robot was stopped.
    """
    stop, emergency_stop = RobotStop(driver), emergency_stop or EmergencyStop()
    with endings_raised(), short_pauses(), ExitStack() as saving:
        try:
            check_methods(driver)
            _check_duration(seconds)
            emergency_stop.check()
            autosave = saving.enter_context(_autosaved(agent, memory))
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


def _autosaved(
    agent: Agent, memory: str | os.PathLike[str] | None
) -> AbstractContextManager[Autosave | None]:
    """What is learned within this context is saved, if there is a file for it."""
    if memory is None:
        return nullcontext()
    check_path(memory)
    return Autosave(agent, memory)


def _check_duration(seconds: float) -> None:
    """Raise an `AgentError` if a duration would never end."""
    if not 0.0 <= seconds < np.inf:
        raise AgentError(f"drive: the duration is {seconds} s; it must be finite and not negative.")


def _both(watch: Watcher, autosave: Autosave | None) -> Watcher:
    """Watcher that first has new learning saved, and then calls ``watch``."""

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
        self._stiffness: Floats | None = None
        self._time = self._begin = -np.inf
        self._in_a_row = 0
        self._lost_at = 0
        self._reasons: dict[str, int] = {}
        self._report = DriveReport()

    def run(self, seconds: float, watch: Watcher) -> DriveReport:
        """Run control periods for a time [s]."""
        while True:
            self._calls.begin("read")
            readings = self._driver.read()
            self._calls.end()
            reason = why_lost(readings, self._dead_encoders_allowed)
            if readings is not None and not reason and readings.time == self._time:
                self._agent.step(readings)  # it skips and counts them
                reason = REPEATED
            if readings is None or reason:
                self._lose(reason)
                self._write()
                continue
            self._note_time(readings.time)
            self._command = self._checked(self._agent.step(readings))
            self._write()
            watch(readings, self._command)
            if self._time - self._begin >= seconds - ROUNDING:
                reasons, left_out = tuple(self._reasons.items()), self._agent.in_use.left_out
                return self._report._replace(reasons=reasons, left_out=left_out)

    def _write(self) -> None:
        """Command the newest target lengths, if there are any."""
        self._emergency_stop.check()
        if self._command is not None:
            self._calls.begin("write")
            self._write_stiffness()
            self._driver.write(self._command)
            self._calls.end()

    def _write_stiffness(self) -> None:
        """Set the stiffness that the agent demands, if it is another than before."""
        stiffness = self._agent.stiffness
        if stiffness is None:
            return
        if self._stiffness is not None and np.array_equal(self._stiffness, stiffness):
            return
        if not isinstance(self._driver, StiffnessDriver):
            raise AgentError(
                f"drive: the agent's stiffness was set, but the driver "
                f"{type(self._driver).__name__} has no method set_stiffness."
            )
        self._driver.set_stiffness(stiffness.copy())
        self._stiffness = stiffness

    def _lose(self, reason: str) -> None:
        """Count a control period without usable readings; an error if there are too many."""
        self._in_a_row += 1
        if reason not in self._reasons or self._report.cycles - self._lost_at >= APART:
            _log.warning(
                "Readings lost (%s); the last command is held. DriveReport counts them.", reason
            )
        self._lost_at = self._report.cycles
        self._reasons[reason] = self._reasons.get(reason, 0) + 1
        self._report = self._report._replace(lost=self._report.lost + 1)
        if self._in_a_row >= self._tolerated:
            raise LostReadingsError(
                f"No usable readings in {self._in_a_row} control periods in a row ({reason}); the "
                "robot was stopped. DriveOptions.lost is the number that ends a drive."
            )

    def _note_time(self, time: float) -> None:
        """Count a control period, and leave a gap out of the time that is driven."""
        self._in_a_row = 0
        gap = self._gaps.update(time)
        if self._gaps.shortest > SLOW:
            raise AgentError(
                f"drive: by their time stamps the readings come every {self._gaps.shortest:.3g} s. "
                "Stamps must be in seconds, not in ms, us or ns, and the control period of an "
                "agent is 5 to 50 ms."
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
