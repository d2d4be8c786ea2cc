"""Data sets of demonstrations: files, episodes of a robot, bad input."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
import pyarrow.parquet as parquet
import pytest

from kengoro.__main__ import main
from kengoro.commands import dataset as command
from kengoro.commands.dataset import Args, plan_of
from kengoro.demonstrations import dataset
from kengoro.demonstrations.dataset import Plan, claim, make_datasets, robot_path
from kengoro.demonstrations.episode import Recorder
from kengoro.demonstrations.frames import open_frames
from kengoro.demonstrations.lerobot import VIDEO, video_path
from kengoro.demonstrations.minari import NAME
from kengoro.demonstrations.robot import episode_seed
from kengoro.demonstrations.robot_file import (
    RobotEpisodes,
    described_departures,
    read_robot,
    write_robot,
)
from kengoro.errors import UsageError
from kengoro.hand_search import TrialOptions
from kengoro.robots import make_env
from kengoro_env.departures import actual
from mjcf_sandbox.errors import OutputError
from reality_gap.io.lerobot import unpack_dataset
from tests.kengoro.demonstrations.small_dataset import (
    FRAMES,
    STEPS,
    frame_of,
    made_episode,
    made_robot,
    write_both,
)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("data")
    write_both(out)
    return out


def test_the_rows_of_lerobot_are_those_of_the_frames(written: Path) -> None:
    info = json.loads((written / "lerobot/meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"]) == ("v3.0", 5)
    assert (info["total_episodes"], info["total_frames"]) == (4, sum(FRAMES))
    (episodes,) = (written / "lerobot/meta/episodes").rglob("*.parquet")
    rows = parquet.read_table(episodes).to_pylist()
    assert [row["length"] for row in rows] == list(FRAMES)
    assert [row["dataset_from_index"] for row in rows] == [0, 3, 5, 9]
    assert [row["robot"] for row in rows] == [5, 5, 6, 6]
    assert [row["success"] for row in rows] == [True, False, True, False]
    # The second robot has a video of its own, which begins at 0 s.
    starts = [row[f"videos/{VIDEO}/from_timestamp"] for row in rows]
    np.testing.assert_allclose(starts, [0.0, 0.6, 0.0, 0.8])
    assert [row[f"videos/{VIDEO}/file_index"] for row in rows] == [0, 0, 1, 1]
    data = [parquet.read_table(p) for p in sorted((written / "lerobot/data").rglob("*.parquet"))]
    assert [table.num_rows for table in data] == [5, 5]
    for table in data:
        assert set(table.column_names) == set(info["features"]) - {VIDEO}
        assert table.schema.field("action").type.list_size == 37


def test_a_row_of_lerobot_has_the_readings_of_its_frame_and_the_command_at_its_end(
    written: Path,
) -> None:
    tables = [parquet.read_table(p) for p in sorted((written / "lerobot/data").rglob("*.parquet"))]
    rows = [row for table in tables for row in table.to_pylist()]
    number, starts, ends = 2, [0, 10, 20, 30], [9, 19, 29, 30]  # of 31 steps, of which 10 are a row
    own = [row for row in rows if row["episode_index"] == number]
    episode = made_episode(number)
    np.testing.assert_array_equal([row["action"] for row in own], episode.actions[ends])
    read = np.hstack([episode.lengths, episode.tensions])[starts].astype(np.float32)
    np.testing.assert_array_equal([row["observation.state"] for row in own], read)
    mean = [np.mean(episode.rewards[a : b + 1]) for a, b in zip(starts, ends, strict=True)]
    np.testing.assert_allclose([row["next.reward"] for row in own], mean, rtol=1e-6)


def test_the_video_holds_the_frames_in_order(written: Path) -> None:
    for position in range(2):
        numbers = (2 * position, 2 * position + 1)
        wanted = [frame_of(i, row).mean() for i in numbers for row in range(FRAMES[i])]
        with imageio.get_reader(video_path(written / "lerobot", position)) as video:
            assert video.get_meta_data()["fps"] == 5
            found = [frame.mean() for frame in video]
        np.testing.assert_allclose(found, wanted, atol=2.0)


def test_reality_gap_reads_the_lerobot_data_set(written: Path, tmp_path: Path) -> None:
    logs = unpack_dataset(written / "lerobot", tmp_path / "logs", note=lambda text: None)
    assert len(logs) == 4


def test_each_control_step_is_a_row_of_minari(written: Path) -> None:
    folder = written / "minari" / NAME / "data"
    metadata = json.loads((folder / "metadata.json").read_text())
    assert (metadata["total_episodes"], metadata["total_steps"]) == (4, sum(STEPS))
    assert metadata["dataset_id"] == NAME
    for number, steps in enumerate(STEPS):
        table = parquet.read_table(folder / str(number) / "part-0.parquet")
        episode = made_episode(number)
        assert table.num_rows == steps + 1
        rows = table.to_pylist()
        np.testing.assert_array_equal([r["actions"] for r in rows[:-1]], episode.actions)
        np.testing.assert_array_equal([r["rewards"] for r in rows[:-1]], episode.rewards)
        lengths = [row["observations"]["lengths"] for row in rows]
        np.testing.assert_array_equal(lengths, episode.lengths)
        assert [row["truncations"] for row in rows[:-1]] == [False] * (steps - 1) + [True]
        own = json.loads((folder / str(number) / "metadata.json").read_text())
        assert own["seed"] == episode_seed(5 + number // 2, number % 2)
        assert own["success"] == (number % 2 == 0)


def test_metadata_name_all_departures_of_each_robot(written: Path) -> None:
    minari = json.loads((written / "minari" / NAME / "data/metadata.json").read_text())
    lerobot = json.loads((written / "lerobot/meta/robots.json").read_text())
    assert minari["robots"] == lerobot == {str(s): described_departures(s) for s in (5, 6)}
    found = lerobot["5"]
    assert [one["departure"] for one in found] == [type(one).__name__ for one in actual(5)]
    assert found[0]["sigma"] == 0.004


def test_the_same_frames_and_episodes_give_the_same_bits(written: Path, tmp_path: Path) -> None:
    write_both(tmp_path)
    paths = [path.relative_to(written) for path in written.rglob("*") if path.is_file()]
    assert len(paths) > 15
    for path in paths:
        assert (tmp_path / path).read_bytes() == (written / path).read_bytes(), path


def test_a_robots_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    found = made_robot(tmp_path, 1)
    write_robot(tmp_path / "6.npz", found)
    again = read_robot(tmp_path / "6.npz", 6, 2)
    assert again.robot == 6
    for one, other in zip(found.episodes, again.episodes, strict=True):
        for name, values in one.arrays().items():
            np.testing.assert_array_equal(other.arrays()[name], values)


def _flip(path: Path, number: int) -> None:
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(number)
    for index in rng.integers(len(content), size=40):
        content[index] ^= 0xFF
    path.write_bytes(content)


def _cut(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def _plain(path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.arange(5))


def _shorter(path: Path) -> None:
    """One array of an episode loses a row."""
    with np.load(path) as stored:
        arrays = dict(stored)
    arrays["1/lengths"] = arrays["1/lengths"][:-1]
    with path.open("wb") as file:
        np.savez(file, **arrays)


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _some_episodes(path: Path, number: int) -> None:
    found = made_robot(path.parent / "other", 1)
    write_robot(path, RobotEpisodes(6, found.episodes[:number], found.histograms[:number]))


def _other_robot(path: Path) -> None:
    write_robot(path, made_robot(path.parent / "other", 0))


DAMAGE: list[tuple[str, Callable[[Path], object]]] = [
    ("is damaged", lambda path: path.write_bytes(b"")),
    ("is damaged", _cut),
    ("is damaged", _plain),
    ("is damaged", _shorter),
    ("is damaged", _folder),
    *(("is damaged", partial(_flip, number=number)) for number in range(8)),
    ("holds another number of episodes: 0, not 2", partial(_some_episodes, number=0)),
    ("holds another number of episodes: 1, not 2", partial(_some_episodes, number=1)),
    ("holds robot 5, not 6", _other_robot),
]


@pytest.mark.parametrize(("what", "damage"), DAMAGE)
def test_a_robots_file_with_damage_is_named_to_be_removed(
    what: str, damage: Callable[[Path], object], tmp_path: Path
) -> None:
    path = tmp_path / "6.npz"
    write_robot(path, made_robot(tmp_path, 1))
    damage(path)
    sentence = f"{path} {what}; remove it, and this robot runs again."
    with pytest.raises(UsageError, match=f"^{re.escape(sentence)}$"):
        read_robot(path, 6, 2)


def _short_video(path: Path) -> None:
    with open_frames(path) as video:
        video.add(frame_of(0, 0))


@pytest.mark.parametrize(
    ("file", "what", "damage"),
    [
        ("video", "is damaged", lambda path: path.write_bytes(b"")),
        ("video", "is damaged", _cut),
        ("video", "holds another number of frames: 1, not 5", _short_video),
        ("robot", "is damaged", lambda path: path.write_bytes(b"")),
        ("robot", "holds robot 5, not 6", _other_robot),
    ],
)
def test_damage_is_found_before_another_robot_learns(
    file: str,
    what: str,
    damage: Callable[[Path], object],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "out"
    plan = Plan((5, 6), 2)
    claim(out, plan)
    write_robot(robot_path(out, 6), made_robot(out / "lerobot", 1))
    path = video_path(out / "lerobot", 1) if file == "video" else robot_path(out, 6)
    damage(path)
    ran: list[int] = []

    def run_robot(plan: Plan, out: Path, position: int, *_: Any) -> None:
        ran.append(position)
        robot = made_robot(out / "lerobot", position)
        write_robot(robot_path(out, robot.robot), robot)

    monkeypatch.setattr(dataset, "run_robot", run_robot)
    sentence = f"{path} {what}; remove it, and this robot runs again."
    with pytest.raises(UsageError, match=f"^{re.escape(sentence)}$"):
        make_datasets(plan, out, lambda text, by: None)
    assert ran == []
    path.unlink()
    make_datasets(plan, out, lambda text, by: None)
    assert ran == [0, 1]


def test_a_recorder_keeps_observations_before_and_after_each_action() -> None:
    frames: list[Any] = []
    env = Recorder(make_env("CanGrasp", 3), frames.append)
    observation, info = env.reset(seed=1)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.02, 0.02, (21, 37)).astype(np.float32)
    lengths, poses = [observation["lengths"]], [info["can_pose"]]
    seen = []
    for number, action in enumerate(actions):
        if number % 10 == 0:
            seen.append(observation["frame"])
        observation, _, _, _, info = env.step(action)
        lengths.append(observation["lengths"])
        poses.append(info["can_pose"])
    env.close()
    np.testing.assert_array_equal(env.episode.lengths, lengths)
    np.testing.assert_array_equal(env.episode.can_pose, poses)
    np.testing.assert_array_equal(env.episode.actions, actions)
    assert not env.episode.lifted
    assert len(env.episode) == 21
    np.testing.assert_array_equal(frames, seen)


def test_a_stopped_command_goes_on_with_the_missing_robots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[int] = []

    def run_robot(plan: Plan, out: Path, position: int, *_: Any) -> None:
        ran.append(position)
        robot = made_robot(out / "lerobot", position)
        write_robot(robot_path(out, robot.robot), robot)
        if len(ran) == 1:
            (out / "robots" / ".006.1.part.npz").write_bytes(b"begun by a killed process")
            raise KeyboardInterrupt

    monkeypatch.setattr(dataset, "run_robot", run_robot)
    plan = Plan((5, 6), 2)
    with pytest.raises(KeyboardInterrupt):
        make_datasets(plan, tmp_path / "out", lambda text, by: None)
    assert not (tmp_path / "out/lerobot/meta/info.json").exists()
    advanced: list[float] = []
    found = make_datasets(plan, tmp_path / "out", lambda text, by: advanced.append(by))
    assert ran == [0, 1]
    assert [robot.robot for robot in found] == [5, 6]
    assert advanced == [2]  # for the robot that was there
    assert (tmp_path / "out/lerobot/meta/info.json").exists()
    assert not list(tmp_path.rglob("*.part.*"))


def test_a_folder_with_other_data_is_refused(tmp_path: Path) -> None:
    claim(tmp_path / "a", Plan((1, 2), 3))
    claim(tmp_path / "a", Plan((1, 2), 3))
    with pytest.raises(UsageError, match="holds other robots or episodes"):
        claim(tmp_path / "a", Plan((1, 2), 4))
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "letter.txt").write_text("dear reader")
    with pytest.raises(UsageError, match="holds no data set"):
        claim(tmp_path / "b", Plan((1, 2), 3))
    (tmp_path / "c" / "dataset.json").mkdir(parents=True)
    with pytest.raises(UsageError, match="is damaged; choose another folder"):
        claim(tmp_path / "c", Plan((1, 2), 3))


@pytest.mark.parametrize(
    "file", ["robots", "minari", "lerobot/meta", "lerobot/data", "lerobot/videos"]
)
def test_a_file_where_a_folder_belongs_is_named_before_a_robot_learns(
    file: str, tmp_path: Path
) -> None:
    claim(tmp_path / "a", Plan((1, 2), 3))
    path = tmp_path / "a" / file
    shutil.rmtree(path)
    path.write_text("no folder")
    with pytest.raises(OutputError, match=f"{re.escape(str(path))} is no folder"):
        claim(tmp_path / "a", Plan((1, 2), 3))


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs Linux")
def test_a_folder_that_cannot_be_made_is_one_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "trained_map", lambda: pytest.fail("it learns"))
    assert main(["dataset", "--out", "/proc/none"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("The folder /proc/none cannot be made: ")
    assert error.count("\n") == 1


def test_progress_is_lines_where_there_is_no_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def make(plan: Plan, out: Path, progress: dataset.Progress, jobs: int) -> list[RobotEpisodes]:
        progress("robot 5 moves its hand in view", 0)
        for robot in plan.robots:
            for _ in range(plan.episodes):
                progress(f"robot {robot} grasps", 1)
        return [made_robot(tmp_path / "videos", position) for position in (0, 1)]

    monkeypatch.setattr(command, "make_datasets", make)
    monkeypatch.setattr(command, "trained_map", lambda: None)
    options = ["--robots", "5-6", "--episodes", "4", "--out", str(tmp_path / "out")]
    assert main(["dataset", *options]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "grasps: 0% robot 5 moves its hand in view" in lines
    assert "grasps: 50% robot 5 grasps" in lines
    assert "grasps: 100% robot 6 grasps" in lines
    assert any(line.startswith("The can was lifted in 2 of 4 episodes") for line in lines)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--robots", "3-1"], "Robots are '3-1'; give one such as 3 or a range such as 0-9."),
        (["--robots", "-1"], "Robots are '-1'; give one such as 3 or a range such as 0-9."),
        (
            ["--robots", "0-2", "--episodes", "10"],
            "Episodes are 10, but must be a multiple of the 3 robots.",
        ),
        (["--episodes", "0"], "Episodes are 0, but at least 1 is needed."),
        (["--robots", "7", "--episodes", "-3"], "Episodes are -3, but at least 1 is needed."),
        (["--jobs", "0"], "Jobs are 0, but at least 1 is needed."),
    ],
)
def test_bad_input_is_one_sentence(
    options: list[str], sentence: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["dataset", "--out", str(tmp_path / "new"), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith(sentence)
    assert error.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_the_defaults_are_twenty_robots_with_ten_episodes_each() -> None:
    assert plan_of(Args()) == Plan(tuple(range(20)), 10)


@pytest.mark.slow
def test_a_robot_learns_once_and_grasps(tmp_path: Path) -> None:
    trial = TrialOptions(approaches=2, postures=3, move=1.0, patience=1.5)
    plan = Plan((3,), 2, trial)
    [found] = make_datasets(plan, tmp_path / "out", lambda text, by: None)
    check_robot(found, tmp_path / "out")


def check_robot(found: RobotEpisodes, out: Path) -> None:
    """Check a robot that lifts the can in both episodes, after learning from few postures."""
    assert [episode.lifted for episode in found.episodes] == [True, True]
    cans = [episode.can_pose[0, :2, 3] for episode in found.episodes]
    assert np.linalg.norm(cans[0] - cans[1]) > 1e-3
    for episode in found.episodes:
        assert episode.actions[0, -1] == -1.0  # open fingers
        assert episode.actions[-1, -1] == 1.0
        assert episode.rise[-1] > 0.03
        assert np.abs(np.diff(episode.actions[:, :-1], axis=0)).max() < 0.2
    rows = [-(-len(episode) // 10) for episode in found.episodes]
    with imageio.get_reader(video_path(out / "lerobot", 0)) as video:
        frames = list(iter(video))  # its length is not known
    assert len(frames) == sum(rows)
    first, last = frames[0].astype(int), frames[rows[0] - 1].astype(int)
    assert np.abs(first - last).mean() > 2.0  # the camera turned towards the can
    (data,) = (out / "lerobot" / "data").rglob("*.parquet")
    assert parquet.read_table(data).num_rows == sum(rows)
