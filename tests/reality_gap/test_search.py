"""Tests of reality_gap.search on a machine that stands still, whose sensor errs as causes say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reality_gap import evidence
from reality_gap.cause import Cause, Effects, Parameter, Place, Record, Values
from reality_gap.equivalence import alternatives
from reality_gap.evidence import PRIOR
from reality_gap.fitting import Fit, fit
from reality_gap.plant import Suspect
from reality_gap.ranking import rank
from reality_gap.ruler import Ruler, predictive, ruler
from reality_gap.screening import screen
from reality_gap.search import Search, Settings, again, search, try_next
from reality_gap.splits import CHOOSE, FIT, split
from reality_gap.study import Channel, Episode, Reading, Study
from reality_gap.system import System
from reality_gap.workbench import Workbench

Array = NDArray[np.float64]
Answer = Callable[[float], float]

STILL = """
<mujoco>
  <option timestep="0.005" gravity="0 0 0"/>
  <worldbody>
    <body><joint name="rail" type="slide"/><geom type="sphere" size="0.1"/></body>
  </worldbody>
  <sensor><jointpos name="position" joint="rail"/></sensor>
</mujoco>
"""
TIME = np.arange(0.0, 8.0, 0.01)
SHAPES = np.random.default_rng(0).standard_normal((len(TIME), 6))
"""Errors over time that have nothing to do with each other."""


def proportional(size: float) -> float:
    return size


def suspect(
    id: str,
    shape: Array,
    where: str = "rail",
    answer: Answer = proportional,
    low: float = -100.0,
    sticky: bool = False,
    afar: tuple[float, ...] = (),
) -> Suspect:
    """A cause that adds ``answer(size)`` times a shape (n,) to what the sensor reads."""

    def attach(effects: Effects, system: System, place: Place, values: Values) -> None:
        def sense(record: Record) -> None:
            column = record.column("position")
            record.sensors[:, column] += answer(values["size"]) * np.interp(
                record.time, TIME, shape
            )

        effects.senses.append(sense)

    cause = Cause(id, "", "", lambda s: (), lambda s, p: (), None, attach, sticky=sticky)
    size = Parameter("size", "1", 1.0, 0, low, 100.0, afar=afar)
    return Suspect(cause, Place("joint", (where,)), (size,))


class Case:
    """A study, whom it suspects, and what a search is given.

    Args:
        folder: for the model.
        error: (n,) what the sensor errs by, in units of its noise, beside the noise.
        chosen: whom to suspect.
    """

    def __init__(self, folder: Path, error: Array, chosen: Sequence[Suspect]) -> None:
        path = folder / "still.xml"
        path.write_text(STILL)
        value = error + np.random.default_rng(1).standard_normal(len(TIME))
        channel = Channel("position", "position", unit="m", noise=1.0)
        episode = Episode("only", np.zeros(1), np.zeros((1, 0)), (Reading(TIME, value),))
        self.bench = Workbench(Study("still", path, (channel,), (episode,)))
        self.null = self.bench.residual([])
        self.tolerances = np.zeros((len(TIME), 0))
        self.found = screen(self.bench, chosen, [], self.null)
        self.rule = ruler(self.bench.measured, self.null, self.tolerances, None)

    def next(self, base: Fit | None = None, refits: int = 8) -> tuple[Fit, ...]:
        return try_next(self.bench, self.found, self.rule, base, refits)

    def search(self, settings: Settings | None = None) -> Search:
        chosen = Settings() if settings is None else settings
        return search(self.bench, self.found, self.null, self.tolerances, chosen)

    def fit(self, *chosen: Suspect) -> Fit:
        """From the null, with differences."""
        start = [(one, one.nulls()) for one in chosen]
        return fit(self.bench, start, self.rule.learn, self.null)

    @property
    def learned(self) -> NDArray[np.bool_]:
        """(n,) which readings are not kept for the report."""
        return split(self.bench.measured) <= CHOOSE


@pytest.fixture
def one_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes the evidence of what is linear exact."""
    monkeypatch.setattr(evidence, "SIZES", (PRIOR,))


