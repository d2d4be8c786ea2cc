"""Paying causes, on a machine at rest whose sensor has the errors of candidates."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from reality_gap.diagnosis import Estimate, Gain
from reality_gap.inference.confidence import doubt_of_partial
from reality_gap.inference.deviations import deviations
from reality_gap.inference.end_stops import Stop
from reality_gap.inference.equivalence import alternatives
from reality_gap.inference.folds import Folds, _gain, _Part
from reality_gap.inference.forward_selection import Settings
from reality_gap.inference.gauss_newton import fit, null_fit
from reality_gap.inference.intervals import intervals
from reality_gap.inference.paying import (
    AT_BOUND,
    NO_GAIN,
    Paying,
    _worst,
    beside_dropped,
    held_out_criteria,
    keep_paying,
)
from reality_gap.inference.waterfall import shares
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.study.splits import REPORT, split
from tests.reality_gap.inference.imperfect_models import (
    SHAPES,
    TIME,
    Case,
    candidate,
    crowd,
    ids,
    size_of,
)


def bounded(id: str, column: int, high: float) -> Candidate:
    """Return a candidate whose size is at most ``high``."""
    plain = candidate(id, SHAPES[:, column])
    return replace(plain, parameters=(replace(plain.parameters[0], high=high),))


def reasons(paying: Paying) -> list[tuple[str, str]]:
    return [(one.candidate.cause.id, one.reason) for one in paying.dropped]


def test_all_of_several_right_causes_pay_each_beside_the_others(tmp_path: Path) -> None:
    case = Case(tmp_path, 1.0 * SHAPES[:, 4] - 0.6 * SHAPES[:, 2], crowd(6))

    found = keep_paying(case.search())

    assert ids(found.result.best) == ["c", "e"]
    assert found.dropped == ()
    assert found.tested.pays
    for gains in (*found.tested.each, found.tested.total):
        assert 0.0 < gains.folds.low < gains.folds.value < gains.folds.high
        assert gains.report.value > 0.0


def test_the_gain_of_a_cause_is_that_of_the_readings_it_explains(tmp_path: Path) -> None:
    """800 readings with an error of 0.6 noises: 800 * 0.36 / 2 nats, with a deviation of 17."""
    case = Case(tmp_path, 0.6 * SHAPES[:, 2], crowd(3))
    result = case.search()

    found = Folds(result.problem, result.best).cross_validated(null_fit(result.problem))

    expected = 0.5 * float(np.sum((0.6 * SHAPES[:, 2]) ** 2))
    wide = 1.96 * np.sqrt(2.0 * expected)
    assert found.value == pytest.approx(expected, abs=wide)
    assert found.high - found.value == pytest.approx(wide, rel=0.15)


def test_a_cause_that_fails_on_the_report_split_is_dropped(tmp_path: Path) -> None:
    """The last cause explains the fit and selection splits only, as chance would."""
    learned = Case(tmp_path, np.zeros(len(TIME)), []).learned
    error = 1.0 * SHAPES[:, 4] + np.where(learned, 0.8, -0.4) * SHAPES[:, 2]
    case = Case(tmp_path, error, crowd(6))
    result = case.search()
    assert ids(result.best) == ["c", "e"]

    found = keep_paying(result)

    assert ids(found.result.best) == ["e"]
    assert reasons(found) == [("c", NO_GAIN)]
    assert ids(found.attempt) == ["c", "e"]
    assert size_of(found.result.best, "e") == pytest.approx(1.0, abs=0.15)
    [failed] = [c for c in held_out_criteria(found) if not c.met and c.name.startswith("report")]
    assert failed.value < failed.threshold == 0.0


def test_a_cause_at_its_bound_is_dropped_and_the_other_one_stays(tmp_path: Path) -> None:
    chosen = [candidate("right", SHAPES[:, 0]), bounded("stuck", 1, 0.5)]
    case = Case(tmp_path, 1.0 * SHAPES[:, 0] + 3.0 * SHAPES[:, 1], chosen)
    result = case.search()
    assert ids(result.best) == ["right", "stuck"]

    found = keep_paying(result)

    assert ids(found.result.best) == ["right"]
    assert reasons(found) == [("stuck", AT_BOUND)]
    assert found.tested.pays


def test_an_interval_holds_the_value_beside_a_dropped_cause_that_predicts_better(
    tmp_path: Path,
) -> None:
    """The other cause bears a part of it, and its own interval excludes what it is beside it."""
    both = SHAPES[:, 1] + 1.5 * SHAPES[:, 0]
    stuck = candidate("stuck", both)
    stuck = replace(stuck, parameters=(replace(stuck.parameters[0], high=0.5),))
    right = candidate("right", SHAPES[:, 0])
    case = Case(tmp_path, 1.0 * SHAPES[:, 0] + 3.0 * both, [right, stuck])
    found = keep_paying(case.search())
    assert reasons(found) == [("stuck", AT_BOUND)]

    [own] = intervals(found.result.problem, found.result.best)
    [wide] = beside_dropped([own], found)

    beside = size_of(found.attempt, "right")
    assert beside == pytest.approx(4.75, abs=0.2)  # two shapes are correlated by chance
    assert own["size"].low > beside
    assert wide["size"].low == beside
    assert (wide["size"].value, wide["size"].high) == (own["size"].value, own["size"].high)


def test_an_interval_ignores_a_dropped_cause_that_predicts_worse(tmp_path: Path) -> None:
    learned = Case(tmp_path, np.zeros(len(TIME)), []).learned
    error = 1.0 * SHAPES[:, 4] + np.where(learned, 0.8, -0.4) * SHAPES[:, 2]
    found = keep_paying(Case(tmp_path, error, crowd(6)).search())
    assert reasons(found) == [("c", NO_GAIN)]
    own = [{"size": Estimate(50.0, 49.0, 51.0, "1")}]

    assert beside_dropped(own, found) == own


def test_a_cause_that_stands_for_a_stop_is_dropped_and_none_takes_its_turn(tmp_path: Path) -> None:
    """Another candidate explains nearly as much as it does."""
    near = candidate("near", SHAPES[:, 1] + 0.3 * SHAPES[:, 3])
    case = Case(tmp_path, 1.0 * SHAPES[:, 1], [candidate("stopped", SHAPES[:, 1]), near])
    result = case.search()
    assert ids(result.best) == ["stopped"]
    stop = Stop(result.best.candidates[-1], "an end stop of hinge at 1 rad", 30.0)

    found = keep_paying(replace(result, stop=stop))

    assert found.result.best.is_null
    assert reasons(found) == [("stopped", stop.objection)]


def test_no_cause_is_left_if_the_only_one_is_at_its_bound(tmp_path: Path) -> None:
    case = Case(tmp_path, 3.0 * SHAPES[:, 1], [bounded("stuck", 1, 0.5)])

    found = keep_paying(case.search())

    assert found.result.best.is_null
    assert reasons(found) == [("stuck", AT_BOUND)]
    assert found.attempted.pays  # so that the verdict is not that nothing is wrong


def test_the_next_single_cause_is_tested_if_the_likeliest_one_does_not_pay(tmp_path: Path) -> None:
    """The likeliest one explains the fit and selection splits only, as chance would."""
    learned = Case(tmp_path, np.zeros(len(TIME)), []).learned
    chance = np.where(learned, 1.5, -0.8) * SHAPES[:, 4]
    candidates = [candidate("chance", SHAPES[:, 4]), candidate("right", SHAPES[:, 0])]
    case = Case(tmp_path, 0.7 * SHAPES[:, 0] + chance, candidates)
    result = case.search()
    alone = replace(result, best=result.steps[0].tried[0])
    assert ids(alone.best) == ["chance"]

    found = keep_paying(alone)

    assert ids(found.result.best) == ["right"]
    assert reasons(found) == [("chance", NO_GAIN)]
    assert found.tested.pays


def test_a_cause_pays_although_a_deviation_hid_a_part_of_it(tmp_path: Path) -> None:
    """Half a tolerance cancels most of the cause's error, so that the RMS grows without it."""
    deviation = 3.0 * SHAPES[:, 0]
    cause = SHAPES[:, 4] - deviation
    case = Case(tmp_path, cause + deviation, [candidate("right", cause)])
    case.problem = case.problem_with(2.0 * deviation[:, None])

    found = keep_paying(case.search())

    assert ids(found.result.best) == ["right"]
    before, after = (np.sqrt(np.mean(r**2)) for r in (case.null, found.result.best.residual))
    assert after > 1.5 * before
    assert found.tested.improvement.low > 0.0


