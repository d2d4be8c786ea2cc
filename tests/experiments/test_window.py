"""Watching a run: the page is for this computer only, shows what happens, and changes nothing."""

from __future__ import annotations

import base64
import http.client
import json
import os
import shutil
import socket
import subprocess
import time
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import mujoco
import numpy as np
import pytest

from experiments import window as window_module
from experiments.__main__ import RUNNERS, WATCHABLE, main
from experiments.arm import ACTUAL, make_session, new_agent, shuffled_postures
from experiments.common import Args
from experiments.errors import ExperimentError
from experiments.session import Session, looked_on
from experiments.streaming import Broadcast, PageServer, Shown, data_url
from experiments.study import Study, run_watched
from experiments.watching import Scene
from experiments.window import Viewer, Window
from kengoro_env.assets import asset_path
from kengoro_env.postures import posture_set
from kengoro_env.rendering import RenderingError
from kengoro_env.robot import Robot

POSTURE = posture_set()[0]


@pytest.fixture
def served() -> Iterator[tuple[Broadcast, PageServer]]:
    broadcast = Broadcast()
    server = PageServer(broadcast)
    yield broadcast, server
    server.close()


def ask(port: int, path: str, method: str = "GET", host: str = "127.0.0.1") -> tuple[int, str, Any]:
    """Status, body and headers of an answer."""
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as connection:
        connection.request(method, path, headers={"Host": f"{host}:{port}"})
        answer = connection.getresponse()
        return answer.status, answer.read().decode(), answer.headers


def test_the_page_is_all_that_is_served(served: tuple[Broadcast, PageServer]) -> None:
    port = served[1].port
    status, page, headers = ask(port, "/")
    assert status == 200
    assert "<h1" in page
    assert headers["Content-Security-Policy"].startswith("default-src 'none'")
    assert ask(port, "/", host="localhost")[0] == 200
    for path in ("/window.html", "/../pyproject.toml", "//etc/passwd", "/events/", "/?x"):
        assert ask(port, path)[0] == 404
    assert ask(port, "/", "POST")[0] == 501


def test_only_this_computer_is_answered(served: tuple[Broadcast, PageServer]) -> None:
    broadcast, server = served
    for path in ("/", "/events"):
        assert ask(server.port, path, host="elsewhere.example")[0] == 403
    assert broadcast.watchers == 0
    with socket.socket() as other:  # bound to one address: the port is free on the others
        other.bind(("127.0.0.2", server.port))


def read_event(stream: Any) -> str:
    """The next event of a stream, as text."""
    lines = []
    while (line := stream.readline().decode().strip()) or not lines:
        lines.append(line)
    return "\n".join(lines)


def test_the_stream_sends_what_is_new_and_the_panel_where_it_changed(
    served: tuple[Broadcast, PageServer],
) -> None:
    broadcast, server = served
    with urllib.request.urlopen(f"{server.address}events", timeout=10) as stream:
        found = []
        for number, panel in enumerate(("a", "a", "b")):
            broadcast.publish(Shown({"title": "<b>"}, f"scene {number}", panel))
            found.append(json.loads(read_event(stream).removeprefix("data: ")))
        assert found == [
            {"title": "<b>", "scene": "scene 0", "panel": "a"},
            {"title": "<b>", "scene": "scene 1"},
            {"title": "<b>", "scene": "scene 2", "panel": "b"},
        ]
        assert broadcast.watchers == 1
        broadcast.end()
        assert read_event(stream).startswith("event: end")
    wait_for(lambda: broadcast.watchers == 0)


