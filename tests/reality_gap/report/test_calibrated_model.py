"""Calibrated model: where a diagnosis shows it and how it is read again."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from reality_gap.causes.base import Location
from reality_gap.diagnosis import Calibration, Correction, Diagnosis, Verdict
from reality_gap.report import verdict_json as verdict_module
from reality_gap.report.extended_model import load_calibrated, load_extended
from reality_gap.report.files import write_diagnosis
from reality_gap.report.html import page
from reality_gap.report.terminal import calibration_line
from reality_gap.report.verdict_json import verdict_json
from reality_gap.study.data import Study
from reality_gap.study.system import compile_system
from tests.reality_gap.causes.candidates import candidate

Make = Callable[[Verdict], Diagnosis]


@pytest.fixture
def calibrated(diagnosed: Make, lever_study: Study) -> Make:
    """Makes diagnoses with a lever that is 20 g heavier."""

    def make(verdict: Verdict) -> Diagnosis:
        mass = candidate(compile_system(lever_study), "link_mass", Location("body", ("lever",)))
        heavier = Correction(mass, mass.parameters[0], 0.02, 2.5)
        found = diagnosed(verdict)
        xml = found.extended_xml.replace('mass="1"', 'mass="1.02"')
        assert xml != found.extended_xml
        return replace(found, calibration=Calibration((heavier,), 1.1, xml, found.effects))

    return make


@pytest.fixture
def folder(
    calibrated: Make, lever_study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """Folder of a diagnosis with a calibrated model."""
    monkeypatch.setattr("reality_gap.report.files.write_report", lambda *_: None)
    write_diagnosis(calibrated(Verdict.NAMED), lever_study, tmp_path / "out")
    return tmp_path / "out"


def test_it_is_read_again_with_the_effects_of_the_extended_model(folder: Path) -> None:
    heavier, extended = load_calibrated(folder), load_extended(folder)

    assert heavier.spec.compile().body("lever").mass[0] == pytest.approx(1.02)
    assert extended.spec.compile().body("lever").mass[0] == pytest.approx(1.0)
    assert heavier.effects == extended.effects != ()


def test_a_new_diagnosis_without_it_leaves_none(
    folder: Path, diagnosed: Make, lever_study: Study
) -> None:
    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, folder)

    assert not list(folder.glob("calibrated*"))


def test_the_verdict_lists_the_adjustments(folder: Path) -> None:
    found = json.loads((folder / "verdict.json").read_text())["calibration"]

    assert found == {
        "rms": 1.1,
        "corrections": [
            {
                "cause": "link_mass",
                "kind": "body",
                "elements": ["lever"],
                "note": "",
                "parameter": "mass",
                "value": 0.02,
                "unit": "kg",
                "tolerances": 2.5,
            }
        ],
        "together": False,
    }
    documented = set(re.findall(r"\w+", verdict_module.__doc__ or ""))
    assert {*found, *found["corrections"][0]} <= documented


@pytest.mark.usefixtures("no_figures")
def test_the_report_shows_it(calibrated: Make, lever_study: Study) -> None:
    text = " ".join(page(calibrated(Verdict.NAMED), lever_study).split())

    assert "<code>calibrated.xml</code> is the extended model with 1 of its numbers" in text
    assert "it leaves 1.10 noises, the extended model alone 1.50" in text
    row = ("Mass of a link, mass", "lever", "20.0 g", "2.5")
    assert "".join(f"<td>{cell}</td>" for cell in row) in text
    assert "load_calibrated(folder)" in text


@pytest.mark.usefixtures("no_figures")
def test_the_report_and_the_terminal_explain_a_joint_fit(
    calibrated: Make, lever_study: Study
) -> None:
    found = calibrated(Verdict.NAMED)
    assert found.calibration
    together = replace(found, calibration=replace(found.calibration, together=True))

    text = " ".join(page(together, lever_study).split())

    assert "<code>calibrated.xml</code> is your model with 1 of its numbers" in text
    assert "which of them is to blame is not known" in text
    assert together.calibration
    line = calibration_line(together, together.calibration)
    assert line.startswith("calibrated.xml is the model with 1 of its numbers")


@pytest.mark.usefixtures("no_figures")
def test_the_report_mentions_none_without_it(diagnosed: Make, lever_study: Study) -> None:
    assert "alibrated" not in page(diagnosed(Verdict.NAMED), lever_study).split("How to")[1]
    assert verdict_json(diagnosed(Verdict.NAMED))["calibration"] is None


def test_the_terminal_explains_it(calibrated: Make) -> None:
    named, none = (calibrated(v) for v in (Verdict.NAMED, Verdict.UNEXPLAINED))
    assert named.calibration
    assert none.calibration

    assert calibration_line(named, named.calibration) == (
        "calibrated.xml is the extended model with 1 of its numbers adjusted to this log: 1.10 "
        "noises on held-out data, where the extended model leaves 1.50. None of these adjustments "
        "is a finding."
    )
    assert "is the model with 1 of its numbers" in calibration_line(none, none.calibration)
