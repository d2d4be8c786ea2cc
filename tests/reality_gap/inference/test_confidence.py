"""Confidence of causes beside errors that no cause explains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.inference.confidence import MIMICRY, NEARLY, doubt_beside_unknown, doubt_of_form
from reality_gap.inference.doubts import BESIDE, FORM, NONE, UNKNOWN
from reality_gap.inference.search_outcome import search_outcome
from reality_gap.inference.support import keep_supported
from reality_gap.inference.verdict import Options, revise_and_evaluate
from tests.reality_gap.inference.imperfect_models import SHAPES, Case, crowd


def doubt(gained: list[float], left: list[float]) -> float:
    return doubt_beside_unknown(np.array(gained), np.array(left))


def test_causes_that_leave_the_noise_are_not_in_doubt() -> None:
    assert doubt([30.0, 0.1], [1.0, 0.9]) == 0.0


def test_a_cause_that_is_small_beside_what_is_left_is_in_doubt() -> None:
    assert doubt([0.5], [101.0]) == pytest.approx(MIMICRY, abs=0.01)
    assert doubt([9900.0], [101.0]) == pytest.approx(0.01 * MIMICRY)


def test_errors_of_channels_that_a_cause_does_not_change_raise_no_doubt() -> None:
    assert doubt([50.0, 0.0], [1.0, 1000.0]) == 0.0


def test_a_cause_that_takes_nothing_is_in_doubt() -> None:
    assert doubt([-1.0, 0.0], [5.0, 1.0]) == MIMICRY


def test_causes_of_nearly_the_right_form_leave_more_than_is_no_objection() -> None:
    found = [doubt_of_form(x, 1.5) for x in (0.75, 1.5, 3.0, 1500.0)]

    assert found == pytest.approx([0.0, 0.0, 0.75 * NEARLY, NEARLY], abs=1e-5)
    assert doubt_of_form(1.0, 0.0) == NEARLY


def test_a_cause_that_takes_nearly_all_is_in_doubt_where_much_is_left(tmp_path: Path) -> None:
    """Of 40 noises 8 are left, a share of 4 % of the squares."""
    error = 40.0 * SHAPES[:, 0] + 8.0 * SHAPES[:, 4]
    result = Case(tmp_path, error, crowd(1)).search()
    options = Options(suggest=False)
    supported = keep_supported(*revise_and_evaluate(result, options), options)

    [cause] = search_outcome(supported, (), options).causes

    assert 0.65 < cause.confidence < 0.72


@pytest.mark.parametrize(
    ("known", "unknown", "reasons"),
    [
        (3.0, 0.0, set()),
        (0.3, 0.0, {UNKNOWN}),
        (3.0, 3.0, {FORM, BESIDE, UNKNOWN}),
        (3.0, 10.0, {FORM, BESIDE, UNKNOWN}),
    ],
)
def test_the_confidence_of_a_cause_and_what_lowers_it_add_up_to_1(
    tmp_path: Path, known: float, unknown: float, reasons: set[str]
) -> None:
    """The likeliest doubt is for what remains where something does."""
    error = known * SHAPES[:, 0] + unknown * SHAPES[:, 4]
    result = Case(tmp_path, error, crowd(1)).search()
    options = Options(suggest=False)
    supported = keep_supported(*revise_and_evaluate(result, options), options)

    outcome = search_outcome(supported, (), options)

    [cause] = outcome.causes
    chances = [one.probability for one in cause.doubts]
    assert cause.confidence + sum(chances) == pytest.approx(1.0, abs=1e-12)
    assert chances == sorted(chances, reverse=True)
    assert {one.reason for one in cause.doubts[:1]} <= reasons
    assert bool(cause.doubts) is bool(reasons)
    together = sum(one.confidence for one in outcome.fitted_candidates)
    shared = [one.probability for one in cause.doubts if one.reason in (FORM, BESIDE, UNKNOWN)]
    none = [one.probability for one in cause.doubts if one.reason == NONE]
    assert together + sum(shared) + sum(none) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("unknown", "most"), [(0.0, 1.0), (3.0, 0.8), (10.0, 0.6)])
def test_a_partial_cause_is_doubted_by_what_it_leaves(
    tmp_path: Path, unknown: float, most: float
) -> None:
    """No candidate has the second error, and nothing can be learned of it."""
    error = 3.0 * SHAPES[:, 0] + unknown * SHAPES[:, 4]
    result = Case(tmp_path, error, crowd(1)).search()
    options = Options(suggest=False)
    supported = keep_supported(*revise_and_evaluate(result, options), options)

    [cause] = search_outcome(supported, (), options).causes

    assert most - 0.3 < cause.confidence <= most
