"""Refinement: candidates beside a hypothesis are ranked, fitted quickly, then fully."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes.attachment_shift import CAUSE as attachment_shift
from reality_gap.causes.base import Location
from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.gauss_newton import fit, null_fit
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.refinement import fit_next
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
def test_candidates_are_ranked_by_the_likelihood_of_the_data(tmp_path: Path) -> None:
    case = Case(tmp_path, 0.3 * SHAPES[:, 1] + 0.6 * SHAPES[:, 2], crowd())

    ranked = case.rank()

    assert [s.candidate.cause.id for _, s, _ in ranked[:2]] == ["c", "b"]
    for found, sensitivity, _ in ranked:
        here = case.learned
        expected = log_ratio(case.null[here], sensitivity.columns[here])
        assert found == pytest.approx(expected, abs=1e-3)


@pytest.mark.usefixtures("one_size")
def test_candidates_of_the_base_are_not_ranked(tmp_path: Path) -> None:
    """Evidence beside a is that of both over that of a alone; a itself is not asked again."""
    twin = candidate("twin", SHAPES[:, 0])
    case = Case(tmp_path, SHAPES[:, 0] + 0.5 * SHAPES[:, 1], [*crowd(2), twin])
    here = case.learned
    left, shapes = case.null[here], SHAPES[here]

    beside = case.rank(case.fit(crowd()[0]))

    assert [s.candidate.cause.id for _, s, _ in beside] == ["b", "twin"]
    for (found, _, _), columns in zip(beside, ([0, 1], [0, 0]), strict=True):
        expected = log_ratio(left, shapes[:, columns]) - log_ratio(left, shapes[:, :1])
        assert found == pytest.approx(expected, abs=0.1)
    assert beside[0][0] > 50.0 > 0.0 > beside[1][0]


@pytest.mark.usefixtures("one_size")
def test_a_linear_candidate_is_fitted_exactly(tmp_path: Path) -> None:
    case = Case(tmp_path, 0.5 * SHAPES[:, 0], crowd(2))
    here = case.learned
    column, left = SHAPES[here, 0], case.null[here]

    best = case.next()[0]

    assert ids(best) == ["a"]
    expected = column @ left / (column @ column + 1 / PRIOR**2)
    assert best.theta == pytest.approx([expected], abs=1e-3)
    assert best.evidence == pytest.approx(log_ratio(left, column[:, None]), abs=0.01)
    np.testing.assert_allclose(best.residual, case.null - best.theta[0] * SHAPES[:, 0], atol=1e-9)


def test_a_limited_number_of_candidates_is_tried_best_first(tmp_path: Path) -> None:
    case = Case(tmp_path, SHAPES @ np.array([0.2, 0.8, 0.4, 0.6, 0, 0]), crowd(6))

    tried = case.next(refits=3)

    assert [ids(one) for one in tried] == [["b"], ["d"], ["c"]]
    assert tried[0].evidence > tried[1].evidence > tried[2].evidence


def test_few_locations_of_one_cause_are_tried(tmp_path: Path) -> None:
    """All locations of one cause have the same effect; another cause is weaker."""
    everywhere = [candidate("common", SHAPES[:, 0] + 0.01 * i, f"place {i}") for i in range(6)]
    rare = candidate("rare", SHAPES[:, 0] + SHAPES[:, 1])
    case = Case(tmp_path, SHAPES[:, 0], [*everywhere, rare])

    tried = case.next(refits=5)

    assert ["rare"] in [ids(one) for one in tried]
    assert len(tried) < 5


def test_beside_a_cause_only_candidates_with_evidence_are_tried(tmp_path: Path) -> None:
    case = Case(tmp_path, SHAPES[:, 0] + 0.5 * SHAPES[:, 3], crowd(6))

    tried = case.next(case.fit(crowd()[0]))

    assert [ids(one) for one in tried] == [["a", "d"]]
    assert size_of(tried[0], "a") == pytest.approx(1.0, abs=0.15)
    assert size_of(tried[0], "d") == pytest.approx(0.5, abs=0.15)


def test_a_fit_starts_smaller_if_the_linear_size_is_too_large(tmp_path: Path) -> None:
    """The slope of a square at small sizes leads to a far too large size."""
    square = candidate("square", SHAPES[:, 0], answer=lambda size: size**2, low=0.0)
    case = Case(tmp_path, 4.0 * SHAPES[:, 0], [square])
    _, sensitivity, theta = case.rank()[0]
    overshot = case.replayer.residual([(square, sensitivity.values(theta))])

    best = case.next()[0]

    def power(residual: Floats) -> float:
        return float(np.mean(residual[case.learned] ** 2))

    assert power(overshot) > 100 * power(case.null)
    assert power(best.residual) < 0.5 * power(case.null)
    assert best.evidence > 1000.0


@pytest.mark.parametrize(("true", "found"), [(0.05, 0.05), (0.1, 0.1), (0.21, 0.2), (0.42, 0.4)])
def test_a_shape_without_slope_at_the_null_is_tried_smaller_and_larger(
    tmp_path: Path, true: float, found: float
) -> None:
    case = Case(tmp_path, 2.0 * (SHAPES[:, 0] + true * SHAPES[:, 1]), [formed(0.1)])

    [best] = case.next()

    assert best.hypothesis[0][1]["form"] == pytest.approx(found)
    assert size_of(best, "formed") == pytest.approx(2.0, rel=0.15)


def test_other_sizes_are_tried_beside_a_local_minimum(tmp_path: Path) -> None:
    """The minimum that is nearest to the linear size is a wrong one."""

    def sticking(size: float) -> float:
        return float(
            np.interp(size, [0.0, 1.0, 2.0, 3.0, 6.0, 10.0], [0.0, 1.0, 1.2, 1.1, 2.0, 3.0])
        )

    sticks = candidate("sticks", SHAPES[:, 0], answer=sticking, low=0.0)
    case = Case(tmp_path, 2.0 * SHAPES[:, 0], [sticks])
    near = fit(case.problem, [(sticks, {"size": 2.0})])

    best = case.next()[0]

    assert near.hypothesis[0][1]["size"] == pytest.approx(2.0, abs=0.2)
    assert size_of(best, "sticks") == pytest.approx(6.0, abs=1.0)


def with_a_ridge(size: float) -> float:
    """Has a wrong minimum in the direction of the slope, and the right one on the other side."""
    return float(np.interp(size, [-9.0, 0.0, 0.2, 2.0, 6.0], [-6.0, 0.0, -0.1, -1.7, 2.0]))


@pytest.mark.parametrize(("afar", "expected"), [((), 2.0), ((-8.0, 8.0), -3.0)])
def test_far_starts_are_fitted_if_the_effect_is_not_linear(
    tmp_path: Path, afar: tuple[float, ...], expected: float
) -> None:
    bent = candidate("bent", SHAPES[:, 0], answer=with_a_ridge, afar=afar)
    case = Case(tmp_path, -2.0 * SHAPES[:, 0], [bent])

    best = case.next()[0]

    assert size_of(best, "bent") == pytest.approx(expected, abs=0.5)


def slipping(size: float) -> float:
    """Has hardly any effect until it is large."""
    return float(np.interp(size, [0.0, 1.0, 2.0, 8.0], [0.0, 0.2, 1.0, 7.0]))


@pytest.mark.parametrize(
    ("answer", "expected"), [(slipping, [["far"], ["loud"]]), (proportional, [["loud"]])]
)
def test_more_candidates_with_far_starts_are_fitted_if_the_best_is_not_linear(
    tmp_path: Path, answer: Answer, expected: list[list[str]]
) -> None:
    loud = candidate("loud", SHAPES[:, 0] + 0.5 * SHAPES[:, 1], answer=answer)
    far = candidate(
        "far", SHAPES[:, 0], answer=lambda size: slipping(0.03 * size), afar=(15.0, 200.0)
    )
    case = Case(tmp_path, 3.0 * SHAPES[:, 0], [loud, far])

    tried = case.next(refits=1)

    assert [ids(one) for one in tried] == expected


def one_sided(size: float) -> float:
    """Has a tenth of the effect on one side, and all of it on the other."""
    return float(np.interp(size, [-9.0, 0.0, 0.2, 1.0], [9.0, 0.0, 0.015, 0.3]))


def test_far_starts_are_fitted_for_candidates_with_little_evidence_too(tmp_path: Path) -> None:
    loud = candidate("loud", SHAPES[:, 0] + 0.5 * SHAPES[:, 1])
    far = candidate("far", SHAPES[:, 0], answer=one_sided, afar=(-4.0, 4.0))
    case = Case(tmp_path, 3.0 * SHAPES[:, 0], [loud, far])

    best = case.next()[0]

    assert ids(best) == ["far"]
    assert size_of(best, "far") == pytest.approx(-3.0, abs=0.2)


def test_a_large_shift_is_found_at_the_right_end_of_a_tendon(lever_study: Study) -> None:
    """From the nominal path alone, a fit of the other end would explain more, 12 mm off."""
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
    true = replayer.replay([(moved, moved.null_values() | {"x": -0.012})]).prediction
    noise = np.random.default_rng(0).standard_normal(len(true)) * replayer.measured.noise
    replayer.measured = replace(replayer.measured, value=true + noise)
    null = replayer.residual([])
    noise_model = independent_noise(replayer.measured, np.zeros((len(null), 0)))
    problem = Problem(replayer, null, noise_model)

    best = fit_next(problem, screen(replayer, ends, null), null_fit(problem), 2)[0]

    assert best.candidates == (moved,)
    assert best.hypothesis[0][1]["x"] == pytest.approx(-0.012, abs=0.0005)


def test_more_sticky_candidates_are_fitted_if_one_explains_much(
    tmp_path: Path,
) -> None:
    loud = candidate("loud", SHAPES[:, 0] + 0.8 * SHAPES[:, 1], sticky=True)
    quiet = candidate("quiet", SHAPES[:, 0], answer=slipping, low=0.0, sticky=True)
    smooth = candidate("smooth", SHAPES[:, 0], answer=slipping, low=0.0)
    case = Case(tmp_path, SHAPES[:, 0], [loud, quiet, smooth])

    tried = case.next(refits=1)

    assert [ids(one) for one in tried] == [["quiet"], ["loud"]]


def growing(size: float) -> float:
    """Has hardly any effect until it is of three scales."""
    return float(np.interp(size, [0.0, 1.0, 4.0], [0.0, 0.02, 4.0]))


def test_the_elements_of_a_group_that_explains_much_are_fitted_alone(tmp_path: Path) -> None:
    """The slope of the right element says little, because its effect grows with its size."""
    right = candidate("damping", SHAPES[:, 0], "c", answer=growing, low=0.0)
    [size] = right.parameters
    right = replace(right, parameters=(replace(size, high=5.0),))
    others = [candidate("damping", SHAPES[:, i], name) for i, name in ((1, "a"), (2, "b"))]
    group = candidate("damping", SHAPES[:, 0] + 0.6 * SHAPES[:, 1])
    group = replace(group, location=Location("joint", ("a", "b", "c")))
    case = Case(tmp_path, 3.0 * SHAPES[:, 0], [group, *others, right])
    assert case.rank()[0].sensitivity.candidate.matches(group)

    best = case.next(refits=1)[0]

    assert best.candidates[0].location.elements == ("c",)
    assert size_of(best, "damping") == pytest.approx(3.25, abs=0.2)


def test_no_more_sticky_candidates_are_fitted_if_one_explains_little(tmp_path: Path) -> None:
    right = candidate("right", SHAPES[:, 0])
    sticking = [candidate(id, SHAPES[:, 0] + 2 * SHAPES[:, 1], sticky=True) for id in ("x", "y")]
    case = Case(tmp_path, SHAPES[:, 0], [right, *sticking])

    tried = case.next(refits=2)

    assert [ids(one) for one in tried] == [["right"], ["x"]]


@pytest.mark.parametrize("tolerances", [0, 1])
def test_a_smaller_start_is_tried_if_a_large_one_diverges(tmp_path: Path, tolerances: int) -> None:
    """The replay diverges slightly above the truth; the linear size is larger than that."""
    brittle = candidate(
        "brittle", SHAPES[:, 0], answer=lambda s: np.nan if s > 0.6 else s**1.5, low=0.0
    )
    case = Case(tmp_path, 0.5**1.5 * SHAPES[:, 0], [brittle])
    allowed = SHAPES[:, 1 : 1 + tolerances]
    case.problem = case.problem_with(allowed)
    _, sensitivity, theta = case.rank()[0]
    beyond = case.replayer.residual([(brittle, sensitivity.values(theta))])

    best = case.next()[0]

    assert np.all(np.isnan(beyond))
    assert size_of(best, "brittle") == pytest.approx(0.5, abs=0.1)
