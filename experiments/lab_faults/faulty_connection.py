"""A connection whose packets are lost, delayed or repeated, or that is unplugged."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Callable

from kengoro.remote_robot.connection import Connection
from kengoro.remote_robot.messages import Message

READINGS_LOST, COMMANDS_LOST, ALL_LOST = "readings_lost", "commands_lost", "all_lost"
DELAYED, DUPLICATED, UNPLUGGED = "delayed", "duplicated", "unplugged"
DELAY = 1
"""Control periods by which packets are delayed, in each direction."""


class LineFault:
    """What is wrong with the line now.

    Attributes:
        kind: of the fault; empty without one.
        until: control period of the robot at which it ends.
        tick: number of the present control period.
    """

    def __init__(self) -> None:
        self.kind, self.until = "", 0.0
        self.tick: Callable[[], int] = lambda: 0

    def begin(self, kind: str, periods: float) -> None:
        """Break the line for some control periods of the robot."""
        self.until = self.tick() + periods
        self.kind = kind

    @property
    def now(self) -> str:
        """Kind of the fault; empty while there is none."""
        return self.kind if self.tick() < self.until else ""


class FaultyConnection(Connection):
    """A `Connection` with the faults of a line.

    Args:
        line: accepted socket.
        deadline: as of a `Connection`.
        fault: of the line.
    """

    def __init__(self, line: socket.socket, deadline: float, fault: LineFault) -> None:
        super().__init__(line, deadline)
        self._fault = fault
        self._late_commands: deque[tuple[int, Message]] = deque()
        self._late_readings: deque[tuple[int, Message]] = deque()

    def receive(self) -> list[Message]:
        """Messages that the line lets through."""
        messages, fault = super().receive(), self._fault.now
        if fault == UNPLUGGED:
            raise ConnectionError("the line was unplugged")
        if fault == ALL_LOST or (fault == COMMANDS_LOST and self._are(messages, "command")):
            return []
        if fault == DUPLICATED:
            return [message for message in messages for _ in range(2)]
        return self._delayed(self._late_commands, messages)

    def send(self, message: Message) -> None:
        """Send a message if the line lets it through."""
        fault = self._fault.now
        if fault == UNPLUGGED:
            raise ConnectionError("the line was unplugged")
        if fault == ALL_LOST or (fault == READINGS_LOST and message.kind == "readings"):
            return
        if fault == DUPLICATED:
            super().send(message)
        messages = [message] if message.kind != "readings" else self._delayed(
            self._late_readings, [message]
        )  # fmt: skip
        for late in messages:
            super().send(late)

    def _delayed(self, queue: deque[tuple[int, Message]], messages: list[Message]) -> list[Message]:
        """Messages that are due now, after these have been added to the queue."""
        tick = self._fault.tick()
        due = tick + (DELAY if self._fault.now == DELAYED else 0)
        queue.extend((due, message) for message in messages)
        found: list[Message] = []
        while queue and queue[0][0] <= tick:
            found.append(queue.popleft()[1])
        return found

    @staticmethod
    def _are(messages: list[Message], kind: str) -> bool:
        return all(message.kind == kind for message in messages)
