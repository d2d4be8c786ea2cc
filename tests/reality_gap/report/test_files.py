"""What a diagnosis leaves on disk: all files, whole or not at all, and nobody else's touched."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.diagnosis import Diagnosis, Verdict
from reality_gap.errors import StudyError
from reality_gap.report.files import check_out, write_diagnosis
from reality_gap.report.verdict_json import verdict_json
from reality_gap.study.data import Study

Make = Callable[[Verdict], Diagnosis]
FILES = {"verdict.json", "extended.xml", "extended.json", "report.html", "next_experiment.csv"}


@pytest.fixture
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """A report without pictures, which take a second and have their own tests."""

    def write(diagnosis: Diagnosis, study: Study, path: Path) -> None:
        path.write_text(diagnosis.sentence)

    monkeypatch.setattr("reality_gap.report.files.write_report", write)


def test_the_report_is_a_page(diagnosed: Make, lever_study: Study, tmp_path: Path) -> None:
    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, tmp_path / "out")

    assert (tmp_path / "out" / "report.html").read_text().startswith("<!DOCTYPE html>")


@pytest.mark.usefixtures("plain_page")
@pytest.mark.parametrize("verdict", Verdict)
def test_every_verdict_is_written_whole(
    verdict: Verdict, diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    out = tmp_path / "new" / "out"

    write_diagnosis(diagnosed(verdict), lever_study, out)

    assert {path.name for path in out.iterdir()} == FILES
    assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert json.loads((out / "verdict.json").read_text())["verdict"] == verdict.value
    assert mujoco.MjModel.from_xml_path(str(out / "extended.xml")).nu == 2


def test_the_verdict_has_the_keys_of_the_interface(diagnosed: Make) -> None:
    found = verdict_json(diagnosed(Verdict.NAMED))

    assert {
        "verdict",
        "causes",
        "rms_before",
        "rms_after",
        "noise_floor",
        "gain",
        "unexplained_fraction",
        "depends_on",
        "next_experiment",
    } <= set(found)
    first, second = found["causes"]
    assert first["cause"] == "coulomb_friction"
    assert first["elements"] == ["flexor"]
    assert first["parameters"]["friction"] == {
        "value": 3.0,
        "low": 2.5,
        "high": 3.5,
        "unit": "N",
    }
    assert second["equivalent"] == ["length_scale"]
    assert found["gain"] == {"value": 0.955, "low": 0.93, "high": 0.97}


def test_without_gain_and_experiment_both_are_null(diagnosed: Make) -> None:
    found = verdict_json(replace(diagnosed(Verdict.NOTHING_WRONG), next_experiment=None))

    assert found["gain"] is None
    assert found["next_experiment"] is None
    assert found["causes"] == []


def test_only_a_rival_may_have_no_finite_score(diagnosed: Make) -> None:
    diagnosis = diagnosed(Verdict.NAMED)

    assert [
        fitted_candidate["score"] for fitted_candidate in verdict_json(diagnosis)["candidates"]
    ][-1] is None
    with pytest.raises(ValueError, match="rms_after is nan"):
        verdict_json(replace(diagnosis, rms_after=float("nan")))


@pytest.mark.usefixtures("plain_page")
def test_the_next_experiment_has_time_and_the_actuators(
    diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    diagnosis = diagnosed(Verdict.NAMED)

    write_diagnosis(diagnosis, lever_study, tmp_path / "out")

    with (tmp_path / "out" / "next_experiment.csv").open() as file:
        head, *rows = csv.reader(file)
    experiment = diagnosis.next_experiment
    assert experiment is not None
    assert head == ["time", "flexor", "extensor"]
    table = np.array(rows, dtype=float)
    np.testing.assert_allclose(table[:, 0], experiment.time)
    np.testing.assert_allclose(table[:, 1:], experiment.command)


@pytest.mark.usefixtures("plain_page")
def test_an_earlier_diagnosis_is_replaced(
    diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, out)

    last = replace(diagnosed(Verdict.NOTHING_WRONG), next_experiment=None)
    write_diagnosis(last, lever_study, out)

    assert {path.name for path in out.iterdir()} == FILES - {"next_experiment.csv"}
    assert json.loads((out / "verdict.json").read_text())["verdict"] == "nothing_wrong"


@pytest.mark.usefixtures("plain_page")
def test_a_failure_leaves_what_was_there(
    diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    out, work = tmp_path / "results" / "out", tmp_path / "results"
    broken = replace(diagnosed(Verdict.NAMED), extended_xml="<mujoco><nonsense/></mujoco>")

    with pytest.raises(StudyError, match="does not load"):
        write_diagnosis(broken, lever_study, out)
    assert list(work.iterdir()) == []

    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, out)
    before = (out / "verdict.json").read_bytes()
    with pytest.raises(StudyError, match="does not load"):
        write_diagnosis(broken, lever_study, out)
    assert (out / "verdict.json").read_bytes() == before
    assert [path.name for path in work.iterdir()] == ["out"]


@pytest.mark.usefixtures("plain_page")
def test_a_folder_with_anything_else_is_left_alone(
    diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, out)
    (out / "thesis.tex").write_text("ten years of work")

    with pytest.raises(StudyError, match=r"holds thesis\.tex.*give a new folder"):
        write_diagnosis(diagnosed(Verdict.NAMED), lever_study, out)

    assert (out / "thesis.tex").read_text() == "ten years of work"


def test_files_with_the_right_names_alone_make_no_diagnosis(tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("mine")

    with pytest.raises(StudyError, match="not an earlier diagnosis"):
        check_out(tmp_path)


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")

    with pytest.raises(StudyError, match="is a file"):
        check_out(tmp_path / "out")


def test_an_empty_folder_and_none_are_free(tmp_path: Path) -> None:
    check_out(tmp_path)
    check_out(tmp_path / "none")


@pytest.mark.usefixtures("plain_page")
def test_the_earlier_diagnosis_comes_back_if_the_new_one_cannot_move_in(
    diagnosed: Make, lever_study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, out)
    before = (out / "verdict.json").read_bytes()
    rename = Path.rename

    def fail_for_the_new(path: Path, target: Path) -> Path:
        if path.name == "new":
            raise OSError("the disk is gone")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", fail_for_the_new)
    with pytest.raises(OSError, match="the disk is gone"):
        write_diagnosis(diagnosed(Verdict.NOTHING_WRONG), lever_study, out)

    assert (out / "verdict.json").read_bytes() == before