def log_ratio(residual: Array, columns: Array) -> float:
    """How much likelier a residual (n,) is with weights of the columns (n, p) than without."""
    wider = np.eye(len(residual)) + PRIOR**2 * columns @ columns.T
    power = residual @ residual - residual @ np.linalg.solve(wider, residual)
    return 0.5 * float(power - np.linalg.slogdet(wider)[1])


def ids(fitted: Fit | None) -> list[str]:
    return sorted(one.cause.id for one in fitted.suspects) if fitted else []


def size_of(fitted: Fit, id: str) -> float:
    return next(values["size"] for one, values in fitted.hypothesis if one.cause.id == id)


def crowd(count: int = 4) -> list[Suspect]:
    """Suspects a, b, c, ... each with a shape of its own."""
    return [suspect("abcdef"[i], SHAPES[:, i]) for i in range(count)]


@pytest.mark.usefixtures("one_size")
def test_suspects_are_ranked_by_how_likely_they_make_the_data(tmp_path: Path) -> None:
    case = Case(tmp_path, 0.3 * SHAPES[:, 1] + 0.6 * SHAPES[:, 2], crowd())

    ranked = rank(case.found, case.rule, None)

    assert [s.suspect.cause.id for _, s, _ in ranked[:2]] == ["c", "b"]
    for found, sensitivity, _ in ranked:
        here = case.learned
        expected = log_ratio(case.null[here], sensitivity.columns[here])
        assert found == pytest.approx(expected, abs=1e-3)


@pytest.mark.usefixtures("one_size")
def test_beside_what_is_in_already_only_what_is_new_ranks(tmp_path: Path) -> None:
    """Evidence beside a is that of both over that of a alone; a itself is not asked again."""
    twin = suspect("twin", SHAPES[:, 0])
    case = Case(tmp_path, SHAPES[:, 0] + 0.5 * SHAPES[:, 1], [*crowd(2), twin])
    here = case.learned
    left, shapes = case.null[here], SHAPES[here]

    beside = rank(case.found, case.rule, case.fit(crowd()[0]))

    assert [s.suspect.cause.id for _, s, _ in beside] == ["b", "twin"]
    for (found, _, _), columns in zip(beside, ([0, 1], [0, 0]), strict=True):
        expected = log_ratio(left, shapes[:, columns]) - log_ratio(left, shapes[:, :1])
        assert found == pytest.approx(expected, abs=0.1)
    assert beside[0][0] > 50.0 > 0.0 > beside[1][0]


@pytest.mark.usefixtures("one_size")
def test_what_is_linear_is_fitted_exactly(tmp_path: Path) -> None:
    case = Case(tmp_path, 0.5 * SHAPES[:, 0], crowd(2))
    here = case.learned
    column, left = SHAPES[here, 0], case.null[here]

    best = case.next()[0]

    assert ids(best) == ["a"]
    expected = column @ left / (column @ column + 1 / PRIOR**2)
    assert best.theta == pytest.approx([expected], abs=1e-3)
    assert best.evidence == pytest.approx(log_ratio(left, column[:, None]), abs=0.01)
    np.testing.assert_allclose(best.residual, case.null - best.theta[0] * SHAPES[:, 0], atol=1e-9)


def test_the_best_come_first_and_only_so_many_are_tried(tmp_path: Path) -> None:
    case = Case(tmp_path, SHAPES @ np.array([0.2, 0.8, 0.4, 0.6, 0, 0]), crowd(6))

    tried = case.next(refits=3)

    assert [ids(one) for one in tried] == [["b"], ["d"], ["c"]]
    assert tried[0].evidence > tried[1].evidence > tried[2].evidence


