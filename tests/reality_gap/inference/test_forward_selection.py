"""Forward selection, on a machine at rest whose sensor has the errors of candidates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reality_gap.inference.confidence import TEMPER
from reality_gap.inference.equivalence import alternatives
from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.forward_selection import Settings
from reality_gap.inference.gauss_newton import Fit, Stepwise, fit_stepwise, null_fit, rescore
from reality_gap.inference.held_out import selection_score
from reality_gap.inference.problem import Problem
from reality_gap.inference.ranking import rank, rank_by_remainder
from reality_gap.inference.refinement import PROMISE, fit_next
from reality_gap.study.splits import FIT, SELECT, split
from tests.reality_gap.inference.imperfect_models import (
    SHAPES,
    TIME,
    Case,
    candidate,
    crowd,
    formed,
    ids,
    log_ratio,
    size_of,
)


def test_noise_has_no_causes(tmp_path: Path) -> None:
    case = Case(tmp_path, np.zeros(len(TIME)), crowd(6))

    found = case.search()

    assert found.best.is_null
    assert [step.accepted for step in found.steps] == [False]


def test_only_the_planted_causes_are_found(tmp_path: Path) -> None:
    case = Case(tmp_path, 1.0 * SHAPES[:, 4] - 0.6 * SHAPES[:, 2], crowd(6))

    found = case.search()

    assert [step.accepted for step in found.steps] == [True, True]
    assert ids(found.best) == ["c", "e"]
    assert size_of(found.best, "e") == pytest.approx(1.0, abs=0.15)
    assert size_of(found.best, "c") == pytest.approx(-0.6, abs=0.15)


def test_a_cause_whose_full_fit_is_below_the_threshold_is_not_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = Case(tmp_path, 1.0 * SHAPES[:, 4], crowd(6))
    assert ids(case.search().best) == ["e"]

    def costlier(*args: Any) -> Stepwise[Fit]:
        return replace((yield from fit_stepwise(*args)), evidence=4.0)

    monkeypatch.setattr("reality_gap.inference.forward_selection.fit_stepwise", costlier)
    found = case.search()

    assert found.best.is_null
    assert [step.accepted for step in found.steps] == [False]


def test_candidates_close_to_the_best_are_fitted_fully(tmp_path: Path) -> None:
    simple = candidate("simple", SHAPES[:, 0] + 0.05 * SHAPES[:, 1])
    case = Case(tmp_path, 2.0 * (SHAPES[:, 0] + 0.15 * SHAPES[:, 1]), [simple, formed(0.0)])
    assert [ids(quick) for quick in case.next()] == [["simple"], ["formed"]]

    first = case.search().steps[0]

    assert [ids(fitted_candidate) for fitted_candidate in first.tried] == [["formed"], ["simple"]]
    assert first.tried[0].hypothesis[0][1]["form"] == pytest.approx(0.15, abs=0.05)


@pytest.mark.parametrize(
    ("tolerated", "share", "found"), [(3.0, 0.005, ["a"]), (60.0, 0.005, []), (60.0, 0.0, ["a"])]
)
def test_a_cause_must_explain_more_than_what_is_not_linear_in_tolerances(
    tmp_path: Path, tolerated: float, share: float, found: list[str]
) -> None:
    """Half a percent of 60 noises is the size of the cause's effect."""
    case = Case(tmp_path, tolerated * SHAPES[:, 5] + 0.3 * SHAPES[:, 0], crowd(3))
    case.problem = case.problem_with(80.0 * SHAPES[:, 5:])

    assert ids(case.search(Settings(nonlinear=share)).best) == found


@pytest.mark.parametrize(
    ("tolerance", "more", "found"),
    [(0.0, 0.0, ["plain"]), (0.3, 0.0, ["plain"]), (0.5, 0.0, []), (0.5, 0.9, ["sibling"])],
)
def test_a_cause_must_explain_more_than_a_deviation_that_is_no_fault(
    tmp_path: Path, tolerance: float, more: float, found: list[str]
) -> None:
    """The sensor has 0.9 of an error; up to two tolerances are no fault."""
    plain, sibling = (
        candidate("plain", SHAPES[:, 0]),
        candidate("sibling", SHAPES[:, :2] @ (1, 0.1)),
    )
    plain = replace(plain, parameters=(replace(plain.parameters[0], tolerance=tolerance),))
    if more:
        sibling = candidate("sibling", SHAPES[:, 0] + SHAPES[:, 1])
    case = Case(tmp_path, 0.9 * SHAPES[:, 0] + more * SHAPES[:, 1], [plain, sibling])

    assert ids(case.search().best) == found


