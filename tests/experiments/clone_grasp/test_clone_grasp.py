"""Behaviour cloning of grasps: judgement, bad input."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from experiments.__main__ import main
from experiments.clone_grasp import run
from experiments.clone_grasp.run import DRAWING, HISTORY, Args, Sizes, conclude
from experiments.harness.errors import ExperimentError
from kengoro.errors import UsageError


def test_a_damaged_demonstration_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def make_datasets(*_: Any) -> None:
        raise UsageError("000.npz is damaged; remove it, and this robot runs again.")

    monkeypatch.setattr(run, "make_datasets", make_datasets)
    with pytest.raises(ExperimentError, match="damaged; remove it"):
        run.demonstrations(Args(out=tmp_path), [0, 1], Sizes())


def results(agent: float, history: float, present: float) -> dict[str, dict[str, list[bool]]]:
    """Ten episodes on each of two robots and on the drawing, of which a share is lifted."""

    def lifted(share: float) -> list[bool]:
        return [i < round(10 * share) for i in range(10)]

    found = {"agent": {"020": lifted(agent), "021": lifted(agent)}}
    for name, share in (("history", history), ("present", present)):
        found[name] = {"020": lifted(share), "021": lifted(share / 2), DRAWING: lifted(share)}
    return found


@pytest.mark.parametrize(("history", "reached"), [(0.6, True), (0.4, False)])
def test_the_summary_has_both_policies_beside_the_agent(
    tmp_path: Path, history: float, reached: bool
) -> None:
    args = Args(out=tmp_path)
    found = conclude(args, Sizes(), [20, 21], results(1.0, history, 0.2), [True] * 9 + [False], 1.0)
    metrics = found["metrics"]
    assert metrics["learning agent, on new robots"]["median"] == 1.0
    assert metrics["cloned, with a history, on new robots"]["median"] == pytest.approx(
        0.75 * history
    )
    assert metrics["cloned, with a history, on new robots"]["worst"] == pytest.approx(history / 2)
    assert metrics["cloned, without a history, on new robots"]["must"] is None
    judged = metrics["cloned, with a history, on the drawing"]
    assert (judged["must"], judged["reached"]) == (0.6, reached)
    (table,) = found["tables"]
    assert table["rows"][0] == ["learning agent", "20 of 20", "100%", "-"]
    assert table["rows"][2] == ["cloned, without a history", "3 of 20", "10%", "2 of 10"]
    assert found["demonstrations"] == {"episodes": 10, "lifted": 9}
    written = json.loads((tmp_path / "summary.json").read_text())
    assert written["metrics"] == metrics
    assert (tmp_path / "figure_1.png").stat().st_size > 5000
    assert "data:image/png" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--seeds", "10-25"], "Policies are cloned from the robots 0-19 and judged on 10-25;"),
        (["--robots", "3"], "Policies are cloned from the robots 3 and judged on 20-29; at least"),
        (["--seeds", "x"], "Seeds are 'x'; give one such as 3"),
        (["--jobs", "0"], "Jobs are 0, but at least 1 is needed."),
    ],
)
def test_bad_input_is_one_sentence(
    options: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["clone-grasp", "--out", str(tmp_path / "new"), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith(sentence)
    assert error.count("\n") == 1
    assert not (tmp_path / "new").exists()


def test_every_policy_is_judged_on_all_robots(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[tuple[Any, ...]] = []

    def run_agent(robot: int, *_: Any) -> list[bool]:
        ran.append(("agent", robot))
        return [True]

    def run_cloned(path: Path, name: str, robot: int | None, *_: Any) -> list[bool]:
        ran.append((name, robot))
        return [False]

    monkeypatch.setattr(run, "run_agent", run_agent)
    monkeypatch.setattr(run, "run_cloned", run_cloned)
    policies = {}
    for name in HISTORY:
        policies[name] = tmp_path / f"{name}.npz"
        policies[name].write_bytes(name.encode())
    args = Args(out=tmp_path)
    found = run.judge(args, [20, 21], policies, 70, Sizes(), "source")
    assert ran == [
        ("agent", 20), ("agent", 21), ("history", 20), ("history", 21), ("history", None),
        ("present", 20), ("present", 21), ("present", None),
    ]  # fmt: skip
    assert found["history"][DRAWING] == [False]
    # Other weights are judged again, the agent is not.
    ran.clear()
    policies["present"].write_bytes(b"other weights")
    run.judge(args, [20, 21], policies, 70, Sizes(), "source")
    assert ran == [("present", 20), ("present", 21), ("present", None)]


@pytest.mark.slow
def test_the_small_version_runs_and_goes_on(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    maps = request.config.cache.mkdir("maps")
    arguments = ["--robots", "0-1", "--seeds", "20", "--out", str(tmp_path), "--cache", str(maps)]
    assert main(["clone-grasp", "--quick", *arguments]) == 0
    first = json.loads((tmp_path / "summary.json").read_text())
    assert main(["clone-grasp", "--quick", *arguments]) == 0
    again = json.loads((tmp_path / "summary.json").read_text())
    assert again["metrics"] == first["metrics"]
    assert again["wall_s"] < first["wall_s"]
