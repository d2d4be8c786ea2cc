"""Web server of the viewer's page and of its stream of server-sent events.

The server listens on 127.0.0.1 only, reads nothing from its clients but the request, and has two
paths: ``/`` is the page, ``/events`` the stream.

MuJoCo 4 has a web viewer, `mujoco.studio`. It is not used because it listens on every network
interface, and each client that reaches it can send it files and read the log.
"""

from __future__ import annotations

import base64
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from typing import NamedTuple

import cv2

from kengoro_env.vision.rendering import Image

TIMEOUT = 5.0
"""Longest wait for a client, and for new content [s]. After such a wait a stream sends a comment,
which fails if the client has disconnected."""

HOSTS = ("127.0.0.1", "localhost")
"""Host names that requests may use; this prevents DNS rebinding by another site."""

CONTENT_POLICY = (
    "default-src 'none'; connect-src 'self'; img-src data:; "
    "script-src 'unsafe-inline'; style-src 'unsafe-inline'"
)
"""Content security policy of the page: pictures come in the stream, nothing from other sites."""


class PageContent(NamedTuple):
    """Content of the page at one moment.

    Attributes:
        texts: by the ids of the page's elements.
        scene, panel: pictures as data URLs; "" for none.
    """

    texts: dict[str, str]
    scene: str
    panel: str


def data_url(picture: Image, kind: str) -> str:
    """Encode a picture as a data URL.

    Args:
        picture: shape (h, w, 3), RGB.
        kind: "jpeg" or "png".
    """
    encoded = cv2.imencode(f".{kind}", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes()
    return f"data:image/{kind};base64,{base64.b64encode(encoded).decode('ascii')}"


class Broadcast:
    """Passes the newest content to all clients; older content is dropped.

    Attributes:
        watchers: number of clients that read the stream.
        ended: whether the run has ended.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._number, self._newest = 0, PageContent({}, "", "")
        self.watchers = 0
        self.ended = False

    def publish(self, content: PageContent) -> None:
        """Replace the content."""
        with self._changed:
            self._number, self._newest = self._number + 1, content
            self._changed.notify_all()

    def end(self) -> None:
        """Mark the end of the run."""
        with self._changed:
            self.ended = True
            self._changed.notify_all()

    def after(self, number: int) -> tuple[int, PageContent]:
        """Wait for newer content, at most `TIMEOUT` or until the run ends.

        Args:
            number: of the content that the client has; 0 for none.

        Returns:
            Number of the newest content, which is ``number`` if there is no newer one, and the
            content.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._number != number or self.ended, TIMEOUT)
            return self._number, self._newest

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Count a client in `watchers` within this context."""
        with self._changed:
            self.watchers += 1
        try:
            yield
        finally:
            with self._changed:
                self.watchers -= 1


class PageServer:
    """Serves the page on a free port of 127.0.0.1 until it is closed.

    Args:
        broadcast: source of the page's content.

    Attributes:
        port: of the server.
        address: URL of the page.
    """

    def __init__(self, broadcast: Broadcast) -> None:
        self._broadcast = broadcast
        self._server = _Server(broadcast)
        self.port = int(self._server.server_address[1])
        self.address = f"http://{HOSTS[0]}:{self.port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Mark the end of the run on the pages, and stop the server."""
        self._broadcast.end()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    """HTTP server with a thread for each request."""

    daemon_threads = False  # so that closing waits until each stream has sent its end

    def __init__(self, broadcast: Broadcast) -> None:
        super().__init__((HOSTS[0], 0), _Handler)
        self.broadcast = broadcast


class _Handler(BaseHTTPRequestHandler):
    """Answers a request with the page or its stream."""

    timeout = TIMEOUT
    server: _Server

    def do_GET(self) -> None:
        """Answer a GET request."""
        if self.headers.get("Host", "").rsplit(":", 1)[0] not in HOSTS:
            self.send_error(403, "This page is served to this computer only")
        elif self.path == "/":
            self._send_head("text/html; charset=utf-8")
            self.wfile.write((files("kengoro.viewer") / "window.html").read_bytes())
        elif self.path == "/events":
            self._send_head("text/event-stream")
            with suppress(OSError):  # the page was closed
                self._stream()
        else:
            self.send_error(404)

    def _send_head(self, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", CONTENT_POLICY)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def _stream(self) -> None:
        """Send new content until the run ends; the panel only if it changed."""
        broadcast, number, panel = self.server.broadcast, 0, ""
        with broadcast.watched():
            while True:
                newer, content = broadcast.after(number)
                if newer == number:
                    if broadcast.ended:
                        break
                    self.wfile.write(b": no new content\n\n")
                    continue
                event = {**content.texts, "scene": content.scene}
                if content.panel != panel:
                    event["panel"] = content.panel
                number, panel = newer, content.panel
                self.wfile.write(f"data: {json.dumps(event)}\n\n".encode())
            self.wfile.write(b"event: end\ndata: -\n\n")

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing: the terminal shows the run."""