def test_a_cause_that_makes_an_earlier_one_needless_is_a_cause(tmp_path: Path) -> None:
    """The first cause is half of both; beside one of these its deviation is no fault."""
    b, c = SHAPES[:, 0], SHAPES[:, 1]
    mean = candidate("mean", (b + c) / np.sqrt(2.0))
    mean = replace(mean, parameters=(replace(mean.parameters[0], tolerance=0.7),))
    case = Case(tmp_path, 1.6 * b + 0.9 * c, [mean, candidate("b", b), candidate("c", c)])

    found = case.search()

    assert ids(found.steps[0].tried[0]) == ["mean"]
    assert len(found.best.hypothesis) == 2
    assert found.best.evidence > found.steps[0].tried[0].evidence + 50.0


def test_a_cause_is_as_sure_as_it_explains_more_than_a_deviation_that_is_no_fault(
    tmp_path: Path,
) -> None:
    plain, sibling = (
        candidate("plain", SHAPES[:, 0]),
        candidate("sibling", SHAPES[:, :2] @ (1, 0.2)),
    )
    plain = replace(plain, parameters=(replace(plain.parameters[0], tolerance=0.5),))
    case = Case(tmp_path, 0.9 * SHAPES[:, 0] + 0.18 * SHAPES[:, 1], [plain, sibling])

    found = case.search()
    [named] = alternatives(found, Settings())

    gain = found.steps[0].gain
    assert ids(found.best) == ["sibling"]
    assert 7.0 < gain < 12.0
    assert named.right == pytest.approx(1.0 / (1.0 + np.exp(-gain / TEMPER)), abs=0.002)
    assert named.right < 0.98


def test_the_number_of_causes_is_limited(tmp_path: Path) -> None:
    case = Case(tmp_path, SHAPES[:, 4] - 0.6 * SHAPES[:, 2], crowd(6))

    found = case.search(Settings(most=1))

    assert ids(found.best) == ["e"]
    assert len(found.steps) == 1


@pytest.mark.parametrize(("seconds", "longer"), [(1.0, 1.0), (20.0, 1.0), (80.0, 4.0)])
def test_the_evidence_that_a_further_cause_needs_grows_with_the_log(
    seconds: float, longer: float
) -> None:
    usual = Settings()
    assert usual.for_log(seconds) == replace(usual, further=usual.further * longer)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (Settings(), ["a"]),
        (Settings(root=0.0), ["a", "b"]),
        (Settings(root=0.0, further=1000.0), ["a"]),
        (Settings(threshold=1e6), []),
    ],
)
def test_a_cause_that_adds_little_to_much_evidence_is_not_accepted(
    tmp_path: Path, settings: Settings, expected: list[str]
) -> None:
    """With 600 readings the causes explain 600 * 5^2 / 2 and 600 * 0.3^2 / 2 nats."""
    case = Case(tmp_path, 5.0 * SHAPES[:, 0] + 0.3 * SHAPES[:, 1], crowd(2))

    assert ids(case.search(settings).best) == expected


@pytest.mark.parametrize(("left", "far"), [(0.0, False), (30.0, True)])
def test_a_linearisation_handicaps_the_first_cause_in_the_currency_of_its_evidence(
    tmp_path: Path, left: float, far: bool
) -> None:
    """Where much is left, evidence of an unknown variance is compared, which is much smaller."""
    case = Case(tmp_path, 60.0 * SHAPES[:, 0] + left * SHAPES[:, 5], crowd(2))
    other, own = ((0.0, 1e9), (1e9, 0.0)) if far else ((1e9, 0.0), (0.0, 1e9))

    case.problem = replace(case.problem, handicaps=own)
    found = case.search()
    case.problem = replace(case.problem, handicaps=other)
    none = case.search()

    assert found.problem.noise_model.is_far is far
    assert ids(found.best) == ["a"]
    assert ids(none.best) == []


