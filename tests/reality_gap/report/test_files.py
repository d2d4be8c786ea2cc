"""Files of a diagnosis: all or none are written, and other files are not overwritten."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from reality_gap.causes.base import Location
from reality_gap.check import check_study
from reality_gap.diagnosis import Diagnosis, Verdict
from reality_gap.errors import StudyError
from reality_gap.io.loader import load_study
from reality_gap.report import verdict_json as verdict_module
from reality_gap.report.files import check_out, write_diagnosis
from reality_gap.report.verdict_json import verdict_json
from reality_gap.study.data import Study

Make = Callable[[Verdict], Diagnosis]
FILES = {"verdict.json", "extended.xml", "extended.json", "report.html", "next_experiment.csv"}


@pytest.fixture
def plain_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replaces the report, whose pictures take a second, by a short text."""

    def write(diagnosis: Diagnosis, study: Study, path: Path) -> None:
        path.write_text(diagnosis.sentence)

    monkeypatch.setattr("reality_gap.report.files.write_report", write)


@pytest.mark.usefixtures("no_figures")
def test_the_report_is_a_page(diagnosed: Make, lever_study: Study, tmp_path: Path) -> None:
    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, tmp_path / "out")

    assert (tmp_path / "out" / "report.html").read_text().startswith("<!DOCTYPE html>")


