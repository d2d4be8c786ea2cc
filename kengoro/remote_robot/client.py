"""Driver of a robot in another process: the agent's side of the connection."""

from __future__ import annotations

import secrets
import socket
import time
from collections import deque
from contextlib import suppress

import numpy as np

from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro.errors import UsageError
from kengoro.remote_robot.messages import MAX_FRAME, Message, MessageReader
from kengoro.remote_robot.token import checked, proof, proves, read_token

HOST = "127.0.0.1"
PATIENCE = 60.0
"""Longest wait for a robot that waits for its agent, and for a connection [s]."""
FIRST_WAIT = 1.5
"""Control periods without readings that count as the first lost ones; then each one counts."""
GOODBYE = 0.5
"""Longest wait until the robot confirms that it was stopped [s]."""
CHUNK = 1 << 20


class RemoteRobotError(UsageError):
    """The robot in another process cannot be reached, or has ended the session."""


class RemoteRobot:
    """Driver of a robot that a `RobotServer` serves; a `jmm_agent.PausingDriver`.

    Args:
        port: that the robot listens on.
        host: name or address of the robot's computer.
        token: that the robot knows; from the environment if left out, see `read_token`.
        patience: longest wait for the connection, and for each answer of a robot without a clock of
            its own [s].

    Attributes:
        period: control period of the robot's own clock [s]; None if it waits for each command.
        overtaken: number of readings that were skipped because newer ones had arrived.

    Raises:
        UsageError: there is no robot, or it refuses this client.
    """

    def __init__(
        self,
        port: int,
        host: str = HOST,
        token: str | None = None,
        patience: float = PATIENCE,
    ) -> None:
        token = read_token() if token is None else checked(token)
        self._patience, self._reader = patience, MessageReader(MAX_FRAME)
        self._messages: deque[Message] = deque()
        self._number, self._newest, self.overtaken = 0, 0, 0
        self._stopped = False
        try:
            self._line = socket.create_connection((host, port), patience)
            self._line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except (OSError, OverflowError) as error:
            raise RemoteRobotError(f"No robot answers at {host}, port {port} ({error}).") from error
        try:
            self._greet(token)
        except BaseException:
            self._line.close()
            raise
        self._due = time.monotonic() + patience

    def read(self) -> SensorReadings | None:
        """Wait for the next sensor readings; the newest if several have arrived.

        Returns:
            The readings; None if none came in time from a robot with its own clock.

        Raises:
            UsageError: the robot has ended the session, or sends messages that are not valid.
        """
        newest: SensorReadings | None = None
        wait = self._patience if self.period is None else self._due - time.monotonic()
        while (message := self._next(wait if newest is None else 0.0)) is not None:
            if message.kind == "end":
                raise self._ended(message)
            self.overtaken += newest is not None
            newest = self._readings(message) or newest
        if self.period is None and newest is None:
            raise RemoteRobotError(f"The robot has not answered for {self._patience:g} s.")
        if self.period is not None:
            now = time.monotonic()
            late = max(self._due + self.period, now)
            self._due = late if newest is None else now + FIRST_WAIT * self.period
        return newest

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths (m,) [m].

        Raises:
            UsageError: the robot has ended the session, or takes no commands.
        """
        self._number += 1
        command = {
            "kind": "command",
            "number": self._number,
            "to": self._newest,
            "target_lengths": [float(x) for x in target_lengths],
        }
        try:
            self._send(Message(command))
        except OSError as error:
            while (message := self._next(0.0)) is not None:
                if message.kind == "end":
                    raise self._ended(message) from error
            raise RemoteRobotError(f"The robot takes no commands ({error}).") from error

    def pause(self) -> None:
        """Let the robot hold the last command until the next one."""
        with suppress(OSError):  # then the next call fails
            self._send(Message({"kind": "pause"}))

    def stop(self) -> None:
        """Stop the robot and end the connection; may be called again."""
        if self._stopped:
            return
        self._stopped = True
        with self._line, suppress(OSError):
            try:
                self._line.settimeout(GOODBYE)
                self._send(Message({"kind": "stop"}))
                end = time.monotonic() + GOODBYE
                while time.monotonic() < end and self._line.recv(CHUNK):
                    """Until the robot has ended the connection."""
            finally:
                self._line.shutdown(socket.SHUT_RDWR)  # ends a `read` in another thread

    def _greet(self, token: str) -> None:
        """Prove that this client knows the token, and that the robot does."""
        challenge = secrets.token_hex(16)
        theirs = self._expected("challenge").text("challenge")
        answer = proof(token, "agent", theirs)
        try:
            self._send(Message({"kind": "hello", "answer": answer, "challenge": challenge}))
        except OSError as error:
            raise RemoteRobotError(f"The robot has ended the connection ({error}).") from error
        welcome = self._expected("welcome")
        if not proves(welcome.text("answer"), token, "robot", challenge):
            raise RemoteRobotError("What listens at the robot's port does not know the token.")
        self.muscles, self.period = welcome.integer("muscles"), welcome.number("period")
        if self.period is not None and self.period <= 0.0:
            raise RemoteRobotError(f"The robot's control period is {self.period} s.")

    def _expected(self, kind: str) -> Message:
        """The next message, which must be of a kind."""
        message = self._next(self._patience)
        if message is None:
            raise RemoteRobotError(f"The robot has not answered for {self._patience:g} s.")
        if message.kind == "end":
            raise self._ended(message)
        if message.kind != kind:
            raise RemoteRobotError(
                f"What listens at the robot's port is no robot: it sent {message.kind!r} instead "
                f"of {kind!r}."
            )
        return message

    def _ended(self, message: Message) -> RemoteRobotError:
        return RemoteRobotError(f"The robot has ended the session. {message.text('reason')}")

    def _readings(self, message: Message) -> SensorReadings | None:
        """Readings of a message; None for some that were overtaken."""
        number = message.integer("number")
        if number <= self._newest:
            return None
        self._newest, at = number, message.number("time")
        if at is None:
            raise message.wrong("time", "a finite number")
        lengths, tensions = (
            message.numbers(name, self.muscles, gaps=True) for name in ("lengths", "tensions")
        )
        taken = message.number("frame_time")
        frame_time = -np.inf if taken is None else taken
        encoders = message.head.get("joint_angles")
        joint_angles = None if encoders is None else message.numbers("joint_angles", None, True)
        return SensorReadings(at, lengths, tensions, message.frame(), frame_time, joint_angles)

    def _send(self, message: Message) -> None:
        self._line.settimeout(self._patience)
        self._line.sendall(message.encoded())

    def _next(self, wait: float) -> Message | None:
        """The next message; None if none has arrived within a time [s]."""
        end = time.monotonic() + wait
        while not self._messages:
            try:
                self._line.settimeout(max(0.0, end - time.monotonic()))
                data = self._line.recv(CHUNK)
            except (TimeoutError, BlockingIOError):
                return None
            except OSError as error:
                reason = "it was stopped" if self._stopped else error
                raise RemoteRobotError(
                    f"The connection to the robot is lost ({reason})."
                ) from error
            if not data:
                raise RemoteRobotError("The robot has ended the connection.")
            self._messages += self._reader.feed(data)
        return self._messages.popleft()
