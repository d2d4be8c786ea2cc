"""Forward selection on a machine that stands still, whose sensor errs as causes say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reality_gap.inference.equivalence import alternatives
from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.forward_selection import Settings
from reality_gap.inference.gauss_newton import Asking, Fit, fitting
from reality_gap.inference.likelihood import predictive
from reality_gap.inference.ranking import rank
from reality_gap.inference.refinement import PROMISE, again
from reality_gap.study.splits import CHOOSE, FIT, split
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


def test_of_noise_nothing_is_found(tmp_path: Path) -> None:
    case = Case(tmp_path, np.zeros(len(TIME)), crowd(6))

    found = case.search()

    assert found.best is None
    assert [step.accepted for step in found.steps] == [False]


def test_what_was_planted_is_found_and_nothing_else(tmp_path: Path) -> None:
    case = Case(tmp_path, 1.0 * SHAPES[:, 4] - 0.6 * SHAPES[:, 2], crowd(6))

    found = case.search()

    assert [step.accepted for step in found.steps] == [True, True]
    assert ids(found.best) == ["c", "e"]
    assert found.best is not None
    assert size_of(found.best, "e") == pytest.approx(1.0, abs=0.15)
    assert size_of(found.best, "c") == pytest.approx(-0.6, abs=0.15)


def test_a_cause_that_the_full_fit_prices_below_the_threshold_is_not_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = Case(tmp_path, 1.0 * SHAPES[:, 4], crowd(6))
    assert ids(case.search().best) == ["e"]

    def dearer(*args: Any) -> Asking[Fit]:
        return replace((yield from fitting(*args)), evidence=4.0)

    monkeypatch.setattr("reality_gap.inference.forward_selection.fitting", dearer)
    found = case.search()

    assert found.best is None
    assert [step.accepted for step in found.steps] == [False]


def test_who_is_close_to_the_best_is_fitted_as_fully(tmp_path: Path) -> None:
    simple = candidate("simple", SHAPES[:, 0] + 0.05 * SHAPES[:, 1])
    case = Case(tmp_path, 2.0 * (SHAPES[:, 0] + 0.15 * SHAPES[:, 1]), [simple, formed(0.0)])
    assert [ids(quick) for quick in case.next()] == [["simple"], ["formed"]]

    first = case.search().steps[0]

    assert [ids(fitted_candidate) for fitted_candidate in first.tried] == [["formed"], ["simple"]]
    assert first.tried[0].hypothesis[0][1]["form"] == pytest.approx(0.15, abs=0.05)


def test_no_more_causes_than_the_most(tmp_path: Path) -> None:
    case = Case(tmp_path, SHAPES[:, 4] - 0.6 * SHAPES[:, 2], crowd(6))

    found = case.search(Settings(most=1))

    assert ids(found.best) == ["e"]
    assert len(found.steps) == 1


@pytest.mark.parametrize(("seconds", "longer"), [(1.0, 1.0), (20.0, 1.0), (80.0, 4.0)])
def test_what_a_further_cause_needs_grows_with_a_log_that_is_long(
    seconds: float, longer: float
) -> None:
    usual = Settings()
    assert usual.for_log(seconds) == replace(usual, further=7.0 * longer)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (Settings(), ["a"]),
        (Settings(root=0.0), ["a", "b"]),
        (Settings(root=0.0, further=1000.0), ["a"]),
        (Settings(threshold=1e6), []),
    ],
)
def test_what_adds_little_to_much_is_not_accepted(
    tmp_path: Path, settings: Settings, expected: list[str]
) -> None:
    """600 readings: the first explains 600 * 5^2 / 2 nats, the second 600 * 0.3^2 / 2."""
    case = Case(tmp_path, 5.0 * SHAPES[:, 0] + 0.3 * SHAPES[:, 1], crowd(2))

    assert ids(case.search(settings).best) == expected


def test_a_second_cause_does_not_hide_itself_by_wandering(tmp_path: Path) -> None:
    """Without it the remainder wanders, and its readings count for next to nothing."""
    slow = np.sqrt(0.2) * np.sin(0.5 * np.pi * TIME)
    chosen = [*crowd(2), candidate("slow", slow)]
    case = Case(tmp_path, 1.5 * SHAPES[:, 0] + slow, chosen)
    alone = case.fit(chosen[0])
    without = case.rule.where_wanders(alone.residual)
    assert rank(case.found, without, alone)[0][0] < PROMISE

    found = case.search()

    assert ids(found.best) == ["a", "slow"]


def test_what_the_others_made_needless_is_dropped(tmp_path: Path) -> None:
    """Alone, a mixture explains most; beside both that it imitates it explains nothing."""
    b, c, mixed = SHAPES[:, 1], SHAPES[:, 2], SHAPES[:, 1] + SHAPES[:, 2] + 0.9 * SHAPES[:, 3]
    chosen = [candidate("b", b), candidate("c", c), candidate("mixture", mixed)]
    case = Case(tmp_path, 2.0 * (b + c), chosen)

    found = case.search()

    assert ids(found.steps[0].tried[0]) == ["mixture"]
    assert [step.accepted for step in found.steps] == [True, True, True]
    assert ids(found.best) == ["b", "c"]


def test_a_likelier_one_takes_the_place_of_an_earlier_cause(tmp_path: Path) -> None:
    """The mixture explains most alone; beside one of both that it imitates, the other does."""
    b, c, mixed = SHAPES[:, 1], SHAPES[:, 2], SHAPES[:, 1] + SHAPES[:, 2] + 0.9 * SHAPES[:, 3]
    chosen = [candidate("b", b), candidate("c", c), candidate("mixture", mixed)]
    case = Case(tmp_path, 2.0 * (b + c), chosen)

    found = case.search(Settings(most=2))

    assert ids(found.steps[0].tried[0]) == ["mixture"]
    assert found.revised[0].accepted
    assert ids(found.best) == ["b", "c"]


@pytest.mark.parametrize(
    ("likeness", "expected"), [(1.0, ["twin"]), (0.999, ["twin"]), (0.9, []), (0.0, [])]
)
def test_who_does_nearly_the_same_is_declared(
    tmp_path: Path, likeness: float, expected: list[str]
) -> None:
    """A twin of which 0.1 % differs costs 0.2 nats of the 200 that the truth explains."""
    other = likeness * SHAPES[:, 0] + np.sqrt(1 - likeness**2) * SHAPES[:, 1]
    chosen = [candidate("truth", 0.99 * SHAPES[:, 0]), candidate("twin", other)]
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], chosen)

    [named] = alternatives(case.replayer, case.search(), Settings())

    assert named.confidence[0] >= 0.5
    assert {named.candidate.cause.id, *(s.cause.id for s in named.equivalent)} >= {"truth"}
    others = {"truth", "twin"} - {named.candidate.cause.id}
    assert sorted(s.cause.id for s in named.equivalent) == sorted(others if expected else [])


def test_a_cause_has_for_its_own_what_the_others_cannot_explain(tmp_path: Path) -> None:
    chosen = [candidate("weak", SHAPES[:, 0]), candidate("strong", SHAPES[:, 1])]
    case = Case(tmp_path, 0.5 * SHAPES[:, 0] + 2.0 * SHAPES[:, 1], chosen)
    found = case.search()
    assert found.best is not None

    named = {a.candidate.cause.id: a.own for a in alternatives(case.replayer, found, Settings())}

    alone = {one.cause.id: again(found.noise_model, case.fit(one)).evidence for one in chosen}
    assert named["weak"] == pytest.approx(found.best.evidence - alone["strong"], abs=0.5)
    assert named["strong"] == pytest.approx(found.best.evidence - alone["weak"], abs=0.5)
    assert named["strong"] > 5 * named["weak"]


def test_the_likely_is_not_declared_if_it_predicts_something_else(tmp_path: Path) -> None:
    """Two that differ where nothing is learned are equally likely, yet not the same."""
    elsewhere = SHAPES[:, 0].copy()
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], [])
    elsewhere[~case.learned] = 50.0
    chosen = [candidate("truth", SHAPES[:, 0]), candidate("wild", elsewhere)]
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], chosen)

    [named] = alternatives(case.replayer, case.search(), Settings())

    assert named.confidence.min() > 0.3
    assert named.equivalent == ()


@pytest.mark.usefixtures("one_size")
@pytest.mark.parametrize("spread", [1.0, 4.0])
def test_the_same_fit_by_a_ruler_whose_readings_count_less(tmp_path: Path, spread: float) -> None:
    case = Case(tmp_path, SHAPES[:, 0], crowd(1))
    fitted, here = case.next()[0], case.learned
    weight = np.full(len(TIME), 1.0)[here] / np.sqrt(spread)

    found = again(replace(case.rule, spread=np.full(len(TIME), spread)), fitted)

    # Theta stays that of the full ruler, which is hardly another with 600 readings.
    expected = log_ratio(case.null[here] * weight, SHAPES[here, :1] * weight[:, None])
    assert found.evidence == pytest.approx(expected, abs=0.01)
    assert found.hypothesis == fitted.hypothesis


def test_readings_count_less_where_the_remainder_wanders(tmp_path: Path) -> None:
    """An AR(1) process with rho counts as (1 - rho) / (1 + rho) of its readings."""
    case = Case(tmp_path, np.zeros(len(TIME)), [])
    wanders = np.zeros(len(TIME))
    for k in range(1, len(TIME)):
        wanders[k] = 0.6 * wanders[k - 1] + SHAPES[k, 0]

    rule = case.rule.where_wanders(wanders)

    full, less = np.sum(case.rule.learn(case.null) ** 2), np.sum(rule.learn(case.null) ** 2)
    assert full == pytest.approx(np.sum(case.null[case.learned] ** 2))
    assert less == pytest.approx(full * 0.4 / 1.6, rel=0.3)


@pytest.mark.parametrize("size", [0.0, 0.5])
def test_what_was_fitted_is_judged_by_the_readings_held_out(tmp_path: Path, size: float) -> None:
    case = Case(tmp_path, size * SHAPES[:, 0], crowd(1))
    role = split(case.replayer.measured)
    at, out = role == FIT, role == CHOOSE
    column = SHAPES[:, 0]

    found = predictive(case.rule, case.null, case.fit(*crowd(1)))

    theta = column[at] @ case.null[at] / (column[at] @ column[at] + 1 / PRIOR**2)
    left = case.null - theta * column
    expected = 0.5 * np.sum(case.null[out] ** 2 - left[out] ** 2)
    assert found == pytest.approx(expected, abs=0.01)
    assert (found > 5.0) == (size > 0)
