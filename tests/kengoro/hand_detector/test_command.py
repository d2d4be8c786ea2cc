"""Tests of `kengoro hand-detector`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_detector import TrainedHandDetector
from kengoro.__main__ import main
from kengoro.commands.hand_detector import progress_of
from kengoro.hand_detector import examples

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
        ([str(STRANGER), *OWN, "--points", "3"], "points is 3, but it must be at least 4"),
    ],
)
def test_what_cannot_be_trained_on_is_named_and_nothing_is_left(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "hand.zip"
    assert main(["hand-detector", "train", *arguments, "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_camera_that_does_not_see_the_hand_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    away = tmp_path / "away.xml"
    away.write_text(STRANGER.read_text().replace('pos="0.25 0 0.9"', 'pos="5 0 0.9"'))
    out = tmp_path / "hand.zip"
    assert main(["hand-detector", "train", str(away), *OWN, "--out", str(out), "--frames", "8",
                 "--jobs", "1"]) == 2  # fmt: skip
    assert "shows the body 'gripper' in 0 of 8 frames only" in capsys.readouterr().err
    assert not out.exists()


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