def test_large_deviations_cost_as_much_as_errors(tmp_path: Path) -> None:
    """Thirty tolerances explain all, and are as unlikely as an error of thirty noises."""
    case = Case(tmp_path, 30.0 * SHAPES[:, 0], [])
    problem = case.problem_with(SHAPES[:, [0]])

    [found] = deviations(problem, case.null)

    cost = 30.0**2 / np.count_nonzero(case.learned)
    assert np.mean(found.left_with_cost**2) == pytest.approx(1.0 + cost, rel=0.1)


def test_an_event_in_one_block_of_the_report_split_pays(tmp_path: Path) -> None:
    """A bootstrap over blocks would leave it out in a third of its samples."""
    case = Case(tmp_path, np.zeros(len(TIME)), [])
    block = np.floor(TIME / 0.25).astype(int)
    one = block[split(case.replayer.measured) == REPORT][0]
    event = np.where((block == one) | (block == one + 1), SHAPES[:, 0], 0.0)
    case = Case(tmp_path, 2.0 * event, [candidate("event", event)])
    result = case.search()

    found = Folds(result.problem, result.best).report(null_fit(result.problem))

    assert found.low > 0.0


def test_a_cause_that_does_not_pay_is_dropped_before_one_that_the_report_split_does_not_show(
    tmp_path: Path,
) -> None:
    case = Case(tmp_path, 1.0 * SHAPES[:, 4] - 0.6 * SHAPES[:, 2], crowd(6))
    paying = keep_paying(case.search())
    first, second = paying.tested.each
    fails = first._replace(folds=Gain(1.0, -0.5, 2.5))
    hidden = second._replace(report=Gain(-0.8, -2.0, 0.4), is_shown=False)
    tested = replace(paying.tested, each=(fails, hidden))
    assert _worst(paying.result, tested) == (0, NO_GAIN)
    assert _worst(paying.result, replace(tested, each=(hidden, fails))) == (1, NO_GAIN)


