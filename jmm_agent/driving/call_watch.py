"""Watches for calls of a driver that do not return.

Python cannot end a thread, nor a call that hangs. A thread beside the loop notices the hanging call
and interrupts it by a signal, where it can: in the main thread of a POSIX system, a call that waits
(a socket, a serial port, sleep) then ends with an exception. Where that does not help, the thread
calls `Driver.stop` itself; then the drive ends when the call returns.
"""

from __future__ import annotations

import logging
import signal
import threading
import time
from types import FrameType, TracebackType

from jmm_agent.driving.emergency_stop import EmergencyStop, EmergencyStopError
from jmm_agent.driving.robot_stop import RobotStop
from jmm_agent.errors import AgentError

POLL = 0.05
"""Longest time between two looks at the clock [s]."""
SHARE = 0.1
"""The same, as a share of the timeout."""

_log = logging.getLogger(__name__)


class DriverTimeoutError(AgentError):
    """A call of the driver has not returned in time."""


class CallWatch:
    """Within this context, calls of the driver that hang, or an emergency stop, stop the robot.

    Args:
        stop: stops the robot.
        timeout: longest duration of a call [s].
        emergency_stop: ends a call, too.
    """

    def __init__(self, stop: RobotStop, timeout: float, emergency_stop: EmergencyStop) -> None:
        self._stop, self._timeout, self._emergency_stop = stop, timeout, emergency_stop
        self._poll = min(POLL, SHARE * timeout)
        self._call: tuple[str, float] | None = None
        self._error: AgentError | None = None
        self._closed = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._watch, name="call-watch", daemon=True)
        self._interrupts = False

    def __enter__(self) -> CallWatch:
        main = threading.current_thread() is threading.main_thread()
        alarm = getattr(signal, "SIGALRM", None)
        if main and alarm is not None and signal.getsignal(alarm) is signal.SIG_DFL:
            signal.signal(alarm, self._interrupt)
            self._interrupts = True
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with self._lock:  # no signal is sent after this
            self._closed.set()
        if self._interrupts:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)

    def begin(self, name: str) -> None:
        """Note that a call begins.

        Args:
            name: of the called method.
        """
        self._call = name, time.monotonic()

    def end(self) -> None:
        """Note that the call has returned.

        Raises:
            DriverTimeoutError: too late; the robot was stopped meanwhile.
            EmergencyStopError: the emergency stop was triggered meanwhile.
        """
        self._call = None
        if self._error is not None:
            raise self._error

    def _watch(self) -> None:
        """Look at the clock until the context ends, or a call hangs."""
        while not self._closed.wait(self._poll):
            call = self._call
            if call is None:
                continue
            self._error = self._reason(*call)
            if self._error is not None:
                _log.error("%s", self._error)
                self._end_call()
                return

    def _reason(self, name: str, since: float) -> AgentError | None:
        """Why the call must end; None if it may go on."""
        try:
            self._emergency_stop.check()
        except EmergencyStopError as error:
            return error
        if time.monotonic() - since <= self._timeout:
            return None
        return DriverTimeoutError(
            f"Driver.{name} has not returned within {self._timeout:g} s; the robot was stopped. "
            f"Driver.{name} should return or raise in time by itself; DriveOptions.timeout is the "
            "longest wait."
        )

    def _end_call(self) -> None:
        """Interrupt the call; stop the robot from here if that does not help."""
        if self._interrupts:
            main = threading.main_thread().ident
            assert main is not None
            with self._lock:
                if self._closed.is_set():
                    return
                signal.pthread_kill(main, signal.SIGALRM)
            if self._closed.wait(self._poll):
                return
        self._stop()

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        """Raise the error within the call that hangs."""
        if self._call is not None and self._error is not None:
            self._call = None
            raise self._error
