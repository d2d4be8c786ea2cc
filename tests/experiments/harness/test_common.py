"""Common parts of experiments: seeds, files, command line, resumed and parallel tasks."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from experiments.__main__ import RUNNERS, main
from experiments.harness import common
from experiments.harness.common import make_summary, median_and_worst, parse_seeds
from experiments.harness.errors import ExperimentError
from experiments.harness.report import Picture, Table, png, write_report
from experiments.harness.runner import run_tasks
from kengoro.trained_maps import nominal_model
from mjcf_sandbox.files import write_json

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    ("text", "seeds"), [("3", [3]), ("0-2", [0, 1, 2]), ("100-100", [100]), ("009-10", [9, 10])]
)
def test_seeds(text: str, seeds: list[int]) -> None:
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "1,2", "-3", "3-", "5-4", "1-2-3", " 1", "1.5"])
def test_bad_seeds_get_one_sentence(text: str) -> None:
    with pytest.raises(ExperimentError, match=r"^Seeds are .*\.$"):
        parse_seeds(text)


def test_help_names_the_experiments(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    shown = capsys.readouterr().out
    assert "can-grasping" in shown
    assert "learnability" in shown


@pytest.mark.parametrize("arguments", [["swimming"], ["can_grasping", "--seeds", "1"]])
def test_an_unknown_experiment_gets_one_sentence(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    output = capsys.readouterr().err
    assert output.count("\n") == 1
    assert all(name in output for name in (arguments[0], *RUNNERS))


@pytest.mark.parametrize(("option", "value"), [("--seeds", "9-0"), ("--jobs", "0")])
def test_bad_options_get_one_sentence_and_leave_nothing(
    option: str, value: str, tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "experiments", "learnability", "--out", tmp_path / "out"]
    done = subprocess.run([*command, option, value], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, done.stderr
    assert value in done.stderr
    assert not (tmp_path / "out").exists()


def test_json_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "summary.json"
    write_json(path, {"a": 1.5})
    for bad in ({"a": float("nan")}, {"a": np.zeros(2)}):
        with pytest.raises((ValueError, TypeError)):
            write_json(path, bad)
    assert json.loads(path.read_text()) == {"a": 1.5}
    assert list(path.parent.iterdir()) == [path]


def test_a_summary_has_what_every_experiment_promises() -> None:
    summary = make_summary("x", {100: {"a": 1}, 101: {"a": 2}}, 12.34, more=3)
    assert {"name", "seeds", "command", "wall_s", "per_seed"} <= set(summary)
    assert summary["seeds"] == [100, 101]
    assert summary["per_seed"]["101"] == {"a": 2}
    assert summary["more"] == 3


def test_median_and_worst() -> None:
    assert median_and_worst([3.0, 1.0, 2.0, 10.0]) == {"median": 2.5, "worst": 10.0}


def square(number: int) -> dict[str, int]:
    return {"square": number**2}


def refuse(number: int) -> None:
    raise AssertionError(f"{number} was run again")


def test_tasks_resume_and_do_not_depend_on_jobs(tmp_path: Path) -> None:
    tasks = {f"t{number}": (number,) for number in range(4)}
    alone = run_tasks(square, tasks, 1, tmp_path / "one", "key")
    assert alone == {f"t{number}": {"square": number**2} for number in range(4)}
    assert list(alone) == list(tasks)
    (tmp_path / "one" / "t0.json").write_text('{"key": "key"}')
    (tmp_path / "one" / "t1.json").write_text("[" * 99_999)
    (tmp_path / "one" / "t2.json").write_text('{"key": "key", "seconds": "1", "result": 0}')
    (tmp_path / "one" / "t3.json").write_text("{ broken")
    (tmp_path / "one" / ".t3.1.part.json").write_text("{ begun")
    assert run_tasks(square, tasks, 1, tmp_path / "one", "key") == alone
    assert run_tasks(refuse, tasks, 1, tmp_path / "one", "key") == alone
    assert sorted(p.name for p in (tmp_path / "one").iterdir()) == [f"{n}.json" for n in tasks]
    with pytest.raises(AssertionError, match="0 was run again"):
        run_tasks(refuse, tasks, 1, tmp_path / "one", "another key")
    with pytest.raises(ExperimentError, match="at least 1"):
        run_tasks(square, tasks, 0, tmp_path / "none", "key")


def test_two_jobs_have_the_results_of_one(tmp_path: Path) -> None:
    tasks = {f"t{number}": (number, 2) for number in range(3)}
    alone = run_tasks(pow, tasks, 1, tmp_path / "one", "key")
    assert run_tasks(pow, tasks, 2, tmp_path / "two", "key") == alone == {"t0": 0, "t1": 1, "t2": 4}


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_task_that_fails_is_named_and_the_others_are_kept(
    jobs: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    tasks = {"zero": (0.0, -1.0), "one": (1.0, -1.0), "two": (2.0, -1.0)}
    with pytest.raises(ZeroDivisionError):
        run_tasks(pow, tasks, jobs, tmp_path, "key")
    assert "zero: ZeroDivisionError" in capfd.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.json", "two.json"]


def test_the_drawing_knows_the_four_groups() -> None:
    sizes = {t.name: (len(t.joint_index), len(t.muscle_index)) for t in nominal_model().topology()}
    assert sizes["shoulder"] == (8, 10)
    assert {name: muscles for name, (_, muscles) in sizes.items()} == {
        "neck": 8,
        "scapula": 10,
        "shoulder": 10,
        "forearm": 8,
    }


def test_the_report_holds_its_tables_and_figures(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    image = png(Figure(figsize=(1, 1)))
    assert image.startswith(b"\x89PNG")
    write_report(
        tmp_path / "report.html",
        "Title",
        "Said <first>.",
        make_summary("x", {7: {}}, 1.0),
        [Table("Errors", ("what", "deg"), [("after & before", 1.5)])],
        [Picture("A picture", image)],
    )
    page = (tmp_path / "report.html").read_text()
    for part in ("Said &lt;first&gt;.", "after &amp; before", "1.5", "data:image/png;base64,iVBOR"):
        assert part in page
    assert 'src="http' not in page


def test_the_digest_sees_the_code(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    code = ("experiments/mine/a.py", "experiments/robots/b.py", "jmm_agent/c.py", "kengoro/d/e.py")
    shown = ("experiments/mine/figures.py", "experiments/mine/tables.py", "experiments/others/a.py")
    for name in (*code, *shown):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("x = 1\n")
    monkeypatch.setattr(common, "ROOT", tmp_path)
    seen = {common.source_digest("experiments/mine")}
    for name in (*code, *shown):
        (tmp_path / name).write_text("x = 2\n")
        seen.add(common.source_digest("experiments/mine"))
    assert len(seen) == 1 + len(code)


def test_the_command_line_leaves_out_the_folder_of_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    typed = [
        "/x/experiments/__main__.py",
        "ablation",
        "--cache",
        "/my maps",
        "--jobs",
        "1",
    ]
    monkeypatch.setattr(sys, "argv", typed)
    assert common.command_line() == "python -m experiments ablation --jobs 1"
