"""One connection to a client: never waits, and holds a bounded number of bytes."""

from __future__ import annotations

import socket
from contextlib import suppress

from kengoro.remote_robot.messages import Message, MessageReader

CHUNK = 64 << 10
"""Most bytes that are received at once."""


class Connection:
    """A client of a `RobotServer`.

    Args:
        line: accepted socket.
        deadline: time until which the client must have proved that it knows the token [s].

    Attributes:
        line: the socket.
        deadline: as above.
        challenge: random text that was sent to the client; empty before.
        is_ending: whether it is closed as soon as everything is sent.
    """

    def __init__(self, line: socket.socket, deadline: float) -> None:
        line.setblocking(False)
        with suppress(OSError):  # not every socket is one of TCP
            line.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.line, self.deadline = line, deadline
        self.challenge, self.is_ending = "", False
        self._reader, self._unsent = MessageReader(), bytearray()

    @property
    def has_unsent(self) -> bool:
        """Whether the client has not taken all bytes yet."""
        return bool(self._unsent)

    def receive(self) -> list[Message]:
        """Messages that have arrived.

        Raises:
            ConnectionError: the client has ended the connection.
            MessageError: a message is not valid.
        """
        try:
            data = self.line.recv(CHUNK)
        except BlockingIOError:
            return []
        except OSError as error:
            raise ConnectionError(str(error)) from error
        if not data:
            raise ConnectionError("the client has ended the connection")
        return self._reader.feed(data)

    def send(self, message: Message) -> None:
        """Send a message, now or when the client takes it.

        Args:
            message: to send.

        Raises:
            ConnectionError: the client has ended the connection.
        """
        self._unsent += message.encoded()
        self.flush()

    def flush(self) -> None:
        """Send as much as the client takes.

        Raises:
            ConnectionError: the client has ended the connection.
        """
        while self._unsent:
            try:
                sent = self.line.send(self._unsent)
            except BlockingIOError:
                return
            except OSError as error:
                raise ConnectionError(str(error)) from error
            del self._unsent[:sent]

    def close(self) -> None:
        """End the connection."""
        with suppress(OSError):
            self.line.close()
