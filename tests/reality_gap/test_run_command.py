"""The command run: what it reads, what it writes, and what it uses again."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from reality_gap.__main__ import main
from reality_gap.check import check_study
from reality_gap.errors import StudyError
from reality_gap.io.loader import load_study
from reality_gap.run_command import Run, study_of
from tests.reality_gap.arm_logs import HEADER, motion, table, write_arm
from tests.reality_gap.io.recordings import ROS2, Messages, record


@pytest.fixture
def model(tmp_path: Path) -> Path:
    return write_arm(tmp_path)


@pytest.mark.slow
def test_run_writes_study_and_result(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time, command, angles = motion()
    log = table(tmp_path / "log.csv", HEADER, time, *command.T, -angles[:, 0], angles[:, 1])
    out = tmp_path / "out"
    assert main(["run", str(model), str(log), "--out", str(out), "--jobs", "1"]) == 0
    assert "opposite sign" in capsys.readouterr().out
    assert (out / "result" / "report.html").is_file()
    verdict = json.loads((out / "result" / "verdict.json").read_text())
    assert verdict["notes"] == list(check_study(load_study(out / "study" / "STUDY.yaml")))
    assert (out / "study" / "STUDY.yaml").is_file()
    assert main(["run", str(model), str(log), "--out", str(out), "--jobs", "1"]) == 0
    assert "exists and is used" in capsys.readouterr().out


def test_a_wrong_option_is_refused_before_anything_is_written(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["run", str(model), "log.csv", "--out", str(out), "--tolerance", "0"]) == 2
    assert "--tolerance must be above 0" in capsys.readouterr().err
    assert not out.exists()


def test_a_bag_is_unpacked_again_each_time(model: Path, tmp_path: Path) -> None:
    """Nothing that an interrupted command unpacked is used."""
    time, command, angles = motion()
    messages = Messages(ROS2)
    names = ["shoulder_pan", "elbow_flex"]
    recorded = [
        (topic, t, messages.joints(t, names, list(row)))
        for topic, rows in (("/command", command), ("/state", angles))
        for t, row in zip(time, rows, strict=True)
    ]
    bag = record(tmp_path / "bag", messages, sorted(recorded, key=lambda one: one[1]))
    out = tmp_path / "out"
    (out / "unpacked_1").mkdir(parents=True)
    (out / "unpacked_1" / "state.csv").write_text("time,q\n")
    study = load_study(study_of(Run(model, (bag,), out, 1), print))
    np.testing.assert_allclose(study.episodes[0].readings[1].value, angles[:, 1], atol=1e-9)
    np.testing.assert_allclose(study.episodes[0].command, command, atol=1e-9)
    assert {path.name for path in out.iterdir()} == {"study", "unpacked_1"}


def test_a_draft_that_was_edited_is_corrected(model: Path, tmp_path: Path) -> None:
    """The columns are checked when the study can be loaded, and only once."""
    time, command, angles = motion()
    header = "time,cmd_shoulder_pan,spare,q_shoulder_pan,q_elbow_flex"
    log = table(tmp_path / "log.csv", header, time, *command.T, -angles[:, 0], angles[:, 1])
    run = Run(model, (log,), tmp_path / "out", 1)
    with pytest.raises(StudyError, match="run the same command again"):
        study_of(run, print)
    path = tmp_path / "out" / "study" / "STUDY.yaml"
    draft = path.read_text()
    [line] = [x for x in draft.splitlines() if x.strip().startswith("# elbow_flex: {column: ?")]
    path.write_text(draft.replace(line, "  elbow_flex: {column: spare, unit: rad}"))
    notes: list[str] = []
    study = load_study(study_of(run, notes.append))
    np.testing.assert_allclose(study.episodes[0].readings[0].value, angles[:, 0], atol=1e-6)
    assert any("the model and the logs of this command are not read" in note for note in notes)
    edited = path.read_text().replace("scale: -1.0", "scale: 1.0")
    path.write_text(edited)
    study_of(run, print)
    assert path.read_text() == edited
