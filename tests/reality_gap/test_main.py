"""`python -m reality_gap`: what it prints, what it writes, and its exit codes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reality_gap.__main__ import main
from reality_gap.causes import cause
from reality_gap.diagnosis import Diagnosis, Estimate, NamedCause, Verdict
from reality_gap.inference.checkpoint import Checkpoint
from reality_gap.inference.verdict import Options
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.data import Study
from reality_gap.study.system import look_at

ROOT = Path(__file__).resolve().parents[2]


def diagnosis_of(study: Study) -> Diagnosis:
    """A diagnosis that somebody else has made."""
    friction = cause("coulomb_friction")
    system = look_at(study)
    location = friction.locations(system)[0]
    candidate = Candidate(friction, location, friction.parameters(system, location))
    parameters = {"friction": Estimate(4.2, 3.9, 4.6, "N")}
    return Diagnosis(
        study=study.name,
        verdict=Verdict.NAMED,
        sentence="The wire flexor sticks.",
        causes=(NamedCause(candidate, parameters, 0.93, ("backlash",)),),
        fitted_candidates=(),
        rms_before=3.0,
        rms_after=1.1,
        noise_floor=1.0,
        gain=None,
        unexplained_fraction=0.05,
        explainable_fraction=1.0,
        depends_on=(),
        next_experiment=None,
        not_judged=(),
        traces=(),
        effects=(),
        extended_xml="<mujoco/>",
        seconds=1.0,
    )


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Replace the diagnosis and its files by a record of what they were asked."""
    asked: dict[str, Any] = {}

    def diagnose(
        study: Study,
        jobs: int,
        options: Options,
        progress: Callable[[float, str], None],
        work: Path,
    ) -> Diagnosis:
        progress(0.5, "fitting")
        Checkpoint(work, "k").get(0, lambda: [np.zeros((1, 1), dtype=np.float32)])
        if asked.get("interrupt"):
            raise KeyboardInterrupt
        asked.update(study=study, jobs=jobs, options=options)
        return diagnosis_of(study)

    def write(diagnosis: Diagnosis, study: Study, out: Path) -> None:
        asked.update(written=diagnosis, out=out)

    monkeypatch.setattr("reality_gap.pipeline.diagnose", diagnose)
    monkeypatch.setattr("reality_gap.report.files.write_diagnosis", write)
    return asked


