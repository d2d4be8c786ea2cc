"""The window shows running sessions and changes nothing."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, nullcontext
from importlib.resources import files
from itertools import cycle
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

from experiments.__main__ import RUNNERS, WATCHABLE, main
from experiments.harness.common import Args
from experiments.harness.errors import ExperimentError
from experiments.harness.experiment import Experiment, run_watched
from experiments.robots.conditions import ACTUAL, make_session
from kengoro import session as session_module
from kengoro.agents import make_agent
from kengoro.robots import shuffled_postures
from kengoro.session import Session, shown_by
from kengoro.viewer import window as window_module
from kengoro.viewer.history import SessionHistory
from kengoro.viewer.scene import Scene
from kengoro.viewer.web import PageContent
from kengoro.viewer.window import Viewer, Window, state_texts
from kengoro_env.assets import asset_path
from kengoro_env.errors import RenderingError
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot
from tests.kengoro.viewer.page_clients import CHROME, CHROMEDRIVER, Browser, read_event, wait_for

POSTURE = posture_set()[0]


@pytest.fixture(scope="module")
def still_session() -> Any:
    """Stub of a session with the attributes that a window reads; its robot stands still."""
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


def test_no_picture_is_made_without_a_client(
    still_session: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures: list[object] = []

    def draw(scene: Scene, marks: object) -> np.ndarray:
        pictures.append(marks)
        return np.zeros((4, 4, 3), np.uint8)

    monkeypatch.setattr(Scene, "draw", draw)
    with closing(Window("title")) as window:
        window.show(still_session)
        assert window._idle.is_set()  # no pictures were requested
        with urllib.request.urlopen(f"{window.address}events", timeout=10) as stream:
            wait_for(lambda: window._broadcast.watchers)
            window.show(still_session)
            content = json.loads(read_event(stream).removeprefix("data: "))
    assert len(pictures) == 1
    assert content["title"] == "title"
    assert content["stage"] == "<i>"
    assert content["time"] == "simulated time 1.0 s"
    assert content["observation"] == "hand not seen yet"
    assert content["panel"].startswith("data:image/png")


def test_the_page_has_an_element_for_each_text(still_session: Any) -> None:
    page = (files("kengoro.viewer") / "window.html").read_text(encoding="utf-8")
    texts = state_texts(SessionHistory().moment(still_session))
    for name in (*texts, "title", *PageContent._fields[1:]):
        assert f'id="{name}"' in page
        assert f'"{name}"' in page.split("<script>")[1]


def test_the_age_of_the_newest_observation_is_shown(still_session: Any) -> None:
    moment = SessionHistory().moment(still_session)._replace(time=3.0, observation_time=1.5)
    assert state_texts(moment)["observation"] == "hand seen 1.5 s ago"


class StubViewer:
    """Stub of MuJoCo's viewer with the attributes that are used."""

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