def test_a_second_cause_with_an_autocorrelated_effect_is_found(tmp_path: Path) -> None:
    """Without it the remainder is autocorrelated, so that its readings count for very little."""
    slow = np.sqrt(0.2) * np.sin(0.5 * np.pi * TIME)
    chosen = [*crowd(2), candidate("slow", slow)]
    case = Case(tmp_path, 1.5 * SHAPES[:, 0] + slow, chosen)
    alone = case.fit(chosen[0])
    without = case.problem.inflated(alone.residual)
    assert rank(without, case.sensitivities, alone)[0].evidence < PROMISE

    found = case.search()

    assert ids(found.best) == ["a", "slow"]


def test_where_a_model_is_far_off_a_size_that_a_prior_holds_back_is_tried(tmp_path: Path) -> None:
    """Few of the readings of a slow error count, and a prior holds 60 scales back to one."""
    slow = np.sin(0.5 * np.pi * TIME)
    case = Case(tmp_path, 60.0 * slow, [candidate("slow", slow)])
    problem = case.problem.inflated(case.problem.null_residual)
    assert problem.noise_model.is_far
    [held] = rank(problem, case.sensitivities, null_fit(problem))
    assert held.evidence < 0.0
    assert held.theta[0] < 2.0

    [free] = rank_by_remainder(problem, case.sensitivities, null_fit(problem))
    assert free.evidence > 10.0
    assert free.theta[0] == pytest.approx(60.0, rel=0.02)

    tiny = [candidate(f"tiny_{i}", 0.01 * SHAPES[:, i % 6]) for i in range(12)]
    crowded = Case(tmp_path, 60.0 * slow, [*tiny, candidate("slow", slow)])
    tried = fit_next(problem, crowded.sensitivities, null_fit(problem), 8)
    assert ["slow"] in [ids(one) for one in tried]


def test_a_cause_that_the_others_make_unnecessary_is_dropped(tmp_path: Path) -> None:
    """A mixture explains most alone, and nothing beside the two causes that it is mixed of."""
    b, c, mixed = SHAPES[:, 1], SHAPES[:, 2], SHAPES[:, 1] + SHAPES[:, 2] + 0.9 * SHAPES[:, 3]
    chosen = [candidate("b", b), candidate("c", c), candidate("mixture", mixed)]
    case = Case(tmp_path, 2.0 * (b + c), chosen)

    found = case.search()

    assert ids(found.steps[0].tried[0]) == ["mixture"]
    assert [step.accepted for step in found.steps] == [True, True, True]
    assert ids(found.best) == ["b", "c"]


def test_a_likelier_candidate_replaces_an_earlier_cause(tmp_path: Path) -> None:
    """The mixture explains most alone; beside one of its two causes, the other explains more."""
    b, c, mixed = SHAPES[:, 1], SHAPES[:, 2], SHAPES[:, 1] + SHAPES[:, 2] + 0.9 * SHAPES[:, 3]
    chosen = [candidate("b", b), candidate("c", c), candidate("mixture", mixed)]
    case = Case(tmp_path, 2.0 * (b + c), chosen)

    found = case.search(Settings(most=2))

    assert ids(found.steps[0].tried[0]) == ["mixture"]
    assert found.revised[0].accepted
    assert ids(found.best) == ["b", "c"]


@pytest.mark.parametrize(
    ("more", "where", "expected"),
    [(0.07, "rail", "special"), (0.4, "rail", "general"), (0.07, "cart", "general")],
)
def test_a_general_cause_must_add_to_its_special_case_what_a_further_one_must(
    tmp_path: Path, more: float, where: str, expected: str
) -> None:
    """Where neither has exactly the right form, the general one is always a little better."""
    form = SHAPES[:, 0] + more * SHAPES[:, 1]
    special, general = candidate("special", SHAPES[:, 0]), candidate("general", form, where)
    general = replace(general, cause=replace(general.cause, includes=("special",)))
    case = Case(tmp_path, 2.0 * form, [special, general])

    found = case.search()
    [named] = alternatives(found, Settings())

    assert ids(found.best) == [expected]
    assert found.steps[0].tried[0].evidence > 1000.0
    assert named.right > 0.8