@pytest.mark.usefixtures("plain_page")
@pytest.mark.parametrize("verdict", Verdict)
def test_all_files_are_written_for_each_verdict(
    verdict: Verdict, diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    out = tmp_path / "new" / "out"

    write_diagnosis(diagnosed(verdict), lever_study, out)

    assert {path.name for path in out.iterdir()} == FILES
    assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert json.loads((out / "verdict.json").read_text())["verdict"] == verdict.value
    assert mujoco.MjModel.from_xml_path(str(out / "extended.xml")).nu == 2


def keys(content: object) -> set[str]:
    """All keys in a verdict, except names of parameters."""
    if isinstance(content, list):
        return set().union(*map(keys, content))
    if not isinstance(content, dict):
        return set()
    inner = [keys(value) for name, value in content.items() if name not in ("parameters", "values")]
    return set(content).union(*inner)


def test_the_docstring_documents_each_key(diagnosed: Make) -> None:
    found = verdict_json(replace(diagnosed(Verdict.NAMED), likelihood_gain=None))

    documented = set(re.findall(r"\w+", verdict_module.__doc__ or ""))
    assert keys(found) - documented == set()


def test_the_verdict_has_the_keys_of_the_interface(diagnosed: Make) -> None:
    diagnosis = diagnosed(Verdict.NAMED)
    elsewhere = (Location("tendon", ("flexor",)),)
    causes = (diagnosis.causes[0], replace(diagnosis.causes[1], elsewhere=elsewhere))
    found = verdict_json(replace(diagnosis, causes=causes))

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
    assert (first["kind"], first["elements"], first["note"]) == ("tendon", ["flexor"], "")
    assert first["parameters"]["friction"] == {
        "value": 3.0,
        "low": 2.5,
        "high": 3.5,
        "unit": "N",
    }
    for cause in (first, second):
        chances = [one["probability"] for one in cause["doubts"]]
        assert cause["confidence"] + sum(chances) == pytest.approx(1.0)
    assert first["doubts"][0]["reason"] == "another known cause in its place"
    assert second["equivalent"] == ["length_scale"]
    assert second["elsewhere"] == [{"kind": "tendon", "elements": ["flexor"], "note": ""}]
    assert found["gain"] == {"value": 0.955, "low": 0.93, "high": 0.97}


def test_the_verdict_has_each_measure_it_was_decided_on_and_what_each_cause_removes(
    diagnosed: Make,
) -> None:
    found = verdict_json(diagnosed(Verdict.PARTLY_NAMED))

    assert found["criteria"] == [
        {
            "name": "report_noises",
            "value": 1.5,
            "threshold": 1.2,
            "met": False,
            "objection": "leaves errors above the noise",
        }
    ]
    assert [step["after"] for step in found["waterfall"]] == [11.0, 4.0, 1.5]
    assert [cause["share"] for cause in found["causes"]] == found["waterfall"][1:]
    assert found["causes"][0]["held_out_gain"] == {"value": 50.0, "low": 30.0, "high": 70.0}
    [rejected] = found["rejected"]
    assert rejected["reason"] == "has a parameter at its bound"
    assert set(rejected["values"]) == {"offset"}


@pytest.mark.usefixtures("plain_page")
def test_the_extended_model_holds_what_is_named_of_a_part(
    diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    write_diagnosis(diagnosed(Verdict.PARTLY_NAMED), lever_study, tmp_path / "out")

    assert "coulomb_friction/flexor" in (tmp_path / "out" / "extended.xml").read_text()
    effects = json.loads((tmp_path / "out" / "extended.json").read_text())["effects"]
    assert [effect["cause"] for effect in effects] == ["length_offset"]


NOTE = "effort of joint4 follows the model's replay with the opposite sign"


@pytest.mark.parametrize(
    ("notes", "expected"), [(None, []), ((), []), ((NOTE, "it touches"), [NOTE, "it touches"])]
)
def test_the_verdict_has_the_notes_on_the_study(
    notes: tuple[str, ...] | None, expected: list[str], diagnosed: Make
) -> None:
    diagnosis = replace(diagnosed(Verdict.UNEXPLAINED), notes=notes)

    assert verdict_json(diagnosis)["notes"] == expected


@pytest.mark.usefixtures("plain_page")
def test_a_study_that_was_not_checked_is_checked_when_files_are_written(
    diagnosed: Make, study_folder: Any, tmp_path: Path
) -> None:
    diagnosis = replace(diagnosed(Verdict.UNEXPLAINED), notes=None)
    del study_folder.content["sensors"]["tension_flexor"]["scale"]
    study, out = load_study(study_folder.write()), tmp_path / "out"

    write_diagnosis(diagnosis, study, out)

    notes = json.loads((out / "verdict.json").read_text())["notes"]
    assert notes == list(check_study(study))
    assert any("tension_flexor" in note for note in notes)


@pytest.mark.usefixtures("plain_page")
def test_a_study_that_was_checked_is_not_checked_again(
    diagnosed: Make, lever_study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.report.files.check_study", None)
    diagnosis = replace(diagnosed(Verdict.UNEXPLAINED), notes=(NOTE,))

    write_diagnosis(diagnosis, lever_study, tmp_path / "out")

    assert json.loads((tmp_path / "out" / "verdict.json").read_text())["notes"] == [NOTE]


def test_without_gain_and_experiment_both_are_null(diagnosed: Make) -> None:
    found = verdict_json(replace(diagnosed(Verdict.NOTHING_WRONG), next_experiment=None))

    assert found["gain"] is None
    assert found["next_experiment"] is None
    assert found["causes"] == []


def test_only_scores_of_candidates_may_be_infinite(diagnosed: Make) -> None:
    diagnosis = diagnosed(Verdict.NAMED)

    assert verdict_json(diagnosis)["candidates"][-1]["score"] is None
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
def test_a_failure_does_not_change_the_folder(
    diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    out, work = tmp_path / "results" / "out", tmp_path / "results"
    broken = replace(diagnosed(Verdict.NAMED), extended_xml="<mujoco><nonsense/></mujoco>")

    with pytest.raises(StudyError, match="cannot be loaded"):
        write_diagnosis(broken, lever_study, out)
    assert list(work.iterdir()) == []

    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, out)
    before = (out / "verdict.json").read_bytes()
    with pytest.raises(StudyError, match="cannot be loaded"):
        write_diagnosis(broken, lever_study, out)
    assert (out / "verdict.json").read_bytes() == before
    assert [path.name for path in work.iterdir()] == ["out"]


@pytest.mark.usefixtures("plain_page")
def test_a_folder_with_other_files_is_not_overwritten(
    diagnosed: Make, lever_study: Study, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, out)
    (out / "thesis.tex").write_text("ten years of work")

    with pytest.raises(StudyError, match=r"contains thesis\.tex.*choose a new or empty folder"):
        write_diagnosis(diagnosed(Verdict.NAMED), lever_study, out)

    assert (out / "thesis.tex").read_text() == "ten years of work"


def test_a_folder_without_a_verdict_is_no_earlier_diagnosis(tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("mine")

    with pytest.raises(StudyError, match="not an earlier diagnosis"):
        check_out(tmp_path)


def test_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")

    with pytest.raises(StudyError, match="is a file"):
        check_out(tmp_path / "out")


def test_an_empty_or_missing_folder_can_be_used(tmp_path: Path) -> None:
    check_out(tmp_path)
    check_out(tmp_path / "none")


@pytest.mark.usefixtures("plain_page")
def test_the_earlier_diagnosis_is_restored_if_the_new_one_cannot_be_moved(
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
