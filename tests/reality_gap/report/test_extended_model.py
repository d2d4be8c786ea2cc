"""Extended model: loaded again, it is the plant that was diagnosed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.diagnosis import Diagnosis, Verdict
from reality_gap.errors import StudyError, UnknownNameError
from reality_gap.report.extended_model import load_extended
from reality_gap.report.files import write_diagnosis
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.study.data import Study
from reality_gap.study.system import compile_system

Make = Callable[[Verdict], Diagnosis]


@pytest.fixture
def folder(
    diagnosed: Make, lever_study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """Folder of a diagnosis that names friction of a tendon and an encoder offset; no report."""
    monkeypatch.setattr("reality_gap.report.files.write_report", lambda *_: None)
    write_diagnosis(diagnosed(Verdict.NAMED), lever_study, tmp_path / "out")
    return tmp_path / "out"


def test_its_replay_is_that_of_the_diagnosis(
    folder: Path, diagnosed: Make, lever_study: Study
) -> None:
    replayed = load_extended(folder).replay(lever_study).prediction

    traces = diagnosed(Verdict.NAMED).traces
    expected = np.concatenate([trace.after for trace in traces])
    noise = np.concatenate([np.full(len(trace.time), trace.noise) for trace in traces])
    before = np.concatenate([trace.before for trace in traces])
    assert np.max(np.abs(replayed - expected) / noise) < 0.2
    assert np.max(np.abs(before - expected) / noise) > 5.0


def test_the_friction_is_in_the_xml_and_the_encoder_in_the_json(folder: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(folder / "extended.xml"))
    content = json.loads((folder / "extended.json").read_text())

    friction = model.actuator("coulomb_friction/flexor")
    assert friction.biasprm[3] == pytest.approx(3.0)  # LuGre's sliding friction
    assert model.tendon(int(friction.trnid[0])).name == "flexor"
    assert content == {
        "model": "extended.xml",
        "effects": [
            {
                "cause": "length_offset",
                "kind": "tendon",
                "elements": ["extensor"],
                "note": "",
                "parameters": {"offset": 0.0025},
            }
        ],
    }


def test_a_replay_does_not_change_the_extended_model(folder: Path, lever_study: Study) -> None:
    extended = load_extended(folder)
    before = extended.spec.to_xml()

    first = extended.replay(lever_study).prediction
    second = extended.replay(lever_study).prediction

    np.testing.assert_array_equal(first, second)
    assert extended.spec.to_xml() == before


def test_a_folder_without_a_diagnosis_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"no extended\.json .* give the folder of a diagnosis"):
        load_extended(tmp_path)


def test_a_cause_that_is_not_in_the_catalogue_is_named(folder: Path) -> None:
    text = (folder / "extended.json").read_text()
    (folder / "extended.json").write_text(text.replace("length_offset", "gremlins"))

    with pytest.raises(UnknownNameError, match=r"'gremlins'; known: .*coulomb_friction"):
        load_extended(folder)


@pytest.mark.parametrize(
    "text", ["{}", "[]", "not json", '{"model": "extended.xml"}', '{"effects": [1]}', "[" * 9999]
)
def test_a_damaged_file_is_refused(folder: Path, text: str) -> None:
    (folder / "extended.json").write_text(text)

    with pytest.raises(StudyError, match="was not written by a diagnosis"):
        load_extended(folder)


def test_a_model_outside_the_folder_is_refused(folder: Path) -> None:
    text = (folder / "extended.json").read_text()
    (folder / "extended.json").write_text(text.replace("extended.xml", "../lever.xml"))

    with pytest.raises(StudyError, match=r"names the model '../lever.xml' instead of extended"):
        load_extended(folder)


def test_a_study_of_another_machine_is_refused(folder: Path, lever_study: Study) -> None:
    text = (folder / "extended.json").read_text()
    (folder / "extended.json").write_text(text.replace('"extensor"', '"gluteus"'))

    with pytest.raises(UnknownNameError, match="'gluteus'; known: flexor, extensor"):
        load_extended(folder).replay(lever_study)


@pytest.mark.parametrize("id", CATALOGUE)
def test_the_edits_of_a_cause_survive_in_the_xml(id: str, lever_study: Study) -> None:
    system, cause = compile_system(lever_study), CATALOGUE[id]
    for location in cause.locations(system):
        candidate = Candidate(cause, location, cause.parameters(system, location))
        values = {p.name: p.null + p.scale for p in candidate.parameters}
        spec = build(system, [(candidate, values)]).spec

        again = mujoco.MjSpec.from_string(spec.to_xml()).compile()

        _assert_alike(spec.compile(), again)


def _assert_alike(one: mujoco.MjModel, two: mujoco.MjModel) -> None:
    """Assert that all numbers of two models agree up to the six digits of XML."""
    for name in dir(one):
        value = getattr(one, name)
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            other = getattr(two, name)
            np.testing.assert_allclose(other, value, rtol=1e-4, atol=1e-5, err_msg=name)