@pytest.mark.parametrize(("wrong", "expected"), [(0.05, "special"), (0.0, "general")])
def test_far_away_a_general_cause_does_not_win_by_what_tolerances_explain(
    tmp_path: Path, wrong: float, expected: str
) -> None:
    """Without tolerances it explains three times as many noises as its special case."""
    deviation, other = SHAPES[:, 1], SHAPES[:, 2]
    form = SHAPES[:, 0] + 0.5 * deviation + wrong * SHAPES[:, 3]
    special, general = candidate("special", SHAPES[:, 0]), candidate("general", form)
    general = replace(general, cause=replace(general.cause, includes=("special",)))
    case = Case(tmp_path, 60.0 * SHAPES[:, 0] + 30.0 * deviation + 10.0 * other, [special, general])
    case.problem = case.problem_with(20.0 * deviation[:, None])

    found = case.search(Settings(most=1))

    assert found.problem.noise_model.is_far
    assert ids(found.steps[0].tried[0]) == [expected]


@pytest.mark.parametrize(
    ("likeness", "expected"), [(1.0, ["twin"]), (0.999, ["twin"]), (0.9, []), (0.0, [])]
)
def test_a_candidate_with_nearly_the_same_effect_is_equivalent(
    tmp_path: Path, likeness: float, expected: list[str]
) -> None:
    """A twin that differs by 0.1 % explains 0.2 nats less than the truth, which explains 200."""
    other = likeness * SHAPES[:, 0] + np.sqrt(1 - likeness**2) * SHAPES[:, 1]
    chosen = [candidate("truth", 0.99 * SHAPES[:, 0]), candidate("twin", other)]
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], chosen)

    [named] = alternatives(case.search(), Settings())

    assert named.confidence[0] >= 0.5
    assert {named.candidate.cause.id, *(s.cause.id for s in named.equivalent)} >= {"truth"}
    others = {"truth", "twin"} - {named.candidate.cause.id}
    assert sorted(s.cause.id for s in named.equivalent) == sorted(others if expected else [])


def test_an_alternative_is_fitted_beside_the_other_causes_as_they_are(tmp_path: Path) -> None:
    """Alone, the other cause may be far from what it is, and a fit beside it may not converge."""
    truth, other, twin = (
        candidate("truth", SHAPES[:, 0]),
        candidate("other", SHAPES[:, 1]),
        candidate("twin", 0.99 * SHAPES[:, 0]),
    )
    case = Case(tmp_path, 0.9 * SHAPES[:, 0] + 2.0 * SHAPES[:, 1], [truth, other])
    found = case.search()
    assert ids(found.best) == ["other", "truth"]
    alone = case.fit(other)
    wrong = [(other, {"size": 1.7}), (twin, {"size": 0.9})]
    residual = case.replayer.residual(wrong)
    unfinished = replace(case.fit(other, twin), hypothesis=wrong, residual=residual)
    unfinished = rescore(found.problem, unfinished)
    assert 20.0 < found.best.evidence - unfinished.evidence < 50.0
    step = replace(found.steps[1], base=alone, tried=(unfinished,))
    found = replace(found, steps=(found.steps[0], step))

    named = {one.candidate.cause.id: one for one in alternatives(found, Settings())}["truth"]

    assert [one.cause.id for one in named.equivalent] == ["twin"]


def test_the_own_evidence_of_a_cause_is_what_the_others_cannot_explain(tmp_path: Path) -> None:
    chosen = [candidate("weak", SHAPES[:, 0]), candidate("strong", SHAPES[:, 1])]
    case = Case(tmp_path, 0.5 * SHAPES[:, 0] + 2.0 * SHAPES[:, 1], chosen)
    found = case.search()

    named = {a.candidate.cause.id: a.own for a in alternatives(found, Settings())}

    alone = {one.cause.id: rescore(found.problem, case.fit(one)).evidence for one in chosen}
    assert named["weak"] == pytest.approx(found.best.evidence - alone["strong"], abs=0.5)
    assert named["strong"] == pytest.approx(found.best.evidence - alone["weak"], abs=0.5)
    assert named["strong"] > 5 * named["weak"]


