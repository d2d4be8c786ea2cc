"""Serves a robot to an agent in another process, and stops it when commands stop coming."""

from __future__ import annotations

import logging
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jmm_agent.driving.driver import Driver, check_methods
from jmm_agent.driving.endings import endings_raised
from jmm_agent.driving.watchdog import PERIODS, Watchdog
from jmm_agent.observation import SensorReadings
from kengoro.errors import UsageError
from kengoro.remote_robot.clients import Clients, MakeConnection
from kengoro.remote_robot.connection import Connection
from kengoro.remote_robot.messages import Message, MessageError, encodable

AGENT, WATCHDOG, CONNECTION, MESSAGE = "agent", "watchdog", "connection", "message"
"""What stopped a robot: the agent's side, or on this side the watchdog, the end of the connection,
or a message that is not valid."""

_log = logging.getLogger(__name__)


class Stopped(NamedTuple):
    """Why and when a robot was stopped.

    Attributes:
        by: "agent", "watchdog", "connection" or "message".
        reason: in a sentence.
        tick: control periods of the robot until then.
    """

    by: str
    reason: str
    tick: int


@dataclass(frozen=True)
class ServerOptions:
    """Times of a `RobotServer`.

    Attributes:
        period: control period [s] of a robot with its own clock; None for a simulated one that
            waits for each command.
        periods: number of periods without a fresh command after which the robot stops.
        patience: longest silence of a client that has paused, or not commanded yet [s].
        proof: time in which a client must prove that it knows the token [s].
        sessions: number of sessions after which the server ends; None for no end.

    Raises:
        UsageError: a time or a number is not positive and finite, or the sessions are not whole.
    """

    period: float | None = None
    periods: int = PERIODS
    patience: float = 60.0
    proof: float = 2.0
    sessions: int | None = None

    def __post_init__(self) -> None:
        for name in ("period", "periods", "patience", "proof", "sessions"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise UsageError(f"The server's {name} is {value}; it must be positive and finite.")
        if self.sessions is not None and not float(self.sessions).is_integer():
            raise UsageError(f"The server's sessions are {self.sessions}; they must be whole.")


class RobotServer:
    """Serves a robot through a socket to one client after the other, in one thread.

    The robot is stopped by a message of the agent, when no fresh command has come for some control
    periods, when the connection ends, after a message that is not valid, and when this process is
    asked to end. The session is over then; a robot moves again only for a new one.

    Args:
        driver: of the robot, in this process.
        muscles: number of its muscles, m.
        listener: socket that is bound and listens.
        token: that clients must know.
        options: times; the defaults if left out.
        stopped: called when the robot was stopped.
        make_connection: from an accepted socket and a deadline; for tests that break lines.

    Attributes:
        tick: number of control periods until now.

    Raises:
        AgentError: the driver lacks a method.
    """

    def __init__(
        self,
        driver: Driver,
        muscles: int,
        listener: socket.socket,
        token: str,
        options: ServerOptions | None = None,
        stopped: Callable[[Stopped], None] = lambda stopped: None,
        make_connection: MakeConnection = Connection,
    ) -> None:
        check_methods(driver)
        self._driver, self._muscles = driver, muscles
        self._options = options = options or ServerOptions()
        welcome = {"muscles": muscles, "period": options.period}
        self._clients = Clients(listener, token, welcome, options.proof, make_connection)
        self._stopped = stopped
        # The robot's own clock, so that a late process of the robot does not stop it.
        self._watchdog = Watchdog(1.0, options.periods, lambda: float(self.tick))
        self.tick = 0
        self._answered, self._sessions = 0, 0
        self._heard = self._next = self._free_since = time.monotonic()

    def serve(self) -> None:
        """Serve until the last session has ended, or the process is asked to end.

        Raises:
            SystemExit: a signal asked the process to end; the robot was stopped.
        """
        period = self._in_step if self._options.period is None else self._in_real_time
        try:
            with endings_raised():
                while self._sessions != self._options.sessions:
                    period()
        finally:
            self._driver.stop()
            self._clients.close()

    def _in_step(self) -> None:
        """One period of a robot that waits for its client."""
        if self._clients.active is None:
            self._poll(1.0)
            if self._clients.active is None:
                self._end_if_unused()
                return
        self._send_readings()
        while self._clients.active is not None and self._answered != self.tick:
            self._poll(self._options.patience)

    def _in_real_time(self) -> None:
        """One period of a robot with its own clock."""
        assert self._options.period is not None
        self._send_readings()
        if self._watchdog.expired:
            periods = self._options.periods
            self._stop(WATCHDOG, f"no fresh command came for {periods} control periods")
        self._next = max(self._next + self._options.period, time.monotonic())
        self._poll(self._next - time.monotonic())
        while (wait := self._next - time.monotonic()) > 0.0:
            self._poll(wait)
        if self._clients.active is None:
            self._end_if_unused()

    def _send_readings(self) -> None:
        """Run one control period, and send its readings unless the client is still busy."""
        readings = self._driver.read()
        self.tick += 1
        active = self._clients.active
        if readings is not None and active is not None and not active.has_unsent:
            self._clients.send(self._message(readings))

    def _message(self, readings: SensorReadings) -> Message:
        frame, angles = readings.frame, readings.joint_angles
        head = {
            "kind": "readings",
            "number": self.tick,
            "time": float(readings.time),
            "lengths": encodable(readings.lengths),
            "tensions": encodable(readings.tensions),
            "frame": None if frame is None else list(frame.shape),
            "frame_time": encodable(np.array(readings.frame_time))[0],
            "joint_angles": None if angles is None else encodable(angles),
        }
        return Message(head, b"" if frame is None else frame.tobytes())

    def _poll(self, wait: float) -> None:
        """Serve all clients, and carry out the messages of the active one."""
        was_active = self._clients.active is not None
        messages = self._clients.poll(wait)
        now = time.monotonic()
        if messages or not was_active:
            self._heard = now
        try:
            for message in messages:
                if self._clients.active is not None or self._clients.ended is not None:
                    self._obey(message)
        except MessageError as error:
            self._stop(MESSAGE, str(error))
        if self._clients.ended is not None:
            self._stop(CONNECTION, self._clients.ended)
        elif self._clients.active is not None and now - self._heard >= self._options.patience:
            self._stop(CONNECTION, f"no message came for {self._options.patience:g} s")

    def _obey(self, message: Message) -> None:
        if message.kind == "command":
            target_lengths = message.numbers("target_lengths", self._muscles)
            number, to = message.integer("number"), message.integer("to")
            if self._options.period is None:
                fresh = to == self.tick
                self._answered = to if fresh else self._answered
            else:
                fresh = self._watchdog.command(number)
            if fresh:
                self._driver.write(target_lengths)
        elif message.kind == "pause":
            self._watchdog.pause()
        elif message.kind == "stop":
            self._stop(AGENT, "the agent has stopped it")
        else:
            raise MessageError(
                f"A message is of the kind {message.kind!r}; there are 'command', 'pause' and "
                "'stop'."
            )

    def _stop(self, by: str, reason: str) -> None:
        """Stop the robot and end the session."""
        try:
            self._driver.stop()
        except Exception:  # the server must go on for the next client
            _log.exception("The robot's driver failed to stop.")
        self._clients.end(f"The robot was stopped: {reason}.")
        self._watchdog.reset()
        self._sessions += 1
        self._free_since = time.monotonic()
        self._stopped(Stopped(by, reason, self.tick))

    def _end_if_unused(self) -> None:
        """End a server of a limited number of sessions if no client has come for a time."""
        unused = time.monotonic() - self._free_since > self._options.patience
        if self._options.sessions is not None and unused:
            self._sessions = self._options.sessions
