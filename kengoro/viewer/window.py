"""Window on running sessions: a page for a browser, and MuJoCo's viewer on a display.

Without a display the page shows the scene and the panel. With a display MuJoCo's viewer shows the
scene, which the mouse turns, and the page shows texts and panel. The viewer's own texts and figures
are not used: each call waits until a picture is drawn, forever if the viewer is closed meanwhile.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from rich import get_console

from kengoro.session import Session
from kengoro.viewer.history import Curves, Moment, SessionHistory
from kengoro.viewer.panel import Panel
from kengoro.viewer.scene import Scene, add_marks, match_outside_camera
from kengoro.viewer.web import Broadcast, PageContent, PageServer, data_url
from kengoro_env.errors import RenderingError
from kengoro_env.vision.rendering import has_display, open_viewer

PERIOD = 0.1
"""Least time between two pictures [s]."""

PANEL_PERIOD = 2.0
"""Least time between two pictures of the panel [s]; they cost the run more than the scene."""

WIDTH, HEIGHT = 800, 600
"""Size of the scene on a page [pixels]."""

CLOSE_TIMEOUT = 5.0
"""Longest wait for the viewer's threads to end [s]."""


@contextmanager
def open_window(title: str) -> Iterator[Window]:
    """Open a window within this context and print the address of its page.

    Args:
        title: title of the page.
    """
    window = Window(title, has_display())
    address, port = window.address, window.port
    get_console().print(
        f"Watch at {address} (from another computer: ssh -L {port}:127.0.0.1:{port} ..., then the "
        "same address there)",
        soft_wrap=True,
    )
    try:
        yield window
    finally:
        window.close()


class Window:
    """Shows sessions, one at a time. The run never waits for it.

    A separate thread with its own GL context draws the pictures of the page, and only while a
    client reads them. When the thread is idle the run passes it a copy of the state and continues.

    Args:
        title: title of the page.
        on_display: whether MuJoCo's viewer shows the scene instead of the page.

    Attributes:
        title: title of the page; it may be changed.
        address: URL of the page.
        port: of its server.
    """

    def __init__(self, title: str, on_display: bool = False) -> None:
        self.title = title
        self._on_display = on_display
        self._session: Session | None = None
        self._history = SessionHistory()
        self._scene: Scene | None = None
        self._viewer: Viewer | None = None
        self._broadcast = Broadcast()
        self._requests: queue.SimpleQueue[_Request | None] = queue.SimpleQueue()
        self._idle = threading.Event()
        self._idle.set()
        self._server = PageServer(self._broadcast)
        self.address, self.port = self._server.address, self._server.port
        self._thread = threading.Thread(target=self._draw, daemon=True)
        self._thread.start()

    def show(self, session: Session) -> None:
        """Show a session; call it after every step."""
        if session is not self._session:
            self._session, self._history = session, SessionHistory()
            self._begin(session)
        self._history.record(session)
        if self._viewer is not None:
            self._viewer.show(session, self._history)
        if self._broadcast.watchers and self._idle.is_set():
            self._request_pictures(session)

    def _begin(self, session: Session) -> None:
        """Copy the robot of a new session."""
        model, muscles = session.world.robot.model, session.world.muscles
        if self._viewer is not None:
            self._on_display = self._viewer.is_open  # a user who closed it gets no other
            self._viewer.close()
            self._viewer = None
        if self._on_display:
            try:
                self._viewer = Viewer(Scene(model, muscles))
            except RenderingError as error:
                get_console().print(f"MuJoCo's viewer cannot be opened: {error}")
                self._on_display = False
        self._scene = None if self._on_display else Scene(model, muscles, WIDTH, HEIGHT)

    def _request_pictures(self, session: Session) -> None:
        """Copy the state and pass it to the drawing thread."""
        self._idle.clear()
        moment = self._history.moment(session)
        if self._scene is not None:
            self._scene.update(session.world.robot.data, moment.tensions)
        texts = {"title": self.title, **state_texts(moment)}
        self._requests.put(_Request(self._scene, moment, self._history.curves(), texts))

    def _draw(self) -> None:
        """Draw the requested pictures until the end, at most half of the time."""
        panel, panel_url, next_panel = Panel(), "", 0.0
        scene: Scene | None = None
        while (request := self._requests.get()) is not None:
            begin = time.monotonic()
            if scene is not None and scene is not request.scene:
                scene.close()
            scene, scene_url = request.scene, ""
            if scene is not None:
                scene_url = data_url(scene.draw(request.moment.marks), "jpeg")
            if begin >= next_panel:
                panel_url = data_url(panel.draw(request.curves), "png")
                next_panel = begin + PANEL_PERIOD
            self._broadcast.publish(PageContent(request.texts, scene_url, panel_url))
            duration = time.monotonic() - begin
            time.sleep(max(duration, PERIOD - duration))
            self._idle.set()
        if scene is not None:
            scene.close()

    def close(self) -> None:
        """Mark the end of the run on the page, and close server and viewer."""
        self._requests.put(None)
        self._server.close()
        self._thread.join()
        if self._viewer is not None:
            self._viewer.close()


class _Request(NamedTuple):
    """Request to draw the pictures of the page."""

    scene: Scene | None
    moment: Moment
    curves: Curves
    texts: dict[str, str]


class Viewer:
    """MuJoCo's viewer on a copy of a robot: the mouse turns the view and cannot push the robot.

    Args:
        scene: the copy.

    Raises:
        RenderingError: the viewer cannot be opened.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._next = scene, 0.0
        others = set(threading.enumerate())
        self._viewer = open_viewer(scene.model, scene.data)
        with self._viewer.lock():
            match_outside_camera(self._viewer.cam, scene.data)
        self._threads = set(threading.enumerate()) - others  # MuJoCo does not expose them

    @property
    def is_open(self) -> bool:
        """Whether the viewer was not closed."""
        return bool(self._viewer.is_running())

    def show(self, session: Session, history: SessionHistory) -> None:
        """Show the session as it is now, unless it was shown less than `PERIOD` ago."""
        now = time.monotonic()
        if now < self._next or not self.is_open:
            return
        self._next = now + PERIOD
        moment = history.moment(session)
        with self._viewer.lock():
            self._scene.update(session.world.robot.data, moment.tensions)
            self._viewer.user_scn.ngeom = 0
            add_marks(self._viewer.user_scn, moment.marks)
        self._viewer.sync()

    def close(self) -> None:
        """Close the viewer and wait for its threads: a program must not end while they draw."""
        self._viewer.close()
        for thread in self._threads:
            thread.join(CLOSE_TIMEOUT)


def state_texts(moment: Moment) -> dict[str, str]:
    """Texts of the page, by the ids of its elements: simulated time, stage, newest observation."""
    observation = "hand not seen yet"
    if moment.observation_time is not None:
        observation = f"hand seen {moment.time - moment.observation_time:.1f} s ago"
    return {
        "time": f"simulated time {moment.time:.1f} s",
        "stage": moment.stage,
        "observation": observation,
    }
