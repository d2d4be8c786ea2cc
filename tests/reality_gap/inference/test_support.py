"""Causes that are less likely than not, on a machine at rest whose sensor has their errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.diagnosis import Verdict
from reality_gap.inference.paying import UNLIKELY, keep_paying, without_cause
from reality_gap.inference.search_outcome import search_outcome
from reality_gap.inference.support import Supported, keep_supported
from reality_gap.inference.verdict import OTHERS, Options, remainder_of
from reality_gap.simulation.hypothesis import Candidate
from tests.reality_gap.inference.imperfect_models import SHAPES, Case, candidate, crowd, ids

OPTIONS = Options(suggest=False, guess=1e6)
"""In which all causes must be likelier than not, whatever their evidence."""


def supported(case: Case, options: Options = OPTIONS) -> Supported:
    paying = keep_paying(case.search())
    return keep_supported(paying, remainder_of(paying), options)


def guesses(own: float = 1.5) -> list[Candidate]:
    """Return candidates that share an error, each with one of its own beside it."""
    return [candidate(id, SHAPES[:, 0] + own * SHAPES[:, i + 1]) for i, id in enumerate("abcd")]


def tolerated(folder: Path, error: np.ndarray, chosen: list[Candidate]) -> Case:
    """Return a case whose tolerances explain all errors but the first and the last."""
    case = Case(folder, error, chosen)
    case.problem = case.problem_with(10.0 * SHAPES[:, 1:5])
    return case


def test_one_guess_of_four_is_not_named(tmp_path: Path) -> None:
    """Each predicts something else, but tolerances excuse what it gets wrong."""
    case = tolerated(tmp_path, 0.8 * SHAPES[:, 0], guesses())
    result = case.search()
    [likeliest] = result.best.candidates
    assert not keep_paying(result).result.best.is_null

    found = supported(case)

    assert found.paying.result.best.is_null
    assert [(one.candidate, one.reason) for one in found.paying.dropped] == [(likeliest, UNLIKELY)]
    [criterion] = found.criteria
    assert not criterion.met
    assert 0.2 < criterion.value < OPTIONS.likely
    before, after = (one.problem.noise_model.inflation for one in (result, found.paying.result))
    np.testing.assert_array_equal(before, after)
    outcome = search_outcome(found, (), OPTIONS)
    assert outcome.verdict is Verdict.UNEXPLAINED
    assert not outcome.causes
    assert [one.candidate for one in outcome.rejected] == [likeliest]
    assert criterion in outcome.criteria
    assert outcome.objection == OTHERS


@pytest.mark.parametrize(("guess", "named"), [(20.0, True), (200.0, False)])
def test_a_guess_with_much_evidence_keeps_its_low_confidence(
    tmp_path: Path, guess: float, named: bool
) -> None:
    options = replace(OPTIONS, guess=guess)
    found = supported(tolerated(tmp_path, 0.6 * SHAPES[:, 0], guesses()), options)

    causes = search_outcome(found, (), options).causes

    assert len(causes) == named
    assert all(0.2 < cause.confidence < options.likely for cause in causes)
    [criterion] = found.criteria
    assert criterion.met == named == (criterion.value >= criterion.threshold)


def test_no_evidence_suffices_for_what_is_hardly_possible(tmp_path: Path) -> None:
    """A leg's gravity compensation was named with a confidence of 0 %."""
    options = replace(OPTIONS, guess=20.0, possible=0.45)
    found = supported(tolerated(tmp_path, 0.6 * SHAPES[:, 0], guesses()), options)

    assert found.paying.result.best.is_null
    [criterion] = found.criteria
    assert criterion.name.startswith("support")
    assert criterion.value < criterion.threshold == 0.45


def test_guesses_that_chance_makes_as_likely_are_no_gap(tmp_path: Path) -> None:
    """Options ask for more evidence than they have."""
    found = supported(tolerated(tmp_path, 0.4 * SHAPES[:, 0], guesses(3.0)))
    assert found.paying.result.best.is_null

    few, many = (search_outcome(found, (), replace(OPTIONS, certain=x)) for x in (10.0, 1000.0))

    assert (few.verdict, few.objection) == (Verdict.UNEXPLAINED, OTHERS)
    assert many.verdict is Verdict.NOTHING_WRONG


def test_a_cause_counts_with_those_that_predict_the_same(tmp_path: Path) -> None:
    alike = [candidate(id, SHAPES[:, 0] + 0.01 * SHAPES[:, i]) for i, id in enumerate("abcd")]

    found = supported(Case(tmp_path, 0.8 * SHAPES[:, 0], alike))

    [named] = found.alternatives
    assert named.right < OPTIONS.likely < 0.95 < named.support
    assert len(named.equivalent) == 3
    assert [one.met for one in found.criteria] == [True]


def test_a_likely_cause_is_named_beside_a_guess_that_is_dropped(tmp_path: Path) -> None:
    clear = candidate("clear", SHAPES[:, 5])
    error = 0.8 * SHAPES[:, 0] + 1.2 * SHAPES[:, 5]
    case = tolerated(tmp_path, error, [clear, *guesses()])
    assert len(ids(case.search().best)) == 2

    found = supported(case)

    assert ids(found.paying.result.best) == ["clear"]
    assert len(found.paying.dropped) == 1
    assert [one.met for one in found.criteria] == [True, False]


@pytest.mark.parametrize(("more", "named"), [(-5.0, ["a"]), (5.0, [])])
def test_a_cause_is_less_likely_than_errors_that_are_learned_better(
    tmp_path: Path, more: float, named: list[str]
) -> None:
    """5 nats are too few to refute the cause."""
    paying = keep_paying(Case(tmp_path, 0.8 * SHAPES[:, 0], crowd(3)).search())
    remainder = remainder_of(paying)
    learned = replace(
        remainder.instead, evidence=paying.result.best.evidence + remainder.learned.evidence + more
    )

    found = keep_supported(paying, replace(remainder, instead=learned), OPTIONS)

    assert ids(found.paying.result.best) == named


def test_no_other_takes_the_turn_of_a_guess(tmp_path: Path) -> None:
    case = tolerated(tmp_path, 0.8 * SHAPES[:, 0], guesses())
    paying = keep_paying(case.search())

    found = without_cause(paying, 0, UNLIKELY)

    assert found.result.best.is_null
    assert (found.attempt, found.attempted) == (paying.attempt, paying.attempted)