@pytest.mark.parametrize("seed", range(4))
def test_an_event_between_two_blocks_of_the_report_split_pays(tmp_path: Path, seed: int) -> None:
    """There it changes nothing, or 0.01 noises that are right or wrong by chance."""
    learned = Case(tmp_path, np.zeros(len(TIME)), []).learned
    block = np.floor(TIME / 0.25).astype(int)
    first = block[learned][40]
    short = np.where((block >= first) & (block <= first + 1), SHAPES[:, 0], 0.0)
    event = short * learned + 0.01 * np.random.default_rng(seed).standard_normal(len(TIME))
    result = Case(tmp_path, 3.0 * short * learned, [candidate("event", event)]).search()

    found = keep_paying(result)

    assert ids(found.result.best) == ["event"]
    assert found.dropped == ()
    assert not found.tested.total.is_shown


def test_tolerances_that_all_folds_share_widen_the_interval(tmp_path: Path) -> None:
    """A deviation within the tolerances looks in each fold as if the cause were there."""
    case = Case(tmp_path, 0.6 * SHAPES[:, 2], crowd(3))
    tolerance = 0.3 * SHAPES[:, [2]]
    problem = case.problem_with(tolerance)
    fitted = case.fit(crowd(3)[2])

    gain = Folds(problem, fitted).cross_validated(null_fit(problem))

    alone = Folds(case.problem, fitted).cross_validated(null_fit(case.problem))
    assert gain.value < alone.value
    assert (gain.high - gain.low) / gain.value > 2.0 * (alone.high - alone.low) / alone.value


def test_a_dropped_cause_is_no_alternative_to_the_others(tmp_path: Path) -> None:
    """The stuck cause has more evidence than the right one, and cannot stand above it."""
    chosen = [candidate("right", SHAPES[:, 0]), bounded("stuck", 1, 2.0)]
    case = Case(tmp_path, 1.0 * SHAPES[:, 0] + 5.0 * SHAPES[:, 1], chosen)
    paying = keep_paying(case.search())
    assert ids(paying.result.best) == ["right"]
    dropped = [one.candidate for one in paying.dropped]

    [found] = alternatives(paying.result, Settings(), refused=dropped)

    assert [ids(fitted) for fitted in found.tried] == [["right"]]


