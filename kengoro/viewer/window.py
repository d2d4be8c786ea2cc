"""`--view`: who looks at sessions that run. A page for a browser, and MuJoCo's viewer on a display.

Without a display the page shows the scene, too. With one the scene is in MuJoCo's viewer, where the
mouse turns it, and the page shows the rest: the viewer's own texts and figures are not used, since
each makes the run wait until a picture is drawn, for good if somebody closes the viewer meanwhile.
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
from kengoro.viewer.scene import (
    Curves,
    Moment,
    Panel,
    Scene,
    Story,
    add_marks,
    place_outside_camera,
)
from kengoro.viewer.web import Broadcast, PageServer, Shown, data_url
from kengoro_env.vision.rendering import RenderingError, has_display, open_viewer

PERIOD = 0.1
"""Least time between two pictures [s]."""

PANEL_PERIOD = 2.0
"""Least time between two pictures of the curves [s]; they cost the run more than the scene."""

WIDTH, HEIGHT = 800, 600
"""Size of the scene on a page [pixels]."""

CLOSING = 5.0
"""Longest wait for a viewer to close [s]."""


@contextmanager
def open_window(title: str) -> Iterator[Window]:
    """A window that is open meanwhile; the address of its page is printed."""
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
    """Shows one session after the other. The run never waits for it.

    A thread of its own draws what the page shows, with a GL context of its own, and only while
    somebody looks: the run hands it a copy of the state when it has nothing to do, and goes on.

    Args:
        title: what is shown.
        on_display: whether the scene is in MuJoCo's viewer, not on the page.

    Attributes:
        title: may be changed.
        address, port: of the page.
    """

    def __init__(self, title: str, on_display: bool = False) -> None:
        self.title = title
        self._on_display = on_display
        self._session: Session | None = None
        self._story = Story()
        self._scene: Scene | None = None
        self._viewer: Viewer | None = None
        self._broadcast = Broadcast()
        self._orders: queue.SimpleQueue[_Order | None] = queue.SimpleQueue()
        self._idle = threading.Event()
        self._idle.set()
        self._server = PageServer(self._broadcast)
        self.address, self.port = self._server.address, self._server.port
        self._thread = threading.Thread(target=self._draw, daemon=True)
        self._thread.start()

    def look(self, session: Session) -> None:
        """To be called after every step of a session."""
        if session is not self._session:
            self._session, self._story = session, Story()
            self._begin(session)
        self._story.note(session)
        if self._viewer is not None:
            self._viewer.show(session, self._story)
        if self._broadcast.watchers and self._idle.is_set():
            self._order(session)

    def _begin(self, session: Session) -> None:
        """Another session begins: copy its robot."""
        model, muscles = session.world.robot.model, session.world.muscles
        if self._viewer is not None:
            self._on_display = self._viewer.is_open  # else whoever closed it wants no other
            self._viewer.close()
            self._viewer = None
        if self._on_display:
            try:
                self._viewer = Viewer(Scene(model, muscles))
            except RenderingError as error:
                get_console().print(f"MuJoCo's viewer does not open: {error}")
                self._on_display = False
        self._scene = None if self._on_display else Scene(model, muscles, WIDTH, HEIGHT)

    def _order(self, session: Session) -> None:
        """Copy the state and let it be drawn."""
        self._idle.clear()
        moment = self._story.moment(session)
        if self._scene is not None:
            self._scene.follow(session.world.robot.data, moment)
        texts = {"title": self.title, **state_texts(moment)}
        self._orders.put(_Order(self._scene, moment, self._story.curves(), texts))

    def _draw(self) -> None:
        """Draw what is ordered until the end, no more than half of the time."""
        panel, drawn, next_panel = Panel(), "", 0.0
        scene: Scene | None = None
        while (order := self._orders.get()) is not None:
            begin = time.monotonic()
            if scene is not None and scene is not order.scene:
                scene.close()
            scene, picture = order.scene, ""
            if scene is not None:
                picture = data_url(scene.draw(order.moment.marks), "jpeg")
            if begin >= next_panel:
                drawn, next_panel = data_url(panel.draw(order.curves), "png"), begin + PANEL_PERIOD
            self._broadcast.publish(Shown(order.texts, picture, drawn))
            took = time.monotonic() - begin
            time.sleep(max(took, PERIOD - took))
            self._idle.set()
        if scene is not None:
            scene.close()

    def close(self) -> None:
        """Tell the pages that the run has ended; close the viewer and the server."""
        self._orders.put(None)
        self._server.close()
        self._thread.join()
        if self._viewer is not None:
            self._viewer.close()


class _Order(NamedTuple):
    """What is to be drawn."""

    scene: Scene | None
    moment: Moment
    curves: Curves
    texts: dict[str, str]


class Viewer:
    """MuJoCo's own viewer on a copy of a robot: the mouse turns the scene, and pushes nothing.

    Raises:
        RenderingError: it does not open.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._next = scene, 0.0
        others = set(threading.enumerate())
        self._viewer = open_viewer(scene.model, scene.data)
        with self._viewer.lock():
            place_outside_camera(self._viewer.cam, scene.data)
        self._threads = set(threading.enumerate()) - others  # MuJoCo does not hand them out

    @property
    def is_open(self) -> bool:
        """Whether nobody has closed it."""
        return bool(self._viewer.is_running())

    def show(self, session: Session, story: Story) -> None:
        """Show the session as it is now, unless it was shown just now."""
        now = time.monotonic()
        if now < self._next or not self.is_open:
            return
        self._next = now + PERIOD
        moment = story.moment(session)
        with self._viewer.lock():
            self._scene.follow(session.world.robot.data, moment)
            self._viewer.user_scn.ngeom = 0
            add_marks(self._viewer.user_scn, moment.marks)
        self._viewer.sync()

    def close(self) -> None:
        """Close it, and wait until it is: a program must not end while it draws."""
        self._viewer.close()
        for thread in self._threads:
            thread.join(CLOSING)


def state_texts(moment: Moment) -> dict[str, str]:
    """What is told of a moment: the clock, what the robot does, and how old the newest look is."""
    look = "The hand was not seen yet"
    if moment.observation_time is not None:
        look = f"The hand was seen {moment.time - moment.observation_time:.1f} s ago"
    return {"clock": f"{moment.time:.1f} s of its time", "doing": moment.doing, "look": look}