def test_one_cause_does_not_take_all_the_room(tmp_path: Path) -> None:
    """Places of one cause that all look alike, and a weaker cause."""
    everywhere = [suspect("common", SHAPES[:, 0] + 0.01 * i, f"place {i}") for i in range(6)]
    rare = suspect("rare", SHAPES[:, 0] + SHAPES[:, 1])
    case = Case(tmp_path, SHAPES[:, 0], [*everywhere, rare])

    tried = case.next(refits=5)

    assert ["rare"] in [ids(one) for one in tried]
    assert len(tried) < 5


def test_beside_a_cause_only_what_promises_something_is_tried(tmp_path: Path) -> None:
    case = Case(tmp_path, SHAPES[:, 0] + 0.5 * SHAPES[:, 3], crowd(6))

    tried = case.next(case.fit(crowd()[0]))

    assert [ids(one) for one in tried] == [["a", "d"]]
    assert size_of(tried[0], "a") == pytest.approx(1.0, abs=0.15)
    assert size_of(tried[0], "d") == pytest.approx(0.5, abs=0.15)


def test_where_a_line_promises_too_much_the_start_is_smaller(tmp_path: Path) -> None:
    """Seen at small sizes, a fault that grows as its square must be huge to be what is there."""
    square = suspect("square", SHAPES[:, 0], answer=lambda size: size**2, low=0.0)
    case = Case(tmp_path, 4.0 * SHAPES[:, 0], [square])
    _, sensitivity, theta = rank(case.found, case.rule, None)[0]
    overshot = case.bench.residual([(square, sensitivity.values(theta))])

    best = case.next()[0]

    def power(residual: Array) -> float:
        return float(np.mean(residual[case.learned] ** 2))

    assert power(overshot) > 100 * power(case.null)
    assert power(best.residual) < 0.5 * power(case.null)
    assert best.evidence > 1000.0


def test_what_sticks_at_small_sizes_is_tried_at_large_ones(tmp_path: Path) -> None:
    """From where the line leads, the next step up is worse: the nearest minimum is a wrong one."""

    def sticking(size: float) -> float:
        return float(
            np.interp(size, [0.0, 1.0, 2.0, 3.0, 6.0, 10.0], [0.0, 1.0, 1.2, 1.1, 2.0, 3.0])
        )

    sticks = suspect("sticks", SHAPES[:, 0], answer=sticking, low=0.0)
    case = Case(tmp_path, 2.0 * SHAPES[:, 0], [sticks])
    near = fit(case.bench, [(sticks, {"size": 2.0})], case.rule.learn, case.null)

    best = case.next()[0]

    assert near.hypothesis[0][1]["size"] == pytest.approx(2.0, abs=0.2)
    assert size_of(best, "sticks") == pytest.approx(6.0, abs=1.0)


def with_a_ridge(size: float) -> float:
    """Leads the right way to a wrong valley; the right one is far on the other side."""
    return float(np.interp(size, [-9.0, 0.0, 0.2, 2.0, 6.0], [-6.0, 0.0, -0.1, -1.7, 2.0]))


@pytest.mark.parametrize(("afar", "expected"), [((), 2.0), ((-8.0, 8.0), -3.0)])
def test_where_lines_do_not_hold_a_fit_begins_from_afar(
    tmp_path: Path, afar: tuple[float, ...], expected: float
) -> None:
    bent = suspect("bent", SHAPES[:, 0], answer=with_a_ridge, afar=afar)
    case = Case(tmp_path, -2.0 * SHAPES[:, 0], [bent])

    best = case.next()[0]

    assert size_of(best, "bent") == pytest.approx(expected, abs=0.5)


def slipping(size: float) -> float:
    """What hardly shows until it is large."""
    return float(np.interp(size, [0.0, 1.0, 2.0, 8.0], [0.0, 0.2, 1.0, 7.0]))


