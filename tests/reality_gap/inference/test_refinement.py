"""Tests of who may stand beside a hypothesis: ranking, quick fits and full ones."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes.attachment_shift import CAUSE as attachment_shift
from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.gauss_newton import fit
from reality_gap.inference.likelihood import noise_model
from reality_gap.inference.ranking import rank
from reality_gap.inference.refinement import try_next
from reality_gap.inference.screening import screen
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.types import Floats
from tests.reality_gap.inference.imperfect_models import (
    SHAPES,
    Answer,
    Case,
    candidate,
    crowd,
    formed,
    ids,
    log_ratio,
    proportional,
    size_of,
)


@pytest.mark.usefixtures("one_size")
def test_suspects_are_ranked_by_how_likely_they_make_the_data(tmp_path: Path) -> None:
    case = Case(tmp_path, 0.3 * SHAPES[:, 1] + 0.6 * SHAPES[:, 2], crowd())

    ranked = rank(case.found, case.rule, None)

    assert [s.candidate.cause.id for _, s, _ in ranked[:2]] == ["c", "b"]
    for found, sensitivity, _ in ranked:
        here = case.learned
        expected = log_ratio(case.null[here], sensitivity.columns[here])
        assert found == pytest.approx(expected, abs=1e-3)


@pytest.mark.usefixtures("one_size")
def test_beside_what_is_in_already_only_what_is_new_ranks(tmp_path: Path) -> None:
    """Evidence beside a is that of both over that of a alone; a itself is not asked again."""
    twin = candidate("twin", SHAPES[:, 0])
    case = Case(tmp_path, SHAPES[:, 0] + 0.5 * SHAPES[:, 1], [*crowd(2), twin])
    here = case.learned
    left, shapes = case.null[here], SHAPES[here]

    beside = rank(case.found, case.rule, case.fit(crowd()[0]))

    assert [s.candidate.cause.id for _, s, _ in beside] == ["b", "twin"]
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
    everywhere = [candidate("common", SHAPES[:, 0] + 0.01 * i, f"place {i}") for i in range(6)]
    rare = candidate("rare", SHAPES[:, 0] + SHAPES[:, 1])
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
    square = candidate("square", SHAPES[:, 0], answer=lambda size: size**2, low=0.0)
    case = Case(tmp_path, 4.0 * SHAPES[:, 0], [square])
    _, sensitivity, theta = rank(case.found, case.rule, None)[0]
    overshot = case.replayer.residual([(square, sensitivity.values(theta))])

    best = case.next()[0]

    def power(residual: Floats) -> float:
        return float(np.mean(residual[case.learned] ** 2))

    assert power(overshot) > 100 * power(case.null)
    assert power(best.residual) < 0.5 * power(case.null)
    assert best.evidence > 1000.0


@pytest.mark.parametrize(("true", "found"), [(0.05, 0.05), (0.1, 0.1), (0.21, 0.2), (0.42, 0.4)])
def test_a_form_that_the_null_does_not_show_is_tried_smaller_and_larger(
    tmp_path: Path, true: float, found: float
) -> None:
    case = Case(tmp_path, 2.0 * (SHAPES[:, 0] + true * SHAPES[:, 1]), [formed(0.1)])

    [best] = case.next()

    assert best.hypothesis[0][1]["form"] == pytest.approx(found)
    assert size_of(best, "formed") == pytest.approx(2.0, rel=0.15)


def test_what_sticks_at_small_sizes_is_tried_at_large_ones(tmp_path: Path) -> None:
    """From where the line leads, the next step up is worse: the nearest minimum is a wrong one."""

    def sticking(size: float) -> float:
        return float(
            np.interp(size, [0.0, 1.0, 2.0, 3.0, 6.0, 10.0], [0.0, 1.0, 1.2, 1.1, 2.0, 3.0])
        )

    sticks = candidate("sticks", SHAPES[:, 0], answer=sticking, low=0.0)
    case = Case(tmp_path, 2.0 * SHAPES[:, 0], [sticks])
    near = fit(case.replayer, [(sticks, {"size": 2.0})], case.rule.learn, case.null)

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
    bent = candidate("bent", SHAPES[:, 0], answer=with_a_ridge, afar=afar)
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
    loud = candidate("loud", SHAPES[:, 0] + 0.5 * SHAPES[:, 1], answer=answer)
    far = candidate("far", SHAPES[:, 0], answer=lambda size: slipping(0.1 * size), afar=(5.0, 60.0))
    case = Case(tmp_path, 3.0 * SHAPES[:, 0], [loud, far])

    tried = case.next(refits=1)

    assert [ids(one) for one in tried] == expected


def with_a_checkpoint(size: float) -> float:
    """Gives a tenth of what it could on one side, and all on the other."""
    return float(np.interp(size, [-9.0, 0.0, 0.2, 1.0], [9.0, 0.0, 0.015, 0.3]))


def test_what_explains_little_at_first_is_begun_from_afar_too(tmp_path: Path) -> None:
    loud = candidate("loud", SHAPES[:, 0] + 0.5 * SHAPES[:, 1])
    far = candidate("far", SHAPES[:, 0], answer=with_a_checkpoint, afar=(-4.0, 4.0))
    case = Case(tmp_path, 3.0 * SHAPES[:, 0], [loud, far])

    best = case.next()[0]

    assert ids(best) == ["far"]
    assert size_of(best, "far") == pytest.approx(-3.0, abs=0.2)


def test_a_wire_point_far_off_is_told_from_the_wire_s_other_end(lever_study: Study) -> None:
    """Begun at the drawing alone, a fit of the other end ends 12 mm off and explains more."""
    replayer = Replayer(lever_study)
    locations = [one for one in attachment_shift.locations(replayer.system) if one.kind == "site"]
    ends = [
        Candidate(
            attachment_shift, location, attachment_shift.parameters(replayer.system, location)
        )
        for location in locations
        if location.elements[0].startswith("flexor")
    ]
    moved = next(one for one in ends if one.location.elements == ("flexor_1",))
    true = replayer.look([(moved, moved.nulls() | {"x": -0.012})]).prediction
    noise = np.random.default_rng(0).standard_normal(len(true)) * replayer.measured.noise
    replayer.measured = replace(replayer.measured, value=true + noise)
    null = replayer.residual([])
    rule = noise_model(replayer.measured, null, np.zeros((len(null), 0)))

    best = try_next(replayer, screen(replayer, ends, [], null), rule, None, 2)[0]

    assert best.candidates == (moved,)
    assert best.hypothesis[0][1]["x"] == pytest.approx(-0.012, abs=0.0005)


def test_what_sticks_is_fitted_beside_what_sticks_whatever_its_slope_promises(
    tmp_path: Path,
) -> None:
    loud = candidate("loud", SHAPES[:, 0] + 0.8 * SHAPES[:, 1], sticky=True)
    quiet = candidate("quiet", SHAPES[:, 0], answer=slipping, low=0.0, sticky=True)
    smooth = candidate("smooth", SHAPES[:, 0], answer=slipping, low=0.0)
    case = Case(tmp_path, SHAPES[:, 0], [loud, quiet, smooth])

    tried = case.next(refits=1)

    assert [ids(one) for one in tried] == [["quiet"], ["loud"]]


def test_where_what_sticks_explains_little_no_other_is_fitted_for_it(tmp_path: Path) -> None:
    right = candidate("right", SHAPES[:, 0])
    sticking = [candidate(id, SHAPES[:, 0] + 2 * SHAPES[:, 1], sticky=True) for id in ("x", "y")]
    case = Case(tmp_path, SHAPES[:, 0], [right, *sticking])

    tried = case.next(refits=2)

    assert [ids(one) for one in tried] == [["right"], ["x"]]


@pytest.mark.parametrize("tolerances", [0, 1])
def test_where_a_large_start_diverges_a_smaller_one_is_tried(
    tmp_path: Path, tolerances: int
) -> None:
    """A little larger than the truth, the replay breaks down; a line leads beyond that."""
    brittle = candidate(
        "brittle", SHAPES[:, 0], answer=lambda s: np.nan if s > 0.6 else s**1.5, low=0.0
    )
    case = Case(tmp_path, 0.5**1.5 * SHAPES[:, 0], [brittle])
    allowed = SHAPES[:, 1 : 1 + tolerances]
    case.rule = noise_model(case.replayer.measured, case.null, allowed)
    _, sensitivity, theta = rank(case.found, case.rule, None)[0]
    beyond = case.replayer.residual([(brittle, sensitivity.values(theta))])

    best = case.next()[0]

    assert np.all(np.isnan(beyond))
    assert size_of(best, "brittle") == pytest.approx(0.5, abs=0.1)
