"""The strangers' bench: scores follow from the answers, and options are checked."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.harness.criteria import criteria_table, share
from experiments.harness.errors import ExperimentError
from experiments.strangers_bench import run
from experiments.strangers_bench.criteria import criteria, metrics
from experiments.strangers_bench.run import COUNTS, Args, cases, conclude
from experiments.strangers_bench.scores import (
    NAMES,
    covered,
    exact_set,
    false_alarm,
    false_names,
    rejected,
    right_first,
    right_location,
    sure_and_wrong,
    true_names,
)
from experiments.strangers_bench.tables import effects_table, machines_table, wrong_table
from experiments.strangers_bench.trial import Case, trial
from hidden_plants.strangers.mechanisms import MECHANISMS, OUTSIDE
from reality_gap.causes import CATALOGUE

ROOT = Path(__file__).resolve().parents[3]
ELEMENTS = {"m_j1": ["j1"], "at_j1": ["j1"], "t1_1in": ["t1"]}


def effect(id: str, *elements: str, size: float | None = None) -> dict[str, Any]:
    return {"effect": id, "elements": list(elements), "size": size, "multiple": 5.0}


def cause(id: str, *elements: str, sure: float = 0.95, **more: Any) -> dict[str, Any]:
    return {
        "cause": id,
        "elements": list(elements),
        "confidence": sure,
        "equivalent": [],
        "parameters": {},
        **more,
    }


def made(
    kind: str, truth: list[dict[str, Any]], causes: list[dict[str, Any]], verdict: str = "named"
) -> dict[str, Any]:
    machine = {"kind": "servos", "joints": 2, "reach": 0.3, "rate": 50.0, "position_bits": 12}
    machine |= {"noise_stated": True, "tricky_defaults": False, "elements": ELEMENTS}
    return {
        "case": {"kind": kind, "seed": 1},
        "machine": machine,
        "truth": truth,
        "verdict": verdict,
        "reason": "",
        "causes": causes,
        "rms": [3.0, 1.0, 1.0],
        "core_seconds": 9.0,
        "memory": 300.0,
    }


def test_every_hidden_effect_has_a_name_in_the_catalogue() -> None:
    for id in set(MECHANISMS) - set(OUTSIDE):
        assert set(NAMES.get(id, (id,))) & set(CATALOGUE), id
    assert set(NAMES) <= set(MECHANISMS)


def test_a_declared_equivalent_counts_as_right_and_a_second_name_does_not() -> None:
    hidden = [effect("servo_kd", "m_j1")]
    right = made("single", hidden, [cause("viscous_friction", "j1", equivalent=["velocity_gain"])])
    assert right_first(right)
    assert exact_set(right)
    assert not false_names(right)
    more = made("single", hidden, [cause("velocity_gain", "m_j1"), cause("delay", "m_j1")])
    assert right_first(more)
    assert not exact_set(more)
    assert [c["cause"] for c in false_names(more)] == ["delay"]
    assert sure_and_wrong(more)


def test_a_name_below_the_threshold_is_not_sure() -> None:
    wrong = made("single", [effect("armature", "j1")], [cause("delay", "m_j1", sure=0.6)])
    assert not sure_and_wrong(wrong)
    assert not right_first(wrong)


def test_pairs_match_in_any_order_but_not_twice() -> None:
    hidden = [effect("armature", "j1"), effect("servo_kp", "m_j1")]
    both = [cause("position_gain", "m_j1"), cause("armature", "j1")]
    assert exact_set(made("pair", hidden, both))
    assert not exact_set(made("pair", hidden, [both[0], both[0]]))


def test_nothing_expresses_an_effect_outside_the_catalogue() -> None:
    hidden = [effect("cogging", "j1")]
    assert not true_names(made("outside", hidden, []), hidden[0])
    assert rejected(made("outside", hidden, [], "unexplained"))
    assert rejected(made("outside", hidden, [], "partly_named"))
    assert not rejected(made("outside", hidden, [], "nothing_wrong"))
    assert not rejected(made("outside", hidden, [cause("armature", "j1")], "partly_named"))


def test_a_gap_that_is_claimed_on_a_fault_free_log_is_a_false_alarm() -> None:
    assert false_alarm(made("null", [], [], "unexplained"))
    assert false_alarm(made("null", [], [cause("delay", "m_j1")], "partly_named"))
    assert not false_alarm(made("null", [], [], "nothing_wrong"))


def test_locations_are_compared_by_joint_and_tendon() -> None:
    hidden = [effect("reading_zero", "at_j1")]
    assert right_location(made("single", hidden, [cause("joint_offset", "j1")]))
    assert right_location(made("single", hidden, [cause("joint_offset", "j2")])) is False
    assert right_location(made("single", hidden, [cause("delay", "j1")])) is None


def test_intervals_are_compared_with_the_true_size() -> None:
    hidden = [effect("servo_kp", "m_j1", size=-0.4)]
    inside = cause("position_gain", "m_j1", parameters={"excess": [-0.39, -0.45, -0.33]})
    beside = cause("position_gain", "m_j1", parameters={"excess": [-0.3, -0.35, -0.25]})
    assert covered(made("single", hidden, [inside]))
    assert covered(made("single", hidden, [beside])) is False
    assert covered(made("single", [effect("slack", "t1")], [cause("slack", "t1")])) is None


def some_trials() -> list[dict[str, Any]]:
    trials = [
        made("single", [effect("servo_kp", "m_j1")], [cause("position_gain", "m_j1")]),
        made("single", [effect("armature", "j1")], [cause("delay", "m_j1")], "partly_named"),
        made("null", [], [], "nothing_wrong"),
        made("null", [], [cause("delay", "m_j1", sure=0.5)]),
        made("outside", [effect("cogging", "j1")], [], "unexplained"),
        made("pair", [effect("armature", "j1"), effect("slack", "t1")], []),
        {**made("null", [], [], "refused"), "rms": [None, None, None]},
    ]
    for seed, one in enumerate(trials):
        one["case"]["seed"] = seed
    return trials


def test_metrics_count_their_own_kind() -> None:
    found = metrics(criteria(some_trials()))
    assert found["right_first"]["value"] == 50.0
    assert found["right_first"]["reached"] is False
    assert found["right_first"]["must"] == "at least 90"
    assert found["false_alarms"]["value"] == pytest.approx(100 / 3)
    assert found["sure_and_wrong"]["value"] == pytest.approx(100 / 7)
    assert found["outside"]["reached"] is True
    assert found["pairs_exact"]["value"] == 0.0
    assert found["coverage"]["reached"] is None
    assert found["coverage"]["must"] == "at least 90 and at most 98"


def test_tables_list_wrong_answers() -> None:
    assert effects_table(some_trials()).rows[1][:4] == ("servo_kp", "single", 1, "1 of 1")
    assert machines_table(some_trials()).rows[0][:2] == ("kind: servos", 7)
    wrong = wrong_table(some_trials()).rows
    assert [row[0] for row in wrong] == [1, 3, 5, 6]
    assert wrong[0][4] == "FALSE delay at m_j1 (0.95)"


def test_cases_depend_on_their_own_seeds() -> None:
    many = cases(Args(trials=900, seed=50))
    assert many[5:9] == cases(Args(trials=4, seed=55))
    for kind, count in COUNTS.items():
        assert abs(np.mean([case.kind == kind for case in many]) - count / 450) < 0.05
    assert {case.kind for case in cases(Args(trials=5, kind="pair"))} == {"pair"}


def test_what_cannot_be_run_is_refused() -> None:
    for wrong in (
        Args(trials=0),
        Args(kind="triple"),
        Args(jobs=0),
        Args(seed=-1),
        Args(trials=10, seed=995),
    ):
        with pytest.raises(ExperimentError):
            run.main(wrong)
    with pytest.raises(ExperimentError, match=r"unknown effect 'rust'; valid are: coulomb"):
        trial(Case("single", 3, 3.0, "rust"))


def test_kept_trials_count_only_for_the_same_options() -> None:
    usual = run.digest(Args())
    assert usual == run.digest(Args(trials=7, seed=5, jobs=1))
    assert len({usual, run.digest(Args(kind="null")), run.digest(Args(seconds=8.0))}) == 3


def test_the_report_is_written_whole(tmp_path: Path) -> None:
    conclude(Args(out=tmp_path), some_trials(), 1.0, 2.0)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["name"] == "strangers-bench"
    assert set(summary["metrics"]["calibration_error"]) >= {"must", "value", "reached"}
    assert summary["kinds"] == {"single": 2, "pair": 1, "null": 3, "outside": 1}
    assert "Wrong answers" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_a_trial_is_run_and_can_be_resumed(tmp_path: Path) -> None:
    args = Args(trials=1, seed=3, kind="null", jobs=1, quick=True, out=tmp_path)
    first = run.main(args)
    saved = json.loads((tmp_path / "trials" / "trial_3.json").read_text())
    assert saved["result"]["machine"]["kind"] == "motors"
    assert run.main(args)["per_seed"] == first["per_seed"]


FEW = """
import importlib.util, sys
from importlib.abc import MetaPathFinder

class Absent(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.split(".")[0] in ("gymnasium", "cv2", "torch", "ray"):
            raise ModuleNotFoundError(name)

find_spec = importlib.util.find_spec
importlib.util.find_spec = lambda name: None if name == "gymnasium" else find_spec(name)
sys.meta_path.insert(0, Absent())
from experiments.__main__ import main
sys.exit(main(["strangers-bench", "--trials", "0"]))
"""


def test_the_bench_starts_without_the_libraries_of_robots_and_learning() -> None:
    done = subprocess.run([sys.executable, "-c", FEW], capture_output=True, text=True, cwd=ROOT)
    assert done.stderr.strip() == "Trials are 0, but at least 1 is needed."
    assert done.returncode == 2


def test_a_criterion_with_two_thresholds_shows_both() -> None:
    row = share("interval covers the truth", [True] * 19 + [False], least=90.0, most=98.0)
    assert row.must == "at least 90 and at most 98"
    assert row.must in criteria_table([row]).rows[0]
