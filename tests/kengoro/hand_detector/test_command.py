"""Tests of `kengoro hand-detector`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_detector import TrainedHandDetector
from jmm_agent.vision.hand_model_file import read_hand_model
from kengoro.__main__ import main
from kengoro.errors import UsageError
from kengoro.hand_detector import examples
from kengoro.hand_detector.calibration import calibrate
from kengoro.hand_detector.examples import Source, chunk_path, make_chunk
from kengoro.hand_detector.train import NETWORKS, Effort, claim, make_examples, train_detector
from kengoro.hand_weights import KENGORO
from kengoro.stage_progress import progress_of
from kengoro_env.assets import assets_root

STRANGER = Path(__file__).with_name("two_links.xml")
OWN = ["--body", "gripper", "--camera", "above", "--hide", "tag"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere.xml"], "There is no model nowhere.xml"),
        (
            [str(STRANGER), "--body", "paw", "--camera", "above"],
            "no body 'paw'; it has: finger",
        ),
        ([str(STRANGER), "--body", "gripper"], "has no camera 'eye'; it has: above"),
        ([str(STRANGER), *OWN, "--size", "100"], "size is 100 px, but it must be a multiple of"),
        ([str(STRANGER), *OWN, "--jobs", "0"], "jobs is 0, but it must be at least 1"),
        ([str(STRANGER), *OWN, "--size", "2048"], "size is 2048 px, but it must be a multiple of"),
        ([str(STRANGER), *OWN, "--frames", "1"], "frames is 1, but it must be at least 8"),
        ([str(STRANGER), *OWN, "--points", "3"], "points is 3, but it must be at least 4"),
        ([str(STRANGER), *OWN, "--points", "100000"], "points is 100000, but it must be at most 2"),
        ([str(STRANGER), *OWN, "--frames", "9999999"], "frames is 9999999, but it must be at most"),
        ([str(STRANGER), *OWN, "--samples", "1" + "0" * 20], "000, but it must be at most 10000"),
        ([str(STRANGER), *OWN, "--jobs", "100000"], "jobs is 100000, but it must be at most 1024"),
        ([str(STRANGER), *OWN, "--batch", "1000000"], "batch is 1000000, but it must be at most 4"),
        ([str(STRANGER), *OWN, "--seed", "1" + "0" * 30], "000, but it must be at most 4294967295"),
    ],
)
def test_what_cannot_be_trained_on_is_named_and_nothing_is_left(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "hand.zip"
    assert main(["hand-detector", "train", *arguments, "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('size="0.04 0.03 0.01"', 'group="4" size="0.04 0.03 0.01"', "Nothing of the body 'grip"),
        ('fovy="60"', 'fovy="1" projection="orthographic"', "'above' is orthographic"),
        ('fovy="60"', 'focal="6 6" sensorsize="6 4" resolution="600 400"', "that is not 4 : 3"),
        ('<joint name="wrist" axis="0 0 1"/>', '<camera name="own"/>', "No joint moves the body"),
    ],
)
def test_a_hand_that_no_examples_can_be_made_of_is_named(
    before: str, after: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = STRANGER.read_text()
    assert before in text
    text = text.replace(before, after).replace(
        '<geom name="finger" type', '<geom name="finger" group="4" type'
    )
    model = tmp_path / "model.xml"
    model.write_text(text)
    camera = "own" if "own" in after else "above"
    assert main(["hand-detector", "train", str(model), "--body", "gripper", "--camera", camera,
                 "--hide", "tag", "--out", str(tmp_path / "hand.zip")]) == 2  # fmt: skip
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [model]


def test_paths_that_cannot_be_written_to_are_named_before_anything_is_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("")
    command = ["hand-detector", "train", str(STRANGER), *OWN]
    for out, message in (
        (tmp_path, "is a folder; name a file, such as"),
        (file / "hand.zip", "file is no folder"),
        (Path("/proc/none/hand.zip"), "The folder /proc/none cannot be made"),
    ):
        assert main([*command, "--out", str(out)]) == 2
        assert message in capsys.readouterr().err
    assert main([*command, "--out", str(tmp_path / "hand.zip"), "--folder", str(file)]) == 2
    assert "file is no folder" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [file]


def test_a_folder_is_for_one_state_of_the_model(tmp_path: Path) -> None:
    model = tmp_path / "model.xml"
    model.write_text(STRANGER.read_text())
    source = examples.Source(model, "gripper", "above", ("tag",))
    claim(tmp_path, source, Effort())
    claim(tmp_path, source, Effort(jobs=1))
    model.write_text(STRANGER.read_text().replace('size="0.04 0.03 0.01"', 'size="0.05 0.03 0.01"'))
    with pytest.raises(UsageError, match="other options or another state of model"):
        claim(tmp_path, source, Effort())
    run = tmp_path / "run.json"
    older = {
        name: value for name, value in json.loads(run.read_text()).items() if name != "content"
    }
    run.write_text(json.dumps(older))
    claim(tmp_path, source, Effort())
    run.write_text("{")
    with pytest.raises(UsageError, match="is damaged; remove"):
        claim(tmp_path, source, Effort())


def test_a_file_is_there_only_when_it_is_calibrated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def train(kind: str, samples: int, source: object, folder: Path, *_: object) -> list[object]:
        (folder / f"{kind}.onnx").write_bytes(b"network")
        return [[64.0, 1.0, 1.1], [128.0, 0.8, 0.9]]

    def stopped(source: object, path: Path, *rest: object) -> None:
        assert path.exists()
        raise KeyboardInterrupt

    monkeypatch.setattr("kengoro.hand_detector.train.make_examples", lambda *_: None)
    monkeypatch.setattr("kengoro.hand_detector.train._train_network", train)
    monkeypatch.setattr("kengoro.hand_detector.train.calibrate", stopped)
    source, out = examples.Source(STRANGER, "gripper", "above"), tmp_path / "hand.zip"
    out.write_bytes(b"earlier one")
    with pytest.raises(KeyboardInterrupt):
        train_detector(source, out, tmp_path / "training", Effort(), "", lambda *_: None)
    assert out.read_bytes() == b"earlier one"


def test_a_training_that_finds_too_few_hands_writes_no_file_and_keeps_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    networks = dict(zip(NETWORKS, read_hand_model(assets_root() / KENGORO)[1:], strict=True))

    def train(kind: str, samples: int, source: object, folder: Path, *_: object) -> list[object]:
        (folder / f"{kind}.onnx").write_bytes(networks[kind])
        return [[64.0, 1.0, 1.1], [128.0, 0.8, 0.9]]

    monkeypatch.setattr("kengoro.hand_detector.train.make_examples", lambda *_: None)
    monkeypatch.setattr("kengoro.hand_detector.train._train_network", train)
    monkeypatch.setattr(
        "kengoro.hand_detector.train.calibrate",
        lambda source, path, count, progress: calibrate(source, path, 6, progress),
    )
    out = tmp_path / "hand.zip"
    assert main(["hand-detector", "train", str(STRANGER), *OWN, "--out", str(out)]) == 2
    message = capsys.readouterr().err
    assert "calibration needs 30 of them, so no file is written: train with more" in message
    assert "nan" not in message
    assert not out.exists()
    assert (tmp_path / "hand.zip.training" / "run.json").exists()


@pytest.mark.parametrize("start", [[], ["--start", "none"], ["--start", "kengoro"]])
def test_a_camera_that_does_not_see_the_hand_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], start: list[str]
) -> None:
    away = tmp_path / "away.xml"
    away.write_text(STRANGER.read_text().replace('pos="0.25 0 0.9"', 'pos="5 0 0.9"'))
    out = tmp_path / "hand.zip"
    assert main(["hand-detector", "train", str(away), *OWN, "--out", str(out), "--frames", "8",
                 "--jobs", "1", *start]) == 2  # fmt: skip
    assert "shows the body 'gripper' in 0 of 8 frames only" in capsys.readouterr().err
    assert not out.exists()


def test_a_training_shows_the_points_network_what_the_finder_of_its_start_offers(
    tmp_path: Path,
) -> None:
    source = Source(STRANGER, "gripper", "above", ("tag",))
    start, folder = assets_root() / KENGORO, tmp_path / "run"
    folder.mkdir()
    make_examples(source, folder, Effort(frames=6, jobs=1, start=start), lambda *_: None)
    for name, finder in (("with", start), ("without", None)):
        make_chunk(source, 0, tmp_path / name, 6, finder)
    made, mined, plain = (
        np.load(chunk_path(at, 0))["crops"]
        for at in (folder, tmp_path / "with", tmp_path / "without")
    )
    assert np.array_equal(made, mined)
    assert not np.array_equal(made, plain)


def test_without_a_terminal_each_tenth_of_a_stage_is_a_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with progress_of(("examples", "points")) as progress:
        for number in range(101):
            progress("examples", number / 100, f"{number} files")
        progress("points", 0.0, "")
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["examples: 0% 0 files", "examples: 10% 10 files"]
    assert lines[-2:] == ["examples: 100% 100 files", "points: 0%"]
    assert len(lines) == 12


def test_without_a_terminal_each_text_of_a_stage_that_stands_still_is_a_line_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As of robots that learn and then grasp: each step of theirs calls with the same text."""
    with progress_of(("grasps",)) as progress:
        for robot in (3, 4):
            for text in ("moves its hand in view", "approach 1", "moves its hand in view"):
                for _ in range(50):
                    progress("grasps", (robot - 3) * 0.06, f"robot {robot} {text}")
            progress("grasps", (robot - 2) * 0.06, f"robot {robot} grasps")
    assert capsys.readouterr().out.splitlines() == [
        "grasps: 0% robot 3 moves its hand in view",
        "grasps: 0% robot 3 approach 1",
        "grasps: 6% robot 4 moves its hand in view",
        "grasps: 6% robot 4 approach 1",
        "grasps: 12% robot 4 grasps",
    ]