def test_on_a_display_the_viewer_shows_the_scene(
    still_session: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[StubViewer] = []

    def open_viewer(model: mujoco.MjModel, data: mujoco.MjData) -> StubViewer:
        assert model is not still_session.world.robot.model
        assert data is not still_session.world.robot.data
        mujoco.mj_forward(model, data)
        opened.append(StubViewer(model))
        return opened[-1]

    monkeypatch.setattr(window_module, "open_viewer", open_viewer)
    with closing(Window("title", on_display=True)) as window:
        window.show(still_session)
        assert opened[0].user_scn.ngeom == 1
        assert opened[0].synced == 1
        window.show(still_session)
        assert opened[0].synced == 1  # not more often than `PERIOD`
        opened[0].open = False  # as if a user closed it: the run goes on
        window.show(still_session)
        window.show(SimpleNamespace(**vars(still_session)))
        assert len(opened) == 1


def test_each_session_has_a_viewer_until_one_is_closed(
    still_session: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[StubViewer] = []

    def open_viewer(model: mujoco.MjModel, data: mujoco.MjData) -> StubViewer:
        mujoco.mj_forward(model, data)
        opened.append(StubViewer(model))
        return opened[-1]

    monkeypatch.setattr(window_module, "open_viewer", open_viewer)
    with closing(Window("title", on_display=True)) as window:
        window.show(still_session)
        window.show(SimpleNamespace(**vars(still_session)))
        assert [viewer.open for viewer in opened] == [False, True]
    assert not opened[1].open


def test_the_page_has_the_scene_if_the_viewer_cannot_be_opened(
    still_session: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> None:
        raise RenderingError("run it with mjpython")

    monkeypatch.setattr(window_module, "open_viewer", refuse)
    with pytest.raises(RenderingError):
        Viewer(Scene(still_session.world.robot.model, still_session.world.muscles))
    with closing(Window("title", on_display=True)) as window:
        window.show(still_session)
        assert window._scene is not None
    assert "run it with mjpython" in capsys.readouterr().out


class TitleRecorder:
    """Stub of a window that records its titles."""

    def __init__(self) -> None:
        self.title, self.titles = "", list[str]()

    def show(self, session: object) -> None:
        self.titles.append(self.title)


def run_one_step(condition: str, seed: int, sizes: object, cache: object) -> dict[str, Any]:
    """Run of an experiment with a session of one step."""
    viewer = session_module._viewer.get()
    assert viewer is not None
    viewer(SimpleNamespace())  # type: ignore[arg-type]
    return {"seed": seed}


EXPERIMENT = Experiment(
    name="stub",
    title="Stub",
    introduction="",
    figure="",
    conditions=(ACTUAL,),
    sizes=None,
    quick=None,
    run=run_one_step,
    conclude=lambda *_: None,  # type: ignore[arg-type, return-value]
)


def test_a_watched_experiment_runs_again_and_its_title_names_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = TitleRecorder()

    @contextmanager
    def open_window(title: str) -> Iterator[TitleRecorder]:
        yield recorder

    monkeypatch.setattr(window_module, "open_window", open_window)
    tasks = {f"{seed:03d}-actual": (ACTUAL, seed, None, None) for seed in (3, 4)}
    args = Args("3-4", tmp_path, jobs=2, view=True)
    for _ in range(2):
        assert run_watched(EXPERIMENT, tasks, args, "key")["004-actual"] == {"seed": 4}
    assert recorder.titles == ["Stub: robot 3, actual", "Stub: robot 4, actual"] * 2


def test_view_is_refused_with_a_reason_where_it_is_not_supported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ExperimentError, match=r"^A run on a cluster cannot be watched.*\.$"):
        run_watched(EXPERIMENT, {}, Args("3", tmp_path, cluster="auto", view=True), "key")
    assert main(["initial-training", "--view", "--out", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert message.startswith("initial-training cannot be watched: leave out --view.")
    assert message.count("\n") == 1
    assert set(WATCHABLE) <= set(RUNNERS)


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


def new_session(maps: Path) -> tuple[Session, np.ndarray]:
    """Session of an actual robot at its first posture, and the postures that follow."""
    first, *others = shuffled_postures(3)[:4]
    return make_session(ACTUAL, 3, make_agent(3, cache=maps), first), np.array(others)


def moved_session(maps: Path, seconds: float) -> Session:
    session, postures = new_session(maps)
    session.move(postures[0], 1.0, 2.0)
    session.move(postures[1], seconds)
    session.env.close()
    return session


def read_all(address: str) -> str:
    """Read a stream until its end."""
    with urllib.request.urlopen(address, timeout=20) as stream:
        return str(stream.read().decode())


@pytest.mark.slow
def test_a_watched_session_has_the_bits_of_an_unwatched_one(maps: Path) -> None:
    unwatched = moved_session(maps, 1.0)
    with ThreadPoolExecutor() as pool, closing(Window("title")) as window:
        read = pool.submit(read_all, f"{window.address}events")
        wait_for(lambda: window._broadcast.watchers)
        with shown_by(window.show):
            watched = moved_session(maps, 1.0)
    assert read.result().count("data:image/jpeg") > 0
    for name in (
        "time",
        "tensions",
        "target",
        "true",
        "estimate",
        "observation_time",
        "observation_error",
    ):
        np.testing.assert_array_equal(getattr(watched.log, name), getattr(unwatched.log, name))
    for name, value in unwatched.observation.items():
        np.testing.assert_array_equal(watched.observation[name], value)


@pytest.mark.slow
@pytest.mark.skipif(not (CHROME and CHROMEDRIVER), reason="needs Chromium and its chromedriver")
def test_a_browser_shows_a_robot_that_moves(maps: Path, tmp_path: Path) -> None:
    title = "Robot <b>3</b> & co."
    with closing(Window(title)) as window, closing(Browser(tmp_path)) as browser:
        browser.open(window.address)
        wait_for(lambda: window._broadcast.watchers)
        with shown_by(window.show):
            session, postures = new_session(maps)
        others = cycle(postures)
        session.move(next(others), 2.0)
        first = browser.screenshot()
        part = "return document.getElementById('%s').%s"
        assert browser.run(part % ("title", "textContent")) == title
        assert browser.run(part % ("stage", "textContent")) == "learns"
        assert browser.run(part % ("time", "textContent")).startswith("simulated time ")
        areas = {}
        for name, width in (("scene", 800), ("panel", 460)):
            assert browser.run(part % (name, "naturalWidth")) == width
            box = browser.run(part % (name, "getBoundingClientRect().toJSON()"))
            areas[name] = (
                slice(int(box["top"]), int(box["bottom"])),
                slice(int(box["left"]), int(box["right"])),
            )

        def moves_and_changes(area: tuple[slice, slice]) -> bool:
            session.move(next(others), 2.0)  # pictures are drawn at steps only
            difference = np.abs(first[area].astype(int) - browser.screenshot()[area])
            return bool((difference > 40).mean() > 0.002)

        for name, area in areas.items():
            assert first[area].std() > 20, f"the {name} is of one colour"
            wait_for(lambda area=area: moves_and_changes(area), 30.0)  # type: ignore[misc]
        assert first[areas["scene"]].mean() > 60  # not black
        window._server.close()
        wait_for(lambda: "has ended" in browser.run(part % ("stage", "textContent")))
    session.env.close()
