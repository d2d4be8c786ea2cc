"""The page of `--view`: a small web server on this computer, and what it hands out.

MuJoCo 4 has a web viewer of its own (`mujoco.studio`). It is not used: it listens on every network
interface, without a choice of address, and whoever reaches it may send it files and read the log.
The page here is served on 127.0.0.1 only, takes nothing from who looks at it, and knows two
addresses: itself and the stream of its pictures.
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

SILENCE = 5.0
"""After so long [s] a page that does not read is given up, and one without news is told so."""

NAMES = ("127.0.0.1", "localhost")
"""By which the page may be asked for: no other site can reach it by a name of its own."""

POLICY = (
    "default-src 'none'; connect-src 'self'; img-src data:; "
    "script-src 'unsafe-inline'; style-src 'unsafe-inline'"
)
"""What the page may load: its pictures come inside the stream, and nothing from elsewhere."""


class Shown(NamedTuple):
    """What a page shows.

    Attributes:
        texts: by the ids of the page's elements.
        scene, panel: pictures as data URLs; "" for none.
    """

    texts: dict[str, str]
    scene: str
    panel: str


def data_url(picture: Image, kind: str) -> str:
    """A picture (h, w, 3), RGB, as text that a page can show; ``kind`` is "jpeg" or "png"."""
    encoded = cv2.imencode(f".{kind}", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))[1].tobytes()
    return f"data:image/{kind};base64,{base64.b64encode(encoded).decode('ascii')}"


class Broadcast:
    """Hands the newest to everybody who looks; what is older is forgotten.

    Attributes:
        watchers: how many look.
        ended: whether nothing more will come.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._number, self._newest = 0, Shown({}, "", "")
        self.watchers = 0
        self.ended = False

    def publish(self, shown: Shown) -> None:
        """Show something new."""
        with self._changed:
            self._number, self._newest = self._number + 1, shown
            self._changed.notify_all()

    def end(self) -> None:
        """Nothing more will come."""
        with self._changed:
            self.ended = True
            self._changed.notify_all()

    def after(self, number: int) -> tuple[int, Shown]:
        """What came after the given number, with its own; the same number again if nothing does
        for `SILENCE` or nothing more will come."""
        with self._changed:
            self._changed.wait_for(lambda: self._number != number or self.ended, SILENCE)
            return self._number, self._newest

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Somebody looks."""
        with self._changed:
            self.watchers += 1
        try:
            yield
        finally:
            with self._changed:
                self.watchers -= 1


class PageServer:
    """Serves the page on a free port of 127.0.0.1 until it is closed.

    Attributes:
        port: of the server.
        address: of the page.
    """

    def __init__(self, broadcast: Broadcast) -> None:
        self._broadcast = broadcast
        self._server = _Server(broadcast)
        self.port = int(self._server.server_address[1])
        self.address = f"http://{NAMES[0]}:{self.port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Tell the pages that the run has ended, and stop."""
        self._broadcast.end()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    """One thread for each request."""

    daemon_threads = False  # closing waits until each page has been told the end

    def __init__(self, broadcast: Broadcast) -> None:
        super().__init__((NAMES[0], 0), _Handler)
        self.broadcast = broadcast


class _Handler(BaseHTTPRequestHandler):
    """Answers one request: the page, or its stream."""

    timeout = SILENCE
    server: _Server

    def do_GET(self) -> None:
        """The page at /, the stream at /events, and nothing else."""
        if self.headers.get("Host", "").rsplit(":", 1)[0] not in NAMES:
            self.send_error(403, "This page is for this computer only")
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
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def _stream(self) -> None:
        """Send what is new; the panel only where it changed."""
        broadcast, number, panel = self.server.broadcast, 0, ""
        with broadcast.watched():
            while True:
                newer, shown = broadcast.after(number)
                if newer == number:
                    if broadcast.ended:
                        break
                    self.wfile.write(b": nothing new\n\n")
                    continue
                event = {**shown.texts, "scene": shown.scene}
                if shown.panel != panel:
                    event["panel"] = shown.panel
                number, panel = newer, shown.panel
                self.wfile.write(f"data: {json.dumps(event)}\n\n".encode())
            self.wfile.write(b"event: end\ndata: -\n\n")

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: the terminal shows the run."""
