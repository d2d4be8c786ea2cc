"""Clients of a robot: each proves that it knows the token, and one at a time drives."""

from __future__ import annotations

import secrets
import selectors
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from kengoro.remote_robot.connection import Connection
from kengoro.remote_robot.messages import Message, MessageError
from kengoro.remote_robot.token import proof, proves

MAX_PENDING = 8
"""Most clients that have not proved anything yet; further ones are turned away."""
LINGER = 1.0
"""Time in which a client may take the reason why its connection ends [s]."""

MakeConnection = Callable[[socket.socket, float], Connection]
"""Accepted socket and deadline -> its connection."""


class Clients:
    """Connections of a `RobotServer`, which never waits for a client.

    Args:
        listener: socket that is bound and listens.
        token: that clients must know.
        welcome: entries of the message that greets the driving client, which describe the robot.
        patience: time in which a client must prove that it knows the token [s].
        make_connection: from an accepted socket and a deadline.

    Attributes:
        active: the client that drives; None without one.
        ended: why the active client's connection has ended; None if it has not.
    """

    def __init__(
        self,
        listener: socket.socket,
        token: str,
        welcome: dict[str, Any],
        patience: float,
        make_connection: MakeConnection = Connection,
    ) -> None:
        listener.setblocking(False)
        self._listener, self._token, self._welcome = listener, token, welcome
        self._patience, self._make_connection = patience, make_connection
        self._selector = selectors.DefaultSelector()
        self._selector.register(listener, selectors.EVENT_READ)
        self._others: list[Connection] = []
        self.active: Connection | None = None
        self.ended: str | None = None

    def poll(self, wait: float) -> list[Message]:
        """Serve all clients.

        Args:
            wait: longest time until something arrives [s].

        Returns:
            Messages of the active client.
        """
        messages: list[Message] = []
        for key, events in self._selector.select(max(0.0, wait)):
            if key.data is None:
                self._accept()
                continue
            connection = key.data
            try:
                if events & selectors.EVENT_WRITE:
                    connection.flush()
                if events & selectors.EVENT_READ:
                    received = connection.receive()
                    if connection is self.active:
                        messages += received
                    else:
                        self._greet(connection, received)
                self._select(connection)
            except MessageError as error:
                self._end(connection, str(error))
            except ConnectionError as error:
                self._drop(connection, str(error))
        self._end_overdue()
        return messages

    def send(self, message: Message) -> None:
        """Send a message to the active client; it ends if that fails.

        Args:
            message: to send.
        """
        if self.active is None:
            return
        try:
            self.active.send(message)
            self._select(self.active)
        except ConnectionError as error:
            self._drop(self.active, str(error))

    def end(self, reason: str) -> None:
        """End the active client's session.

        Args:
            reason: for the client, in a sentence.
        """
        if self.active is not None:
            self._end(self.active, reason)
        self.ended = None

    def close(self) -> None:
        """End all connections."""
        for connection in [*self._others, *([] if self.active is None else [self.active])]:
            self._drop(connection, "the robot is switched off")
        self._selector.close()

    def _accept(self) -> None:
        try:
            line, _ = self._listener.accept()
        except OSError:  # it has ended already
            return
        connection = self._make_connection(line, time.monotonic() + self._patience)
        pending = sum(not other.is_ending for other in self._others)
        if pending >= MAX_PENDING or len(self._others) >= 2 * MAX_PENDING:
            connection.close()
            return
        self._selector.register(line, selectors.EVENT_READ, connection)
        self._others.append(connection)
        connection.challenge = secrets.token_hex(16)
        try:
            connection.send(Message({"kind": "challenge", "challenge": connection.challenge}))
        except ConnectionError as error:
            self._drop(connection, str(error))

    def _greet(self, connection: Connection, messages: list[Message]) -> None:
        """Let a client drive that proves that it knows the token, if no other does."""
        if not messages or connection.is_ending:
            return
        hello = messages[0]
        if hello.kind != "hello":
            raise MessageError("The first message must be of the kind 'hello'.")
        if not proves(hello.text("answer"), self._token, "agent", connection.challenge):
            raise MessageError("The client's token is not the robot's.")
        if self.active is not None:
            raise MessageError(
                "Another client drives this robot, and one at a time can: try again when it has "
                "ended."
            )
        answer = proof(self._token, "robot", hello.text("challenge"))
        self._others.remove(connection)
        self.active, self.ended = connection, None
        self.send(Message({"kind": "welcome", "answer": answer} | self._welcome))

    def _end(self, connection: Connection, reason: str) -> None:
        """End a connection once the client has taken the reason."""
        if connection is self.active:
            self.active, self.ended = None, reason
            self._others.append(connection)
        connection.is_ending, connection.deadline = True, time.monotonic() + LINGER
        try:
            connection.send(Message({"kind": "end", "reason": reason}))
            if not connection.has_unsent:
                connection.line.shutdown(socket.SHUT_WR)
            self._select(connection)
        except OSError as error:
            self._drop(connection, str(error))

    def _drop(self, connection: Connection, reason: str) -> None:
        """End a connection at once."""
        if connection is self.active:
            self.active, self.ended = None, reason
        elif connection in self._others:
            self._others.remove(connection)
        with suppress(KeyError, ValueError):  # it was turned away at once
            self._selector.unregister(connection.line)
        connection.close()

    def _select(self, connection: Connection) -> None:
        """Wait for what the connection needs: bytes, and room for unsent ones."""
        write = selectors.EVENT_WRITE if connection.has_unsent else 0
        if connection.line.fileno() >= 0:
            self._selector.modify(connection.line, selectors.EVENT_READ | write, connection)

    def _end_overdue(self) -> None:
        """Turn away clients that prove nothing, and those that do not take the reason."""
        now = time.monotonic()
        for connection in [other for other in self._others if now >= other.deadline]:
            if connection.is_ending:
                self._drop(connection, "")
            else:
                self._end(connection, f"No token was proved within {self._patience:g} s.")