def test_who_closes_the_page_is_forgotten(
    served: tuple[Broadcast, PageServer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiments.streaming.SILENCE", 0.05)
    broadcast, server = served
    with urllib.request.urlopen(f"{server.address}events", timeout=10):
        wait_for(lambda: broadcast.watchers == 1)
    wait_for(lambda: broadcast.watchers == 0)


def wait_for(happens: Callable[[], object], limit: float = 10.0) -> None:
    """Wait up to ``limit`` [s] until something happens."""
    end = time.monotonic() + limit
    while not happens():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


def test_pictures_arrive_as_they_were() -> None:
    picture = np.random.default_rng(0).integers(0, 255, (6, 8, 3), dtype=np.uint8)
    kind, text = data_url(picture, "png").split(",")
    assert kind == "data:image/png;base64"
    read = cv2.imdecode(np.frombuffer(base64.b64decode(text), np.uint8), cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(cv2.cvtColor(read, cv2.COLOR_BGR2RGB), picture)


@pytest.fixture(scope="module")
def still() -> Any:
    """A session, as far as a window reads it, of a robot that stands still."""
    robot = Robot(asset_path("mjcf/kengoro_arm/posture.xml"))
    robot.reset(POSTURE, np.random.default_rng(0))
    agent = SimpleNamespace(
        options=SimpleNamespace(marker_site="marker_hand"),
        seen=None,
        joint_angles=POSTURE,
        learning=True,
    )
    world = SimpleNamespace(robot=robot, muscles=robot.muscles)
    truth = {"joint_angles": POSTURE}
    return SimpleNamespace(time=1.0, stage="<i>", agent=agent, truth=truth, world=world)


def test_nothing_is_drawn_while_nobody_looks(still: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[object] = []

    def draw(scene: Scene, marks: object) -> np.ndarray:
        drawn.append(marks)
        return np.zeros((4, 4, 3), np.uint8)

    monkeypatch.setattr(Scene, "draw", draw)
    with closing(Window("title")) as window:
        window.look(still)
        assert window._idle.is_set()  # nothing was ordered
        with urllib.request.urlopen(f"{window.address}events", timeout=10) as stream:
            wait_for(lambda: window._broadcast.watchers)
            window.look(still)
            shown = json.loads(read_event(stream).removeprefix("data: "))
    assert len(drawn) == 1
    assert shown["title"] == "title"
    assert shown["doing"] == "<i>"
    assert shown["clock"] == "1.0 s of its time"
    assert shown["look"] == "The hand was not seen yet"
    assert shown["panel"].startswith("data:image/png")


class ShamViewer:
    """MuJoCo's viewer, as far as it is used."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.user_scn, self.cam = mujoco.MjvScene(model, 10), mujoco.MjvCamera()
        self.open, self.synced = True, 0

    def is_running(self) -> bool:
        return self.open

    def lock(self) -> Any:
        return nullcontext()

    def sync(self) -> None:
        self.synced += 1

    def close(self) -> None:
        self.open = False


def test_on_a_display_the_scene_is_in_the_viewer(
    still: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[ShamViewer] = []

    def open_viewer(model: mujoco.MjModel, data: mujoco.MjData) -> ShamViewer:
        assert model is not still.world.robot.model
        assert data is not still.world.robot.data
        mujoco.mj_forward(model, data)
        opened.append(ShamViewer(model))
        return opened[-1]

    monkeypatch.setattr(window_module, "open_viewer", open_viewer)
    with closing(Window("title", on_display=True)) as window:
        window.look(still)
        assert opened[0].user_scn.ngeom == 1
        assert opened[0].synced == 1
        window.look(still)
        assert opened[0].synced == 1  # not more often than `PERIOD`
        opened[0].open = False  # somebody closes it: the run goes on
        window.look(still)
        window.look(SimpleNamespace(**vars(still)))
        assert len(opened) == 1


def test_who_closes_nothing_gets_a_viewer_for_each_session(
    still: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[ShamViewer] = []

    def open_viewer(model: mujoco.MjModel, data: mujoco.MjData) -> ShamViewer:
        mujoco.mj_forward(model, data)
        opened.append(ShamViewer(model))
        return opened[-1]

    monkeypatch.setattr(window_module, "open_viewer", open_viewer)
    with closing(Window("title", on_display=True)) as window:
        window.look(still)
        window.look(SimpleNamespace(**vars(still)))
        assert [viewer.open for viewer in opened] == [False, True]
    assert not opened[1].open


def test_where_the_viewer_does_not_open_the_page_has_the_scene(
    still: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> None:
        raise RenderingError("run it with mjpython")

    monkeypatch.setattr(window_module, "open_viewer", refuse)
    with pytest.raises(RenderingError):
        Viewer(Scene(still.world.robot.model, still.world.muscles))
    with closing(Window("title", on_display=True)) as window:
        window.look(still)
        assert window._scene is not None
    assert "run it with mjpython" in capsys.readouterr().out


class Onlooker:
    """A window that notes its titles."""

    def __init__(self) -> None:
        self.title, self.titles = "", list[str]()

    def look(self, session: object) -> None:
        self.titles.append(self.title)


def stepped(condition: str, seed: int, sizes: object, cache: object) -> dict[str, Any]:
    """A run with a session of one step."""
    from experiments import session

    onlooker = session._onlooker.get()
    assert onlooker is not None
    onlooker(SimpleNamespace())  # type: ignore[arg-type]
    return {"seed": seed}


STUDY = Study("sham", "Sham", "", "", (), (ACTUAL,), None, None, stepped, lambda *_: None)  # type: ignore[arg-type, return-value]


def test_a_watched_study_runs_again_and_names_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    onlooker = Onlooker()

    @contextmanager
    def open_window(title: str) -> Iterator[Onlooker]:
        yield onlooker

    monkeypatch.setattr(window_module, "open_window", open_window)
    tasks = {f"{seed:03d}-actual": (ACTUAL, seed, None, None) for seed in (3, 4)}
    args = Args("3-4", tmp_path, jobs=2, view=True)
    for _ in range(2):
        assert run_watched(STUDY, tasks, args, "key")["004-actual"] == {"seed": 4}
    assert onlooker.titles == ["Sham: robot 3, actual", "Sham: robot 4, actual"] * 2


def test_what_cannot_be_watched_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ExperimentError, match=r"^What a cluster runs cannot be watched.*\.$"):
        run_watched(STUDY, {}, Args("3", tmp_path, cluster="auto", view=True), "key")
    assert main(["initial-training", "--view", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("initial-training cannot be watched: leave out --view.")
    assert said.count("\n") == 1
    assert set(WATCHABLE) <= set(RUNNERS)


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


def new_session(maps: Path) -> tuple[Session, np.ndarray]:
    """An actual robot at its first posture, and the next ones."""
    first, *others = shuffled_postures(3)[:4]
    return make_session(ACTUAL, 3, new_agent(maps, 3), first), np.array(others)


def moved(maps: Path, seconds: float) -> Session:
    session, postures = new_session(maps)
    session.move(postures[0], 1.0, 2.0)
    session.move(postures[1], seconds)
    session.env.close()
    return session


def everything(address: str) -> str:
    """All that a stream sends until its end."""
    with urllib.request.urlopen(address, timeout=20) as stream:
        return str(stream.read().decode())


@pytest.mark.slow
def test_watching_changes_no_bit(maps: Path) -> None:
    alone = moved(maps, 1.0)
    with ThreadPoolExecutor() as pool, closing(Window("title")) as window:
        read = pool.submit(everything, f"{window.address}events")
        wait_for(lambda: window._broadcast.watchers)
        with looked_on(window.look):
            watched = moved(maps, 1.0)
    assert read.result().count("data:image/jpeg") > 0
    for name in ("time", "tensions", "target", "true", "estimate", "look_time", "look_error"):
        np.testing.assert_array_equal(getattr(watched.log, name), getattr(alone.log, name))
    for name, value in alone.observation.items():
        np.testing.assert_array_equal(watched.observation[name], value)


CHROME = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), ""
)
CHROMEDRIVER = shutil.which("chromedriver") or ""


class Browser:
    """A headless Chromium, driven by chromedriver in the words of W3C WebDriver.

    Args:
        folder: for what the browser writes.
    """

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        home = {**os.environ, "HOME": str(folder)}
        self._driver = subprocess.Popen(
            [CHROMEDRIVER, f"--port={port}"], stdout=subprocess.DEVNULL, env=home
        )
        self._base = f"http://127.0.0.1:{port}/session"
        wait_for(lambda: self._answers(port))
        flags = ["headless=new", "no-sandbox", "disable-dev-shm-usage", "window-size=1280,940"]
        options = {"binary": CHROME, "args": [f"--{flag}" for flag in flags]}
        wanted = {"alwaysMatch": {"goog:chromeOptions": options}}
        self._base += f"/{self._tell('', capabilities=wanted)['sessionId']}"

    def _answers(self, port: int) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) == 0

    def _tell(self, command: str, **arguments: Any) -> Any:
        body = json.dumps(arguments).encode()
        request = urllib.request.Request(self._base + command, body)
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)["value"]

    def open(self, address: str) -> None:
        self._tell("/url", url=address)

    def run(self, script: str) -> Any:
        """What a script returns."""
        return self._tell("/execute/sync", script=script, args=[])

    def screenshot(self) -> np.ndarray:
        """What is seen (h, w, 3), BGR."""
        with urllib.request.urlopen(f"{self._base}/screenshot", timeout=60) as answer:
            data = base64.b64decode(json.load(answer)["value"])
        return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)

    def close(self) -> None:
        request = urllib.request.Request(self._base, method="DELETE")
        urllib.request.urlopen(request, timeout=60).close()
        self._driver.terminate()
        self._driver.wait(10)


@pytest.mark.slow
@pytest.mark.skipif(not (CHROME and CHROMEDRIVER), reason="needs Chromium and its chromedriver")
def test_a_browser_shows_a_robot_that_moves(maps: Path, tmp_path: Path) -> None:
    title = "Robot <b>3</b> & co."
    with closing(Window(title)) as window, closing(Browser(tmp_path)) as browser:
        browser.open(window.address)
        wait_for(lambda: window._broadcast.watchers)
        with looked_on(window.look):
            session, postures = new_session(maps)
        views = []
        for posture in postures:
            session.move(posture, 2.0)
            views.append(browser.screenshot())
        part = "return document.getElementById('%s').%s"
        assert browser.run(part % ("title", "textContent")) == title
        assert browser.run(part % ("doing", "textContent")) == "learns"
        assert browser.run(part % ("clock", "textContent")).endswith(" s of its time")
        places = {}
        for name, width in (("scene", 800), ("panel", 460)):
            assert browser.run(part % (name, "naturalWidth")) == width
            box = browser.run(part % (name, "getBoundingClientRect().toJSON()"))
            places[name] = (
                slice(int(box["top"]), int(box["bottom"])),
                slice(int(box["left"]), int(box["right"])),
            )
        first, last = views[0], views[-1]
        for name, place in places.items():
            assert first[place].std() > 20, f"the {name} is of one colour"
            assert (np.abs(first[place].astype(int) - last[place]) > 40).mean() > 0.002, name
        assert first[places["scene"]].mean() > 60  # not black
        window._server.close()
        wait_for(lambda: "has ended" in browser.run(part % ("doing", "textContent")))
    session.env.close()
