"""Watching a run shows what happens and changes nothing."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, nullcontext
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
from experiments.harness.experiment import Study, run_watched
from kengoro.arm import ACTUAL, make_session, new_agent, shuffled_postures
from kengoro.session import Session, observed_by
from kengoro.viewer import window as window_module
from kengoro.viewer.scene import Scene
from kengoro.viewer.window import Viewer, Window
from kengoro_env.assets import asset_path
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot
from kengoro_env.vision.rendering import RenderingError
from tests.kengoro.viewer.small_window import CHROME, CHROMEDRIVER, Browser, read_event, wait_for

POSTURE = posture_set()[0]


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


class Spectator:
    """A window that notes its titles."""

    def __init__(self) -> None:
        self.title, self.titles = "", list[str]()

    def look(self, session: object) -> None:
        self.titles.append(self.title)


def stepped(condition: str, seed: int, sizes: object, cache: object) -> dict[str, Any]:
    """A run with a session of one step."""
    from kengoro import session

    onlooker = session._onlooker.get()
    assert onlooker is not None
    onlooker(SimpleNamespace())  # type: ignore[arg-type]
    return {"seed": seed}


STUDY = Study("sham", "Sham", "", "", (ACTUAL,), None, None, stepped, lambda *_: None)  # type: ignore[arg-type, return-value]


def test_a_watched_study_runs_again_and_names_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    onlooker = Spectator()

    @contextmanager
    def open_window(title: str) -> Iterator[Spectator]:
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
        with observed_by(window.look):
            watched = moved(maps, 1.0)
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
        np.testing.assert_array_equal(getattr(watched.log, name), getattr(alone.log, name))
    for name, value in alone.observation.items():
        np.testing.assert_array_equal(watched.observation[name], value)


@pytest.mark.slow
@pytest.mark.skipif(not (CHROME and CHROMEDRIVER), reason="needs Chromium and its chromedriver")
def test_a_browser_shows_a_robot_that_moves(maps: Path, tmp_path: Path) -> None:
    title = "Robot <b>3</b> & co."
    with closing(Window(title)) as window, closing(Browser(tmp_path)) as browser:
        browser.open(window.address)
        wait_for(lambda: window._broadcast.watchers)
        with observed_by(window.look):
            session, postures = new_session(maps)
        others = cycle(postures)
        session.move(next(others), 2.0)
        first = browser.screenshot()
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

        def moves_and_changes(place: tuple[slice, slice]) -> bool:
            session.move(next(others), 2.0)  # nothing is drawn while nothing happens
            difference = np.abs(first[place].astype(int) - browser.screenshot()[place])
            return bool((difference > 40).mean() > 0.002)

        for name, place in places.items():
            assert first[place].std() > 20, f"the {name} is of one colour"
            wait_for(lambda place=place: moves_and_changes(place), 30.0)  # type: ignore[misc]
        assert first[places["scene"]].mean() > 60  # not black
        window._server.close()
        wait_for(lambda: "has ended" in browser.run(part % ("doing", "textContent")))
    session.env.close()
