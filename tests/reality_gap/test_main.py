"""Command line: output, files and exit codes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reality_gap.__main__ import main
from reality_gap.causes import CATALOGUE, find_cause
from reality_gap.causes.base import Cause
from reality_gap.diagnose_command import Thresholds
from reality_gap.diagnosis import Diagnosis, Estimate, NamedCause, Verdict
from reality_gap.inference.checkpoint import Checkpoint
from reality_gap.inference.forward_selection import Settings
from reality_gap.inference.verdict import Options
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.data import Study
from reality_gap.study.system import compile_system

ROOT = Path(__file__).resolve().parents[2]


def diagnosis_of(study: Study) -> Diagnosis:
    """A made-up diagnosis that names friction."""
    friction = find_cause("coulomb_friction")
    system = compile_system(study)
    location = friction.locations(system)[0]
    candidate = Candidate(friction, location, friction.parameters(system, location))
    parameters = {"friction": Estimate(4.2, 3.9, 4.6, "N")}
    return Diagnosis(
        study=study.name,
        verdict=Verdict.NAMED,
        sentence="The flexor sticks.",
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
    """Replaces the diagnosis and its files by a record of their arguments."""
    called: dict[str, Any] = {}

    def diagnose(
        study: Study,
        jobs: int,
        causes: list[Cause],
        options: Options,
        progress: Callable[[float, str], None],
        work: Path,
    ) -> Diagnosis:
        progress(0.5, "fitting")
        Checkpoint(work, "k").get(0, lambda: [np.zeros((1, 1), dtype=np.float32)])
        if called.get("interrupt"):
            raise KeyboardInterrupt
        called.update(study=study, jobs=jobs, causes=causes, options=options)
        return replace(diagnosis_of(study), verdict=called.get("verdict", Verdict.NAMED))

    def write(diagnosis: Diagnosis, study: Study, out: Path) -> None:
        called.update(written=diagnosis, out=out)

    monkeypatch.setattr("reality_gap.pipeline.diagnose", diagnose)
    monkeypatch.setattr("reality_gap.report.files.write_diagnosis", write)
    return called


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
    for text in (
        "The flexor sticks.",
        "Coulomb",
        "4.20 N",
        "93 %",
        "backlash",
        "report.html",
    ):
        assert text in printed


def test_diagnose_prints_warnings(
    study_folder: Any, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    del study_folder.content["sensors"]["tension_flexor"]["scale"]
    assert main(["diagnose", str(study_folder.write()), "--out", str(tmp_path / "d")]) == 0
    assert "note: tension_flexor is" in capsys.readouterr().out
    assert any("tension_flexor is" in note for note in found["written"].notes)


@pytest.mark.parametrize("verdict", [Verdict.UNEXPLAINED, Verdict.NOTHING_WRONG])
@pytest.mark.parametrize("wrong", [False, True])
def test_an_unexplained_gap_refers_to_the_notes(
    verdict: Verdict,
    wrong: bool,
    study_folder: Any,
    found: dict[str, Any],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    found["verdict"] = verdict
    if wrong:
        del study_folder.content["sensors"]["tension_flexor"]["scale"]
    assert main(["diagnose", str(study_folder.write()), "--out", str(tmp_path / "d")]) == 0
    assert bool(found["written"].notes) is wrong
    refers = "on the study above first" in capsys.readouterr().out
    assert refers is (wrong and verdict is Verdict.UNEXPLAINED)


def test_diagnose_refuses_a_wrong_study_before_its_work(
    study_folder: Any, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_folder.logs["robot_0.csv"]["time"][5] = 0.0
    out = tmp_path / "diagnosis"
    assert main(["diagnose", str(study_folder.write()), "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert "line 7 of robot_0.csv" in printed.err
    assert not out.exists()
    assert not found


def test_diagnose_does_not_overwrite_a_folder_with_other_files(
    study_folder: Any, found: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    out = study_folder.path.parent
    assert main(["diagnose", str(study_folder.path), "--out", str(out)]) == 2
    assert "is not overwritten" in capsys.readouterr().err
    assert not found


def test_a_rough_model_can_have_larger_tolerances(
    study_folder: Any, found: dict[str, Any], tmp_path: Path
) -> None:
    out = str(tmp_path / "d")
    assert main(["diagnose", str(study_folder.path), "--out", out, "--tolerance", "3"]) == 0
    assert found["options"] == Options(tolerance=3.0)


def test_without_options_a_diagnosis_has_the_defaults_of_the_library(
    study_folder: Any, found: dict[str, Any], tmp_path: Path
) -> None:
    assert main(["diagnose", str(study_folder.path), "--out", str(tmp_path / "d")]) == 0
    assert found["options"] == Options()
    assert found["causes"] == list(CATALOGUE.values())


def test_each_threshold_is_an_option() -> None:
    names = {"root_learned"}
    for record, others in (
        (Settings, {"most"}),
        (Options, {"search", "root", "tolerance", "suggest", "search_after_groups", "time_limit"}),
    ):
        names |= {option.name for option in fields(record)} - others
    assert {option.name for option in fields(Thresholds)} == names


def test_thresholds_catalogue_and_depth_are_options(
    study_folder: Any, found: dict[str, Any], tmp_path: Path
) -> None:
    chosen = ["--causes", "payload", "delay", "slack", "--without", "delay", "--depth", "1"]
    limits = ["--thresholds.left", "2", "--thresholds.threshold", "9", "--thresholds.root", "1"]
    more = ["--thresholds.root-learned", "4"]
    out = str(tmp_path / "d")
    assert main(["diagnose", str(study_folder.path), "--out", out, *chosen, *limits, *more]) == 0
    assert [cause.id for cause in found["causes"]] == ["payload", "slack"]
    search = Settings(threshold=9.0, root=1.0, most=1)
    assert found["options"] == Options(search=search, left=2.0, root=4.0)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--depth", "0"], "--depth must be at least 1, not 0"),
        (["--thresholds.left", "-1"], "--thresholds.left must be at least 0 and finite, not -1.0"),
        (["--time-limit", "0"], "--time-limit must be above 0, not 0.0"),
        (["--time-limit", "nan"], "--time-limit must be above 0, not nan"),
        (["--thresholds.likely", "1.5"], "--thresholds.likely must be from 0 to 1, not 1.5"),
        (["--thresholds.more-refits", "0"], "--thresholds.more-refits must be at least 1, not 0"),
        (["--causes", "magic"], "unknown cause 'magic'; known: "),
        (["--causes", "slack", "--without", "slack"], "--without leaves out all causes"),
    ],
)
def test_options_out_of_range_are_refused(
    arguments: list[str],
    text: str,
    study_folder: Any,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = str(tmp_path / "d")
    assert main(["diagnose", str(study_folder.path), "--out", out, *arguments]) == 2
    assert capsys.readouterr().err.startswith(text)


def test_an_interrupted_diagnosis_continues_from_its_checkpoint(
    study_folder: Any, found: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["diagnose", str(study_folder.path), "--out", str(tmp_path / "new" / "d")]
    work = tmp_path / "new" / ".d.work"
    found["interrupt"] = True
    assert main(arguments) == 130
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "interrupted; run the same command to continue"
    assert {path.name for path in work.iterdir()} == {"KEY", "00000.npz"}
    assert "written" not in found

    found["interrupt"] = False
    assert main(arguments) == 0
    assert "written" in found
    assert not work.exists()


def test_a_diagnosis_ends_at_its_limit_of_time(
    study_folder: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["diagnose", str(study_folder.path), "--out", str(tmp_path / "d")]
    assert main([*arguments, "--jobs", "1", "--time-limit", "0.001"]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("no verdict within 0.001 s, while replaying the nominal model; allow")
    assert not (tmp_path / "d").exists()


@pytest.mark.parametrize("tolerance", ["0", "-1", "nan", "inf"])
def test_a_tolerance_that_is_no_factor_is_refused(
    study_folder: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str], tolerance: str
) -> None:
    out = str(tmp_path / "d")
    assert main(["diagnose", str(study_folder.path), "--out", out, "--tolerance", tolerance]) == 2
    assert "--tolerance must be above 0" in capsys.readouterr().err


def test_diagnose_needs_at_least_one_process(
    study_folder: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["diagnose", str(study_folder.path), "--out", str(tmp_path / "d"), "--jobs", "0"]
    assert main(arguments) == 2
    assert "--jobs" in capsys.readouterr().err


def test_check_prints_the_size_of_a_good_study(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", str(study_folder.path)]) == 0
    printed = capsys.readouterr().out
    assert "nothing is wrong with this study: 2 episodes, 7.96 s, 7 channels" in printed


def test_check_prints_warnings(study_folder: Any, capsys: pytest.CaptureFixture[str]) -> None:
    study_folder.content["sensors"]["length_flexor"]["noise"] = 0.05
    assert main(["check", str(study_folder.write())]) == 0
    printed = capsys.readouterr().out
    assert "the noise of length_flexor is stated as 0.05 m" in printed
    assert "nothing is wrong" not in printed


def test_check_lists_causes_without_a_location(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    angle = study_folder.content["sensors"]["angle_elbow"]
    study_folder.content["sensors"] = {"angle_elbow": angle}
    assert main(["check", str(study_folder.write())]) == 0
    cannot = next(
        line for line in capsys.readouterr().out.splitlines() if "cannot be diagnosed" in line
    )
    assert "tension_scale" in cannot


def test_init_writes_a_study_that_can_be_checked(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    root, out = study_folder.path.parent, study_folder.path.parent / "draft.yaml"
    logs = [str(root / name) for name in ("robot_0.csv", "robot_1.csv", "camera_0.csv")]
    assert main(["init", str(root / "lever.xml"), *logs[:2], "--out", str(out)]) == 0
    assert main(["check", str(out)]) == 0
    assert "2 episodes" in capsys.readouterr().out


def test_init_prints_which_columns_are_not_used(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    log = study_folder.logs["robot_0.csv"]
    log["velocity_flexor"] = log["length_flexor"]
    root = study_folder.write().parent
    arguments = [str(root / "lever.xml"), str(root / "robot_0.csv")]
    assert main(["init", *arguments, "--out", str(root / "new.yaml")]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "note: not used, because no element of the model fits: velocity_flexor" in printed


def test_init_overwrites_nothing(study_folder: Any, capsys: pytest.CaptureFixture[str]) -> None:
    root = study_folder.path.parent
    before = study_folder.path.read_text(encoding="utf-8")
    model, log = str(root / "lever.xml"), str(root / "robot_0.csv")
    assert main(["init", model, log, "--out", str(study_folder.path)]) == 2
    assert "exists" in capsys.readouterr().err
    assert study_folder.path.read_text(encoding="utf-8") == before


def test_init_writes_no_file_after_an_error(
    study_folder: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    root = study_folder.path.parent
    before = sorted(root.iterdir())
    arguments = [str(root / "lever.xml"), str(root / "none.csv"), "--out", str(root / "new.yaml")]
    assert main(["init", *arguments]) == 2
    assert "no file none.csv" in capsys.readouterr().err
    assert sorted(root.iterdir()) == before


def test_an_error_ends_the_process_with_its_exit_code(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "reality_gap", "check", str(tmp_path / "none.yaml")],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == f"there is no study file at {tmp_path / 'none.yaml'}\n"


def test_causes_lists_the_catalogue_with_units(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["causes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    heads = [line for line in lines if not line.startswith(" ")]
    assert [head.split(":")[0] for head in heads] == list(CATALOGUE)
    after = dict(pairwise(lines))
    assert all(after[head].startswith("  ") for head in heads), "each cause has parameters"
    assert after[next(h for h in heads if h.startswith("backlash"))] == (
        "  tendon: gap [m], begin [1]"
    )


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("reality-gap ")


@pytest.mark.parametrize(
    ("started", "program"),
    [("/usr/bin/reality-gap", "reality-gap"), ("reality_gap/__main__.py", "python -m reality_gap")],
)
def test_the_usage_names_the_program_that_was_started(
    started: str, program: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", [started, "check", "--help"])
    with pytest.raises(SystemExit, match="0"):
        main()
    assert f"usage: {program} check " in capsys.readouterr().out


def test_the_command_line_starts_without_numpy_and_mujoco() -> None:
    code = "import sys, reality_gap.__main__; print({'numpy', 'mujoco'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.stdout == "set()\n"
