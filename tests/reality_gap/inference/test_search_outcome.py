"""Outcome of a search: what it states of an error that no cause explains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.diagnosis import Verdict
from reality_gap.inference.outcome import Outcome
from reality_gap.inference.search_outcome import search_outcome
from reality_gap.inference.support import keep_supported
from reality_gap.inference.verdict import Options, revise_and_evaluate
from reality_gap.types import Floats
from tests.reality_gap.inference.imperfect_models import SHAPES, TIME, Case, crowd


def outcome_of(folder: Path, error: Floats, tolerances: Floats) -> Outcome:
    """Search for a cause of an error (n,), given the columns of tolerances (n, p)."""
    case = Case(folder, error, crowd(1))
    case.problem = case.problem_with(tolerances)
    options = Options(suggest=False)
    supported = keep_supported(*revise_and_evaluate(case.search(), options), options)
    return search_outcome(supported, (), options)


@pytest.mark.parametrize("deviation", [0.0, 1.5, 3.0])
def test_what_tolerances_explain_is_not_unexplained(tmp_path: Path, deviation: float) -> None:
    column = 10.0 * SHAPES[:, 4:5]

    found = outcome_of(tmp_path, deviation * column[:, 0], column)

    assert found.verdict is Verdict.NOTHING_WRONG
    assert found.score.after == found.score.before == pytest.approx(10 * deviation, abs=2.0)
    assert found.unexplained_fraction < 0.01
    assert found.explainable_fraction > 0.99


def test_what_nothing_explains_is_unexplained(tmp_path: Path) -> None:
    found = outcome_of(tmp_path, 30.0 * SHAPES[:, 4], np.zeros((len(TIME), 0)))

    assert found.verdict is Verdict.UNEXPLAINED
    assert found.unexplained_fraction > 0.9