@pytest.mark.parametrize(
    ("answer", "expected"), [(slipping, [["far"], ["loud"]]), (proportional, [["loud"]])]
)
def test_where_lines_do_not_hold_others_are_begun_from_afar_whatever_their_slopes_promise(
    tmp_path: Path, answer: Answer, expected: list[list[str]]
) -> None:
    loud = suspect("loud", SHAPES[:, 0] + 0.5 * SHAPES[:, 1], answer=answer)
    far = suspect("far", SHAPES[:, 0], answer=lambda size: slipping(0.1 * size), afar=(5.0, 60.0))
    case = Case(tmp_path, 3.0 * SHAPES[:, 0], [loud, far])

    tried = case.next(refits=1)

    assert [ids(one) for one in tried] == expected


def test_what_sticks_is_fitted_beside_what_sticks_whatever_its_slope_promises(
    tmp_path: Path,
) -> None:
    loud = suspect("loud", SHAPES[:, 0] + 0.8 * SHAPES[:, 1], sticky=True)
    quiet = suspect("quiet", SHAPES[:, 0], answer=slipping, low=0.0, sticky=True)
    smooth = suspect("smooth", SHAPES[:, 0], answer=slipping, low=0.0)
    case = Case(tmp_path, SHAPES[:, 0], [loud, quiet, smooth])

    tried = case.next(refits=1)

    assert [ids(one) for one in tried] == [["quiet"], ["loud"]]


def test_where_what_sticks_explains_little_no_other_is_fitted_for_it(tmp_path: Path) -> None:
    right = suspect("right", SHAPES[:, 0])
    sticking = [suspect(id, SHAPES[:, 0] + 2 * SHAPES[:, 1], sticky=True) for id in ("x", "y")]
    case = Case(tmp_path, SHAPES[:, 0], [right, *sticking])

    tried = case.next(refits=2)

    assert [ids(one) for one in tried] == [["right"], ["x"]]


@pytest.mark.parametrize("tolerances", [0, 1])
def test_where_a_large_start_diverges_a_smaller_one_is_tried(
    tmp_path: Path, tolerances: int
) -> None:
    """A little larger than the truth, the replay breaks down; a line leads beyond that."""
    brittle = suspect(
        "brittle", SHAPES[:, 0], answer=lambda s: np.nan if s > 0.6 else s**1.5, low=0.0
    )
    case = Case(tmp_path, 0.5**1.5 * SHAPES[:, 0], [brittle])
    allowed = SHAPES[:, 1 : 1 + tolerances]
    case.rule = ruler(case.bench.measured, case.null, allowed, None)
    _, sensitivity, theta = rank(case.found, case.rule, None)[0]
    beyond = case.bench.residual([(brittle, sensitivity.values(theta))])

    best = case.next()[0]

    assert np.all(np.isnan(beyond))
    assert size_of(best, "brittle") == pytest.approx(0.5, abs=0.1)


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

    def dearer(*args: Any) -> Fit:
        return replace(fit(*args), evidence=4.0)

    monkeypatch.setattr("reality_gap.search.fit", dearer)
    found = case.search()

    assert found.best is None
    assert [step.accepted for step in found.steps] == [False]


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
    assert usual.for_log(seconds) == replace(usual, further=12.0 * longer)


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


def test_what_the_others_made_needless_is_dropped(tmp_path: Path) -> None:
    """Alone, a mixture explains most; beside both that it imitates it explains nothing."""
    b, c, mixed = SHAPES[:, 1], SHAPES[:, 2], SHAPES[:, 1] + SHAPES[:, 2] + 0.9 * SHAPES[:, 3]
    chosen = [suspect("b", b), suspect("c", c), suspect("mixture", mixed)]
    case = Case(tmp_path, 2.0 * (b + c), chosen)

    found = case.search()

    assert ids(found.steps[0].tried[0]) == ["mixture"]
    assert [step.accepted for step in found.steps] == [True, True, True]
    assert ids(found.best) == ["b", "c"]