def test_an_alternative_is_listed_once(tmp_path: Path) -> None:
    case = Case(tmp_path, 1.0 * SHAPES[:, 0], crowd(3))
    result = case.search()
    first = result.steps[0]
    twice = replace(result, steps=(replace(first, tried=first.tried * 2), *result.steps[1:]))

    [found] = alternatives(twice, Settings())

    names = [fitted.candidates[-1].cause.id for fitted in found.tried]
    assert sorted(names) == ["a", "b", "c"]


def test_a_likelier_candidate_replaces_what_a_dropped_cause_left(
    tmp_path: Path,
) -> None:
    """Beside a cause that sticks at its bound a mixture was chosen; alone another one is right."""
    chosen = [candidate("right", SHAPES[:, 0]), candidate("wrong", SHAPES[:, 1])]
    case = Case(tmp_path, 1.0 * SHAPES[:, 0], [*chosen, bounded("stuck", 2, 0.5)])
    stuck = bounded("stuck", 2, 0.5)
    result = case.search()
    worse = fit(case.problem, [(chosen[1], {"size": 0.1}), (stuck, {"size": 0.5})])

    found = keep_paying(replace(result, best=worse))

    assert ids(found.result.best) == ["right"]


@pytest.mark.parametrize(
    ("named", "left", "instead", "expected"),
    [
        (100.0, 0.0, 0.0, 0.0),
        (100.0, 100.0, 0.0, 0.25),  # an unknown cause of the same size may look like a part of it
        (100.0, 100.0, 200.0, 0.5),  # the learned residual alone is as likely
        (100.0, 100.0, 300.0, 1.0),
        (10.0, 1e6, 0.0, 0.5),
    ],
)
def test_names_of_a_part_are_less_certain_the_more_is_left(
    named: float, left: float, instead: float, expected: float
) -> None:
    assert doubt_of_partial(named, left, instead) == pytest.approx(expected, abs=1e-4)


def test_evidence_counts_for_less_where_errors_above_the_noise_are_left(tmp_path: Path) -> None:
    case = Case(tmp_path, 0.3 * SHAPES[:, 0], crowd(2))
    result = case.search()

    left = result.problem.reinflated(result.best.residual + 3.0 * SHAPES[:, 3])

    [usual] = alternatives(result, Settings())
    [rough] = alternatives(replace(result, problem=left), Settings())

    assert usual.confidence[0] > 0.95
    assert rough.confidence[0] < usual.confidence[0]


def test_the_interval_of_a_gain_is_the_wider_one_of_two_estimates() -> None:
    """That by noise grows with what is left; that by blocks allows for errors of another form."""
    shared = np.array([2.0])

    def half(noise: float, robust: float, spread: float) -> float:
        found = _gain([_Part(10.0, noise, shared, robust, spread)])
        assert found.value == 10.0
        return found.high - found.value

    assert half(5.0, 0.0, 1.0) == pytest.approx(1.96 * 3.0)
    assert half(5.0, 0.0, 9.0) == pytest.approx(1.96 * 9.0)
    assert half(5.0, 100.0, 1.0) == pytest.approx(1.96 * 10.0)


def test_a_fold_does_not_know_its_own_tolerances(tmp_path: Path) -> None:
    case = Case(tmp_path, np.zeros(len(TIME)), crowd(2))
    folds = Folds(case.problem, null_fit(case.problem))
    grams = folds._grams
    for fold, covariance in enumerate(folds._covariances):
        others = sum(gram for k, gram in enumerate(grams) if k != fold)
        np.testing.assert_allclose(covariance, np.linalg.inv(others + np.eye(len(covariance))))


def test_causes_that_make_the_report_split_worse_do_not_pay(tmp_path: Path) -> None:
    case = Case(tmp_path, 1.0 * SHAPES[:, 4], crowd(6))
    tested = keep_paying(case.search()).tested

    assert tested.pays
    assert not replace(tested, improvement=Gain(-2.0, -3.0, -1.0)).pays


@pytest.mark.parametrize("sizes", [[0.995, 0.99, 0.98], [1.001, 1.0005, 0.99], [9.0, 4.0, 1.0]])
def test_no_share_of_a_waterfall_is_above_the_whole(sizes: list[float]) -> None:
    found = shares(["tolerances", "cause"], sizes, 1.0)

    assert [(one.before, one.after) for one in found] == list(pairwise(sizes))
    assert 0.0 < sum(one.fraction for one in found) <= 1.0 + 1e-12
