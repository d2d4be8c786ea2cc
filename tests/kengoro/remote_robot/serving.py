"""A robot of two muscles that a thread serves, for these tests."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from jmm_agent.observation import SensorReadings
from kengoro.remote_robot.client import RemoteRobot
from kengoro.remote_robot.messages import Message, MessageReader
from kengoro.remote_robot.server import RobotServer, ServerOptions, Stopped

TOKEN = "a token of the tests"
PERIOD = 0.02


class Plant:
    """Counts calls; the readings are the number of the call, and its frames are small."""

    def __init__(self, height: int = 2) -> None:
        self.calls, self.stops, self.commands = 0, 0, list[np.ndarray]()
        self._height = height

    def read(self) -> SensorReadings:
        self.calls += 1
        frame = np.full((self._height, 3, 3), self.calls % 256, np.uint8)
        lengths = np.array([self.calls, np.nan])
        return SensorReadings(1.7e9 + PERIOD * self.calls, lengths, np.ones(2), frame, -np.inf)

    def write(self, target_lengths: np.ndarray) -> None:
        self.commands.append(target_lengths)

    def stop(self) -> None:
        self.stops += 1


class Served:
    """A plant that is served.

    Attributes:
        port: that it listens on.
        plant: the robot.
        server: of the robot.
        stopped: why it was stopped, in order.
    """

    def __init__(self, options: ServerOptions, **more: Any) -> None:
        self.plant, self.stopped = more.pop("plant", None) or Plant(), list[Stopped]()
        listener = socket.create_server(("127.0.0.1", 0))
        self.port = listener.getsockname()[1]
        self.server = RobotServer(
            self.plant, 2, listener, TOKEN, options, self.stopped.append, **more
        )
        self.thread = threading.Thread(target=self._serve, args=(listener,), daemon=True)
        self.thread.start()

    def _serve(self, listener: socket.socket) -> None:
        with listener:
            self.server.serve()

    def client(self, token: str = TOKEN) -> RemoteRobot:
        return RemoteRobot(self.port, token=token, patience=5.0)

    def wait(self, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + 10.0
        while not condition():
            assert time.monotonic() < end, "it did not happen within 10 s"
            time.sleep(0.002)


@contextmanager
def served(sessions: int, period: float | None = PERIOD, **more: Any) -> Iterator[Served]:
    """A robot for a number of sessions, all of which the test must use."""
    options = {name: more.pop(name) for name in ("proof", "patience") if name in more}
    robot = Served(ServerOptions(period=period, sessions=sessions, **options), **more)
    yield robot
    robot.thread.join(10.0)
    assert not robot.thread.is_alive()


class RawClient:
    """A socket that says what a test sends."""

    def __init__(self, robot: Served) -> None:
        self.line = socket.create_connection(("127.0.0.1", robot.port), 5.0)
        self._reader, self._messages = MessageReader(1 << 20), list[Message]()

    def send(self, **head: Any) -> None:
        self.line.sendall(Message(head).encoded())

    def send_text(self, text: str, size: int | None = None) -> None:
        data = text.encode()
        self.line.sendall((len(data) if size is None else size).to_bytes(4, "big") + data)

    def hear(self) -> Message:
        while not self._messages:
            data = self.line.recv(1 << 16)
            assert data, "the robot has ended the connection without a reason"
            self._messages += self._reader.feed(data)
        return self._messages.pop(0)

    def reason(self) -> str:
        while (message := self.hear()).kind != "end":
            """Readings that were on their way."""
        return message.text("reason")


class RawDriver(RawClient):
    """The same, after it has proved its token."""

    def __init__(self, robot: Served) -> None:
        from kengoro.remote_robot.token import proof

        super().__init__(robot)
        answer = proof(TOKEN, "agent", self.hear().text("challenge"))
        self.send(kind="hello", answer=answer, challenge="x")
        assert self.hear().kind == "welcome"


def command(number: int = 1, to: int = 1, lengths: Any = (0.0, 0.0)) -> str:
    """Text of a command, which may hold what is no JSON."""
    head = {"kind": "command", "number": number, "to": to, "target_lengths": lengths, "bytes": 0}
    return json.dumps(head)