def test_a_likelier_one_takes_the_place_of_an_earlier_cause(tmp_path: Path) -> None:
    """The mixture explains most alone; beside one of both that it imitates, the other does."""
    b, c, mixed = SHAPES[:, 1], SHAPES[:, 2], SHAPES[:, 1] + SHAPES[:, 2] + 0.9 * SHAPES[:, 3]
    chosen = [suspect("b", b), suspect("c", c), suspect("mixture", mixed)]
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
    chosen = [suspect("truth", 0.99 * SHAPES[:, 0]), suspect("twin", other)]
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], chosen)

    [named] = alternatives(case.bench, case.search(), Settings())

    assert named.confidence[0] >= 0.5
    assert {named.suspect.cause.id, *(s.cause.id for s in named.equivalent)} >= {"truth"}
    others = {"truth", "twin"} - {named.suspect.cause.id}
    assert sorted(s.cause.id for s in named.equivalent) == sorted(others if expected else [])


def test_a_cause_has_for_its_own_what_the_others_cannot_explain(tmp_path: Path) -> None:
    chosen = [suspect("weak", SHAPES[:, 0]), suspect("strong", SHAPES[:, 1])]
    case = Case(tmp_path, 0.5 * SHAPES[:, 0] + 2.0 * SHAPES[:, 1], chosen)
    found = case.search()
    assert found.best is not None

    named = {a.suspect.cause.id: a.own for a in alternatives(case.bench, found, Settings())}

    alone = {one.cause.id: again(found.ruler, case.fit(one)).evidence for one in chosen}
    assert named["weak"] == pytest.approx(found.best.evidence - alone["strong"], abs=0.5)
    assert named["strong"] == pytest.approx(found.best.evidence - alone["weak"], abs=0.5)
    assert named["strong"] > 5 * named["weak"]


def test_the_likely_is_not_declared_if_it_predicts_something_else(tmp_path: Path) -> None:
    """Two that differ where nothing is learned are equally likely, yet not the same."""
    elsewhere = SHAPES[:, 0].copy()
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], [])
    elsewhere[~case.learned] = 50.0
    chosen = [suspect("truth", SHAPES[:, 0]), suspect("wild", elsewhere)]
    case = Case(tmp_path, 0.9 * SHAPES[:, 0], chosen)

    [named] = alternatives(case.bench, case.search(), Settings())

    assert named.confidence.min() > 0.3
    assert named.equivalent == ()


@pytest.mark.usefixtures("one_size")
@pytest.mark.parametrize("spread", [1.0, 4.0])
def test_the_same_fit_by_a_ruler_whose_readings_count_less(tmp_path: Path, spread: float) -> None:
    case = Case(tmp_path, SHAPES[:, 0], crowd(1))
    fitted, here = case.next()[0], case.learned
    weight = np.full(len(TIME), 1.0)[here] / np.sqrt(spread)
    shorter = replace(case.rule.learn, weight=weight)

    found = again(Ruler(shorter, case.rule.fit, case.null, case.tolerances), fitted)

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

    rule = ruler(case.bench.measured, case.null, case.tolerances, wanders)

    full, less = np.sum(case.rule.learn(case.null) ** 2), np.sum(rule.learn(case.null) ** 2)
    assert full == pytest.approx(np.sum(case.null[case.learned] ** 2))
    assert less == pytest.approx(full * 0.4 / 1.6, rel=0.3)


@pytest.mark.parametrize("size", [0.0, 0.5])
def test_what_was_fitted_is_judged_by_the_readings_held_out(tmp_path: Path, size: float) -> None:
    case = Case(tmp_path, size * SHAPES[:, 0], crowd(1))
    role = split(case.bench.measured)
    at, out = role == FIT, role == CHOOSE
    column = SHAPES[:, 0]

    found = predictive(case.rule, case.null, case.fit(*crowd(1)))

    theta = column[at] @ case.null[at] / (column[at] @ column[at] + 1 / PRIOR**2)
    left = case.null - theta * column
    expected = 0.5 * np.sum(case.null[out] ** 2 - left[out] ** 2)
    assert found == pytest.approx(expected, abs=0.01)
    assert (found > 5.0) == (size > 0)