def test_diagnose_writes_and_prints_the_verdict(
    study_folder: Any, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "diagnosis"
    assert main(["diagnose", str(study_folder.path), "--out", str(out), "--jobs", "2"]) == 0
    assert found["jobs"] == 2
    assert found["options"] == Options()
    assert found["out"] == out
    assert found["written"].study == found["study"].name == "a lever"
    printed = capsys.readouterr().out
    for words in (
        "The wire flexor sticks.",
        "Coulomb",
        "4.20 N",
        "93 %",
        "backlash",
        "report.html",
    ):
        assert words in printed


def test_diagnose_says_what_is_suspicious(
    study_folder: Any, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    del study_folder.content["sensors"]["tension_flexor"]["scale"]
    assert main(["diagnose", str(study_folder.write()), "--out", str(tmp_path / "d")]) == 0
    assert "note: tension_flexor is" in capsys.readouterr().out


def test_diagnose_refuses_a_wrong_study_before_any_work(
    study_folder: Any, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_folder.logs["robot_0.csv"]["time"][5] = 0.0
    out = tmp_path / "diagnosis"
    assert main(["diagnose", str(study_folder.write()), "--out", str(out)]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert "line 7 of robot_0.csv" in told.err
    assert not out.exists()
    assert not found


def test_diagnose_leaves_a_folder_of_somebody_else_alone(
    study_folder: Any, found: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    out = study_folder.path.parent
    assert main(["diagnose", str(study_folder.path), "--out", str(out)]) == 2
    assert "left alone" in capsys.readouterr().err
    assert not found


def test_a_rough_machine_may_be_off_by_more(
    study_folder: Any, found: dict[str, Any], tmp_path: Path
) -> None:
    out = str(tmp_path / "d")
    assert main(["diagnose", str(study_folder.path), "--out", out, "--tolerance", "3"]) == 0
    assert found["options"] == Options(tolerance=3.0)


def test_what_an_interrupted_diagnosis_did_is_kept_until_it_is_written(
    study_folder: Any, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["diagnose", str(study_folder.path), "--out", str(tmp_path / "new" / "d")]
    work = tmp_path / "new" / ".d.work"
    found["interrupt"] = True
    assert main(arguments) == 130
    assert capsys.readouterr().err == "interrupted; the same command goes on from there\n"
    assert {path.name for path in work.iterdir()} == {"KEY", "00000.npz"}
    assert "written" not in found

    found["interrupt"] = False
    assert main(arguments) == 0
    assert "written" in found
    assert not work.exists()


@pytest.mark.parametrize("tolerance", ["0", "-1", "nan", "inf"])
def test_a_tolerance_is_a_factor(
    study_folder: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str], tolerance: str
) -> None:
    out = str(tmp_path / "d")
    assert main(["diagnose", str(study_folder.path), "--out", out, "--tolerance", tolerance]) == 2
    assert "--tolerance is a factor above 0" in capsys.readouterr().err


def test_diagnose_needs_a_process(
    study_folder: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["diagnose", str(study_folder.path), "--out", str(tmp_path / "d"), "--jobs", "0"]
    assert main(arguments) == 2
    assert "--jobs" in capsys.readouterr().err


def test_check_is_content_with_a_good_study(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(study_folder.path)]) == 0
    printed = capsys.readouterr().out
    assert "nothing wrong with this study: 2 episodes, 7.96 s, 7 channels" in printed


def test_check_says_what_is_suspicious(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    study_folder.content["sensors"]["length_flexor"]["noise"] = 0.05
    assert main(["check", str(study_folder.write())]) == 0
    printed = capsys.readouterr().out
    assert "the noise given for length_flexor is 0.05 m" in printed
    assert "nothing wrong" not in printed


def test_check_names_causes_that_have_no_place(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    angle = study_folder.content["sensors"]["angle_elbow"]
    study_folder.content["sensors"] = {"angle_elbow": angle}
    assert main(["check", str(study_folder.write())]) == 0
    cannot = next(line for line in capsys.readouterr().out.splitlines() if "cannot" in line)
    assert "tension_scale" in cannot


def test_init_writes_a_study_that_can_be_checked(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    root, out = study_folder.path.parent, study_folder.path.parent / "draft.yaml"
    logs = [str(root / name) for name in ("robot_0.csv", "robot_1.csv", "camera_0.csv")]
    assert main(["init", str(root / "lever.xml"), *logs[:2], "--out", str(out)]) == 0
    assert main(["check", str(out)]) == 0
    assert "2 episodes" in capsys.readouterr().out


def test_init_overwrites_nothing(study_folder: Any, capsys: pytest.CaptureFixture[str]) -> None:
    root = study_folder.path.parent
    before = study_folder.path.read_text(encoding="utf-8")
    model, log = str(root / "lever.xml"), str(root / "robot_0.csv")
    assert main(["init", model, log, "--out", str(study_folder.path)]) == 2
    assert "exists" in capsys.readouterr().err
    assert study_folder.path.read_text(encoding="utf-8") == before


def test_init_leaves_nothing_behind_a_fault(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    root = study_folder.path.parent
    before = sorted(root.iterdir())
    arguments = [str(root / "lever.xml"), str(root / "none.csv"), "--out", str(root / "new.yaml")]
    assert main(["init", *arguments]) == 2
    assert "no file none.csv" in capsys.readouterr().err
    assert sorted(root.iterdir()) == before


def test_a_fault_in_a_process_of_its_own(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "reality_gap", "check", str(tmp_path / "none.yaml")],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == f"there is no study file at {tmp_path / 'none.yaml'}\n"
