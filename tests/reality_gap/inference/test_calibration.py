"""Calibrated models: numbers that are slightly wrong, and are no findings."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import (
    CATALOGUE,
    Diagnosis,
    Extended,
    Options,
    Study,
    StudyError,
    diagnose,
    load_calibrated,
    load_extended,
    write_diagnosis,
)
from reality_gap.simulation.inverse_dynamics import ensure_prepared
from reality_gap.study.measurements import measured
from reality_gap.study.splits import REPORT, split
from tests.reality_gap.moved_arm import Machine, moved_arm

FRICTION = {"shoulder": 3.0, "elbow": 1.2, "wrist": 0.06}
IDS = ("coulomb_friction", "viscous_friction", "armature", "link_mass")


def diagnosed(study: Study) -> Diagnosis:
    causes = [CATALOGUE[id] for id in IDS]
    return diagnose(study, causes=causes, options=Options(suggest=False))


def test_a_mass_that_is_slightly_wrong_is_adjusted_and_not_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.report.files.write_report", lambda *_: None)
    study = moved_arm(tmp_path, Machine(mass=4.05, friction=FRICTION))

    found = diagnosed(study)
    write_diagnosis(found, study, tmp_path / "out")

    assert found.calibration is not None
    assert [c.candidate.cause.id for c in found.causes] == ["coulomb_friction"]
    assert found.calibration.rms < 0.95 * found.rms_after
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "calibrated.xml"))
    assert model.body("upper").mass[0] == pytest.approx(4.05, abs=0.02)
    left = [rms(study, load(tmp_path / "out")) for load in (load_extended, load_calibrated)]
    np.testing.assert_allclose(left, [found.rms_after, found.calibration.rms], rtol=0.01)


def rms(study: Study, model: Extended) -> float:
    """RMS of what a model leaves of the held-out readings [noise]."""
    prepared = ensure_prepared(study)
    readings = measured(prepared)
    error = (model.replay(study).prediction - readings.value) / readings.noise
    return float(np.sqrt(np.mean(error[split(readings) == REPORT] ** 2)))


def test_a_model_that_predicts_to_the_noise_is_not_adjusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.report.files.write_report", lambda *_: None)
    study = moved_arm(tmp_path, Machine(friction=FRICTION))

    found = diagnosed(study)
    write_diagnosis(found, study, tmp_path / "out")

    assert found.calibration is None
    assert not (tmp_path / "out" / "calibrated.xml").exists()
    with pytest.raises(StudyError, match=r"no calibrated\.json in .*mentions a calibrated model"):
        load_calibrated(tmp_path / "out")
