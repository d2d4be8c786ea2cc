"""The bench of the diagnosis: what counts as right, and what follows from the counts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments import gap_bench
from experiments.errors import ExperimentError
from experiments.gap_bench import SHARES, Args, cases, conclude
from experiments.gap_bench_musts import Row, bins, expected_error, musts, share, wilson
from experiments.gap_bench_pictures import pictures
from experiments.gap_bench_scores import (
    added_mass_error,
    entropy,
    exact_set,
    gain_ratio,
    link_mass,
    parameter_error,
    right_first,
    right_or_equivalent,
    right_place,
    said,
)
from experiments.gap_bench_tables import baselines_table, causes_table, confusion

Named = tuple[str, list[str], dict[str, float]]


def made(
    kind: str = "single",
    hidden: tuple[Named, ...] = (("coulomb_friction", ["biceps"], {"force": 4.0}),),
    named: tuple[Named, ...] = (),
    verdict: str | None = None,
    **more: Any,
) -> dict[str, Any]:
    """A trial as it is kept, without running it."""
    told = [
        {
            "cause": cause,
            "where": where,
            "elsewhere": more.pop("elsewhere", []),
            "note": "",
            "parameters": {k: [v, v, v] for k, v in numbers.items()},
            "confidence": 0.9,
            "equivalent": more.pop("equivalent", []),
        }
        for cause, where, numbers in named
    ]
    trial = {
        "case": {"kind": kind, "seed": more.pop("seed", 1), "machine": "elbow"},
        "truth": [
            {"cause": cause, "where": where, "parameters": numbers, "amplitude": 1.0}
            for cause, where, numbers in hidden
        ],
        "verdict": verdict or ("named" if named else "nothing_wrong"),
        "causes": told,
        "rivals": [],
        "gain": None,
        "true_model": None,
        "length_error": None,
        "bend": None,
        "followup": None,
        "baselines": {
            "correlation": {"cause": "delay", "where": ["biceps"], "score": 0.1},
            "freed": None,
        },
        "seconds": 20.0,
    }
    return trial | more


FRICTION: Named = ("coulomb_friction", ["biceps"], {"friction": 5.0})


def test_the_first_name_counts() -> None:
    assert right_first(made(named=(FRICTION,)))
    other = ("viscous_friction", ["biceps"], {"damping": 5.0})
    assert not right_first(made(named=(other, FRICTION)))
    assert said(made()) == "nothing"
    assert said(made(verdict="unexplained")) == "unexplained"


def test_a_declared_equivalent_is_counted_apart() -> None:
    other: Named = ("viscous_friction", ["biceps"], {"damping": 5.0})
    trial = made(named=(other,), equivalent=["coulomb_friction"])
    assert not right_first(trial)
    assert right_or_equivalent(trial)
    assert not right_or_equivalent(made(named=(other,)))


@pytest.mark.parametrize(
    ("cause", "hidden", "named", "right"),
    [
        ("attachment_shift", ["biceps_0"], ["biceps_2"], True),
        ("attachment_shift", ["biceps_0"], ["triceps_0"], False),
        ("tension_scale", ["biceps"], ["tension_biceps"], True),
        ("coulomb_friction", ["biceps"], ["biceps", "brachialis", "triceps"], False),
        ("payload", ["hand"], ["radius"], True),
        ("delay", ["tension_biceps"], ["biceps"], False),
        ("delay", ["biceps"], ["biceps"], True),
        ("gravity_direction", [], ["gravity"], None),
    ],
)
def test_a_place_is_right_if_it_is_the_same_muscle_joint_link_or_sensor(
    cause: str, hidden: list[str], named: list[str], right: bool | None
) -> None:
    trial = made(hidden=((cause, hidden, {}),), named=((cause, named, {}),))
    assert right_place(trial) is right


def test_a_place_elsewhere_counts_only_where_it_is_asked_for() -> None:
    wrong = ("coulomb_friction", ["triceps"], {"friction": 5.0})
    trial = made(named=(wrong,), elsewhere=[["biceps"]])
    assert right_place(trial) is False
    assert right_place(trial, elsewhere=True) is True


def test_of_two_causes_both_must_be_named_and_no_third() -> None:
    delay: Named = ("delay", ["biceps"], {"delay": 0.01})
    pair = (("coulomb_friction", ["biceps"], {}), ("delay", ["biceps"], {}))
    assert exact_set(made("pair", pair, (delay, FRICTION)))
    assert not exact_set(made("pair", pair, (FRICTION,)))
    assert not exact_set(made("pair", pair, (FRICTION, FRICTION)))
    lag: Named = ("actuator_lag", ["biceps"], {})
    assert not exact_set(made("pair", pair, (FRICTION, delay, lag)))
    almost = made("pair", pair, (lag, FRICTION), equivalent=["delay"])
    assert not exact_set(almost)
    assert exact_set(almost, equivalents=True)


def test_errors_are_in_the_unit_of_their_family() -> None:
    assert parameter_error(made(named=(FRICTION,))) == ("friction", pytest.approx(25.0))
    late = (("delay", ["biceps"], {"delay": 0.01}),)
    found = parameter_error(made(hidden=late, named=(("delay", ["biceps"], {"delay": 0.03}),)))
    assert found == ("delay", pytest.approx(1.0))
    soft = (("tendon_elasticity", ["biceps"], {"compliance": 2e-6, "stiffness": 5e5}),)
    told: Named = ("tendon_elasticity", ["biceps"], {"compliance": 1e-6})
    assert parameter_error(made(hidden=soft, named=(told,))) == ("stiffness", pytest.approx(100.0))
    uneven = (("direction_dependent_friction", ["biceps"], {"force_out": 8.0, "force_in": 2.0}),)
    told = ("direction_dependent_friction", ["biceps"], {"forward": 9.0, "backward": 1.0})
    assert parameter_error(made(hidden=uneven, named=(told,))) == ("friction", pytest.approx(20.0))


def test_friction_around_bends_is_compared_as_a_share_of_the_tension() -> None:
    hidden = (("load_dependent_friction", ["biceps"], {"share": 0.02}),)
    named = (("load_dependent_friction", ["biceps"], {"coefficient": 0.055}),)
    assert parameter_error(made(hidden=hidden, named=named)) == ("friction", pytest.approx(175.0))
    found = parameter_error(made(hidden=hidden, named=named, bend=0.4))
    assert found == ("friction", pytest.approx(10.0))


def test_a_run_without_lone_effects_has_no_picture_of_them() -> None:
    pair = (("delay", ["biceps"], {}), ("coulomb_friction", ["biceps"], {"force": 4.0}))
    trials = [made("pair", pair, (FRICTION,))]

    assert [p.title for p in pictures(trials, {})] == ["How sure, and how right"]


def test_a_mass_is_compared_with_the_whole_link() -> None:
    heavy = (("link_mass", ["ulna"], {"mass": 0.1}),)
    trial = made(hidden=heavy, named=(("link_mass", ["ulna"], {"mass": 0.11}),))
    found = parameter_error(trial)
    assert found == ("mass", pytest.approx(1.0 / (link_mass(trial) + 0.1)))
    assert added_mass_error(trial) == pytest.approx(10.0)


def test_numbers_of_wrong_names_and_places_are_not_compared() -> None:
    other: Named = ("viscous_friction", ["biceps"], {"damping": 5.0})
    assert parameter_error(made(named=(other,))) is None
    elsewhere: Named = ("coulomb_friction", ["triceps"], {"friction": 5.0})
    assert parameter_error(made(named=(elsewhere,))) is None


def test_entropy_is_that_of_the_least_certain_place() -> None:
    sure = [[0, "delay", ["biceps"], 1.0, 1.0]]
    torn = [[1, "delay", ["biceps"], 1.0, 0.5], [1, "actuator_lag", ["biceps"], 1.0, 0.5]]
    assert entropy(made(rivals=sure)) == pytest.approx(0.0)
    assert entropy(made(rivals=sure + torn)) == pytest.approx(np.log(2))
    assert entropy(made()) is None


def test_gains_are_over_that_of_the_true_model() -> None:
    assert gain_ratio(made(gain=0.4, true_model={"rms": 1.0, "gain": 0.8})) == pytest.approx(0.5)
    assert gain_ratio(made(gain=None, true_model={"rms": 1.0, "gain": 0.8})) is None
    assert gain_ratio(made(gain=0.4, true_model={"rms": 1.0, "gain": None})) is None
    assert gain_ratio(made(gain=0.4, true_model={"rms": 1.0, "gain": 0.01})) is None


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
    told, right = np.array([0.95, 0.95, 0.05, 1.0]), np.array([1.0, 1.0, 0.0, 0.0])
    np.testing.assert_array_equal(bins(told), [9, 9, 0, 9])
    assert expected_error(told, right) == pytest.approx((0.9 + 0.05) / 4)


def some_trials() -> list[dict[str, Any]]:
    cogging = (("cogging_motor", ["biceps"], {"force": 4.0}),)
    trials = [
        made(named=(FRICTION,), gain=0.7, true_model={"rms": 1.0, "gain": 0.8}),
        made(named=(("delay", ["biceps"], {"delay": 0.01}),)),
        made("null", (), ()),
        made("null", (), (FRICTION,)),
        made("outside", cogging, verdict="unexplained"),
        made("pair", (*cogging, *cogging), (FRICTION,)),
    ]
    for i, trial in enumerate(trials):
        trial["case"]["seed"] = i
    return trials


def test_who_is_taken_for_whom() -> None:
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
    assert rows["outside called unexplained"].value == 100.0
    assert rows["two causes, exact set"].value == 0.0
    assert rows["error: friction"].value == pytest.approx(25.0)
    assert rows["gain over that of the true model"].value == pytest.approx(87.5)


def test_a_doubt_that_an_experiment_ends_is_counted() -> None:
    torn = [[0, "delay", ["biceps"], 1.0, 0.5], [0, "actuator_lag", ["biceps"], 1.0, 0.5]]
    sure = [[0, "coulomb_friction", ["biceps"], 1.0, 1.0]]
    ended = made(named=(FRICTION,), rivals=torn, followup=made(named=(FRICTION,), rivals=sure))
    lasting = made(named=(FRICTION,), rivals=torn, followup=made(named=(FRICTION,), rivals=torn))
    hopeless, clear = made(named=(FRICTION,), rivals=torn), made(named=(FRICTION,), rivals=sure)
    rows = {row.name: row for row in musts([ended, lasting, hopeless, clear])}
    advised = rows["an experiment is advised where entropy > 0.1 nats"]
    assert (advised.cases, advised.value) == (3, pytest.approx(200 / 3))
    assert rows["entropy halved by the suggested experiment"].value == pytest.approx(50.0)


def test_a_baseline_is_cut_on_fault_free_logs() -> None:
    trials = [*some_trials(), made("null", ())]
    scores = (0.5, 0.05, 0.1, 0.2, 0.05, 0.05, 0.0)
    for trial, score in zip(trials, scores, strict=True):
        named = {"cause": "coulomb_friction", "where": ["biceps"], "score": score}
        trial["baselines"]["correlation"] = named
    table = baselines_table(trials)
    ours, theirs = table.rows
    assert ours[:4] == ("diagnosis", 7, "1 of 2", "2 of 2")
    assert theirs[:3] == ("largest correlation", 7, "1 of 2")
    assert theirs[4] == "1 of 3"
    assert causes_table(trials).rows[0][:3] == ("coulomb_friction", 2, "1 of 2")


def test_trials_are_drawn_by_their_own_seeds() -> None:
    many = cases(Args(trials=400, seed=3))
    assert many[5:9] == cases(Args(trials=4, seed=8))
    for kind, expected in SHARES.items():
        got = np.mean([case.kind == kind for case in many])
        assert abs(got - expected) < 0.06
    assert {case.kind for case in cases(Args(trials=5, kind="null", family="wire"))} == {"null"}


def test_kept_trials_count_only_for_the_same_options() -> None:
    usual = gap_bench.digest(Args())
    assert usual == gap_bench.digest(Args(trials=7, seed=5, jobs=1))
    for other in (Args(kind="null"), Args(family="wire"), Args(seconds=10.0), Args(followup=True)):
        assert gap_bench.digest(other) != usual


def test_what_cannot_be_run_is_refused() -> None:
    for wrong in (Args(trials=0), Args(kind="triple"), Args(jobs=0)):
        with pytest.raises(ExperimentError):
            gap_bench.main(wrong)


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

    monkeypatch.setattr(gap_bench, "run_tasks", note)
    with pytest.raises(KeyboardInterrupt):
        gap_bench.main(Args(trials=40, followup=True, out=tmp_path))

    assert {kind for kind, _ in given} == set(SHARES)
    assert all(followup == (kind == "single") for kind, followup in given)