def test_a_likely_candidate_with_other_predictions_is_not_equivalent(tmp_path: Path) -> None:
    """Two candidates that differ in the report split are equally likely, but not equivalent."""
    elsewhere = SHAPES[:, 0].copy()
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], [])
    elsewhere[~case.learned] = 50.0
    chosen = [candidate("truth", SHAPES[:, 0]), candidate("wild", elsewhere)]
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], chosen)

    [named] = alternatives(case.search(), Settings())

    assert named.confidence.min() > 0.3
    assert named.equivalent == ()


@pytest.mark.usefixtures("one_size")
@pytest.mark.parametrize("inflation", [1.0, 4.0])
def test_the_same_fit_by_a_noise_model_whose_readings_count_less(
    tmp_path: Path, inflation: float
) -> None:
    case = Case(tmp_path, SHAPES[:, 0], crowd(1))
    fitted, here = case.next()[0], case.learned
    weight = np.full(len(TIME), 1.0)[here] / np.sqrt(inflation)
    inflated = replace(case.problem.noise_model, inflation=np.full(len(TIME), inflation))

    found = rescore(replace(case.problem, noise_model=inflated), fitted)

    # Theta is that of the first noise model, which differs little with 600 readings.
    expected = log_ratio(case.null[here] * weight, SHAPES[here, :1] * weight[:, None])
    assert found.evidence == pytest.approx(expected, abs=0.01)
    assert found.hypothesis == fitted.hypothesis


def test_readings_of_an_autocorrelated_channel_count_less(tmp_path: Path) -> None:
    """n readings of an AR(1) process count as n (1 - rho) / (1 + rho)."""
    case = Case(tmp_path, np.zeros(len(TIME)), [])
    red = np.zeros(len(TIME))
    for k in range(1, len(TIME)):
        red[k] = 0.6 * red[k - 1] + SHAPES[k, 0]

    red *= 0.8  # its variance is 1, as that of the noise

    def power(problem: Problem) -> float:
        return float(np.sum(problem.noise_model.whiten(case.null) ** 2))

    full = power(case.problem)
    assert full == pytest.approx(np.sum(case.null[case.learned] ** 2))
    assert power(case.problem.inflated(red)) == pytest.approx(full * 0.4 / 1.6, rel=0.3)
    assert power(case.problem.inflated(9.0 * red)) == pytest.approx(full * 0.25 / 81.0, rel=0.3)


@pytest.mark.parametrize("size", [0.0, 0.5])
def test_the_selection_score_is_that_of_a_fit_to_the_fit_split(tmp_path: Path, size: float) -> None:
    case = Case(tmp_path, size * SHAPES[:, 0], crowd(1))
    role = split(case.replayer.measured)
    at, out = role == FIT, role == SELECT
    column = SHAPES[:, 0]

    found = selection_score(case.problem, case.fit(*crowd(1)))

    theta = column[at] @ case.null[at] / (column[at] @ column[at] + 1 / PRIOR**2)
    left = case.null - theta * column
    expected = 0.5 * np.sum(case.null[out] ** 2 - left[out] ** 2)
    assert found == pytest.approx(expected, abs=0.01)
    assert (found > 5.0) == (size > 0)


def test_one_cause_replaces_two_that_make_up_for_it(tmp_path: Path) -> None:
    """Nearly the right cause also explains a part of another one, and comes first.

    Beside that other one it is wrong, and a third one would make up for the difference. Beside the
    right one, the third one is within its tolerance.
    """
    usual = candidate("right", SHAPES[:, 0])
    right = replace(usual, cause=replace(usual.cause, prior=lambda location: -3.0))
    nearly = candidate("nearly", SHAPES[:, 0] + 0.25 * SHAPES[:, 1])
    other = candidate("other", SHAPES[:, 2] + 0.25 * SHAPES[:, 1])
    plain = candidate("third", SHAPES[:, 1])
    third = replace(plain, parameters=(replace(plain.parameters[0], tolerance=0.1),))
    error = SHAPES[:, 0] + 0.6 * (SHAPES[:, 2] + 0.25 * SHAPES[:, 1])
    case = Case(tmp_path, error, [right, nearly, other, third])

    found = case.search()

    assert ids(found.steps[0].tried[0])[0] == "nearly"
    assert [step.accepted for step in found.steps] == [True, True, True]
    assert sorted(ids(found.best)) == ["other", "right"]