def test_a_start_that_is_not_there_is_named_before_anything_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "hand.zip"
    assert main(["hand-detector", "train", str(STRANGER), *OWN, "--out", str(out), "--start",
                 str(tmp_path / "gone.zip")]) == 2  # fmt: skip
    assert "gone.zip" in capsys.readouterr().err
    assert not list((tmp_path / "hand.zip.training").glob("*"))


@pytest.mark.slow
def test_a_small_training_makes_a_file_that_finds_a_hand_and_knows_how_well(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stranger's arm: hundreds of frames and minutes find it within centimetres."""
    out = tmp_path / "hand.zip"
    command = ["hand-detector", "train", str(STRANGER), *OWN, "--out", str(out), "--frames", "1000",
               "--samples", "20000", "--size", "64"]  # fmt: skip
    assert main(command) == 0
    assert "of the visible hands are found" in capsys.readouterr().out
    source = examples.Source(STRANGER, "gripper", "above", ("tag",), size=64)
    maker = source.maker()
    detector = TrainedHandDetector(Camera.from_fovy(maker.width, maker.height, maker.fovy), out)
    assert "--body gripper" in detector.model.made_by
    errors = []
    for number in range(60):
        frame = maker.make(np.random.default_rng([99, number]))
        found = detector.detect(frame.image)
        if frame.visible > 0.7 and hasattr(found, "covariance"):
            errors.append(np.linalg.norm(found.pose_hand_in_camera[:3, 3] - frame.pose[:3, 3]))
    assert len(errors) > 15
    assert np.median(errors) < 0.06
    # The same command again has nothing left to do, and other options are refused.
    before = out.read_bytes()
    assert main(command) == 0
    assert out.read_bytes() == before
    assert main([*command, "--seed", "1"]) == 2
    assert "is the folder of a training with other options" in capsys.readouterr().err
    assert json.loads((tmp_path / "hand.zip.training" / "run.json").read_text())["seed"] == 0
