"""Trials of the diagnosis: criteria follow from the counts, and options are checked."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.gap_bench import run
from experiments.gap_bench.criteria import musts
from experiments.gap_bench.figures import pictures
from experiments.gap_bench.run import SHARES, Args, cases, conclude
from experiments.gap_bench.tables import baselines_table, causes_table, confusion
from experiments.harness.criteria import Row, bins, expected_error, share, wilson
from experiments.harness.errors import ExperimentError
from tests.experiments.gap_bench.trials import FRICTION, make_trial


def test_a_run_without_single_effects_has_no_confusion_matrix() -> None:
    pair = (("delay", ["biceps"], {}), ("coulomb_friction", ["biceps"], {"force": 4.0}))
    trials = [make_trial("pair", pair, (FRICTION,))]

    assert [p.title for p in pictures(trials, {})] == ["Calibration of confidences"]


def test_wilson_stays_within_and_holds_the_share() -> None:
    for hits, count in ((0, 5), (5, 5), (3, 10)):
        low, high = wilson(hits, count)
        assert 0.0 <= low <= hits / count <= high <= 1.0
    assert wilson(0, 150)[0] == 0.0
    assert wilson(50, 100)[0] == pytest.approx(0.4038, abs=1e-4)


def test_a_must_is_reached_from_its_own_side() -> None:
    assert Row("", 1, 91.0, 0.0, 0.0, "%", least=90.0).reached is True
    assert Row("", 1, 91.0, 0.0, 0.0, "%", most=90.0).reached is False
    assert Row("", 1, 91.0, 0.0, 0.0, "%").reached is None
    assert share("", [None], least=90.0).reached is None
    assert share("", [True, False, None], least=50.0).value == pytest.approx(50.0)


def test_calibration_compares_within_bins() -> None:
    confidence, right = np.array([0.95, 0.95, 0.05, 1.0]), np.array([1.0, 1.0, 0.0, 0.0])
    np.testing.assert_array_equal(bins(confidence), [9, 9, 0, 9])
    assert expected_error(confidence, right) == pytest.approx((0.9 + 0.05) / 4)


def some_trials() -> list[dict[str, Any]]:
    cogging = (("cogging_motor", ["biceps"], {"force": 4.0}),)
    trials = [
        make_trial(named=(FRICTION,), gain=0.7, true_model={"rms": 1.0, "gain": 0.8}),
        make_trial(named=(("delay", ["biceps"], {"delay": 0.01}),)),
        make_trial("null", (), ()),
        make_trial("null", (), (FRICTION,)),
        make_trial("outside", cogging, verdict="unexplained"),
        make_trial("pair", (*cogging, *cogging), (FRICTION,)),
    ]
    for i, trial in enumerate(trials):
        trial["case"]["seed"] = i
    return trials


def test_first_names_are_counted_by_hidden_effect() -> None:
    assert confusion(some_trials()) == {
        "coulomb_friction": {"coulomb_friction": 1, "delay": 1},
        "(no fault)": {"coulomb_friction": 1, "nothing": 1},
        "cogging_motor": {"unexplained": 1},
    }


def test_musts_count_their_own_kind_only() -> None:
    rows = {row.name: row for row in musts(some_trials())}
    assert (rows["right cause first"].cases, rows["right cause first"].value) == (2, 50.0)
    alarms = rows["false alarms on fault-free logs"]
    assert (alarms.cases, alarms.value, alarms.reached) == (2, 50.0, False)
    assert rows["outside effects called unexplained"].value == 100.0
    assert rows["two causes, exact set"].value == 0.0
    assert rows["error: friction"].value == pytest.approx(25.0)
    assert rows["gain over that of the true model"].value == pytest.approx(87.5)


def test_a_doubt_that_an_experiment_ends_is_counted() -> None:
    torn = [[0, "delay", ["biceps"], 1.0, 0.5], [0, "actuator_lag", ["biceps"], 1.0, 0.5]]
    sure = [[0, "coulomb_friction", ["biceps"], 1.0, 1.0]]
    ended = make_trial(
        named=(FRICTION,),
        candidates=torn,
        followup=make_trial(named=(FRICTION,), candidates=sure),
    )
    lasting = make_trial(
        named=(FRICTION,),
        candidates=torn,
        followup=make_trial(named=(FRICTION,), candidates=torn),
    )
    hopeless, clear = (
        make_trial(named=(FRICTION,), candidates=torn),
        make_trial(named=(FRICTION,), candidates=sure),
    )
    rows = {row.name: row for row in musts([ended, lasting, hopeless, clear])}
    advised = rows["an experiment is advised where entropy > 0.1 nats"]
    assert (advised.cases, advised.value) == (3, pytest.approx(200 / 3))
    assert rows["entropy halved by the suggested experiment"].value == pytest.approx(50.0)


def test_a_baseline_is_cut_on_fault_free_logs() -> None:
    trials = [*some_trials(), make_trial("null", ())]
    scores = (0.5, 0.05, 0.1, 0.2, 0.05, 0.05, 0.0)
    for trial, score in zip(trials, scores, strict=True):
        named = {"cause": "coulomb_friction", "elements": ["biceps"], "score": score}
        trial["baselines"]["correlation"] = named
    table = baselines_table(trials)
    ours, theirs = table.rows
    assert ours[:4] == ("diagnosis", 7, "1 of 2", "2 of 2")
    assert theirs[:3] == ("largest correlation", 7, "1 of 2")
    assert theirs[4] == "1 of 3"
    assert causes_table(trials).rows[0][:3] == ("coulomb_friction", 2, "1 of 2")


def test_cases_depend_on_their_own_seeds() -> None:
    many = cases(Args(trials=400, seed=3))
    assert many[5:9] == cases(Args(trials=4, seed=8))
    for kind, expected in SHARES.items():
        got = np.mean([case.kind == kind for case in many])
        assert abs(got - expected) < 0.06
    assert {case.kind for case in cases(Args(trials=5, kind="null", family="tendon"))} == {"null"}


def test_kept_trials_count_only_for_the_same_options() -> None:
    usual = run.digest(Args())
    assert usual == run.digest(Args(trials=7, seed=5, jobs=1))
    for other in (
        Args(kind="null"),
        Args(family="tendon"),
        Args(seconds=10.0),
        Args(followup=True),
    ):
        assert run.digest(other) != usual


def test_what_cannot_be_run_is_refused() -> None:
    for wrong in (Args(trials=0), Args(kind="triple"), Args(jobs=0)):
        with pytest.raises(ExperimentError):
            run.main(wrong)


def test_the_report_is_written_whole(tmp_path: Path) -> None:
    conclude(Args(out=tmp_path), some_trials(), 1.0, 2.0)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["kinds"] == {"single": 2, "pair": 1, "null": 2, "outside": 1}
    assert summary["musts"]["right cause first"]["value"] == 50.0
    page = (tmp_path / "report.html").read_text()
    assert page.count("data:image/png") == 3


def test_only_the_doubt_about_a_single_effect_is_followed_up(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    given: list[tuple[str, bool]] = []

    def note(_: Any, tasks: dict[str, Any], *rest: Any) -> dict[str, Any]:
        given.extend((case.kind, followup) for case, followup, _ in tasks.values())
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "run_tasks", note)
    with pytest.raises(KeyboardInterrupt):
        run.main(Args(trials=40, followup=True, out=tmp_path))

    assert {kind for kind, _ in given} == set(SHARES)
    assert all(followup == (kind == "single") for kind, followup in given)
