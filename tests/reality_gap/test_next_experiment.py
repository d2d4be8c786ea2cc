"""Tests of the choice of the next experiment."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from reality_gap.causes import cause
from reality_gap.equivalence import Alternatives
from reality_gap.fitting import Fit, to_theta
from reality_gap.motions import PERIOD, SECONDS
from reality_gap.next_experiment import halves, next_experiment
from reality_gap.screening import screen, suspects
from reality_gap.study import Study
from reality_gap.workbench import Workbench

Array = NDArray[np.float64]


@pytest.mark.parametrize(
    ("chances", "evidence", "expected"),
    [
        ([0.6, 0.4], [32.0], True),
        ([0.6, 0.4], [0.5], False),
        ([0.6, 0.2, 0.2], [32.0, 32.0], True),
        ([0.6, 0.2, 0.2], [32.0, 0.5], False),  # one rival stays as near as it is
        ([1.0, 0.0], [0.0], True),  # no doubt is left to halve
    ],
)
def test_an_experiment_has_to_promise_half_the_doubt(
    chances: list[float], evidence: list[float], expected: bool
) -> None:
    assert halves(np.array(chances), np.array(evidence)) is expected


def one_rival(bench: Workbench, null: Array, friction: float) -> Alternatives:
    """Friction of the flexor by itself, which may as well not be there."""
    [rubs] = (
        s
        for s in suspects(bench.system, [cause("coulomb_friction")])
        if s.place.elements == ("flexor",)
    )
    values = {"friction": friction, "presliding": 1e-5}
    theta = to_theta([(rubs, values)])
    fitted = Fit(
        [(rubs, values)], bench.residual([(rubs, values)]), np.zeros((len(null), 2)), theta, 6.0
    )
    return Alternatives(rubs, None, (fitted,), np.array([0.6]), np.array([6.0]), 6.0, ())


@pytest.mark.parametrize(("friction", "advised"), [(3.0, True), (1e-4, False)])
def test_that_there_is_nobody_is_a_rival_too(
    lever_study: Study, friction: float, advised: bool
) -> None:
    with Workbench(lever_study) as bench:
        null = bench.residual([])
        found = screen(bench, suspects(bench.system, [cause("length_offset")]), [], null)

        advice = next_experiment(bench, [one_rival(bench, null, friction)], found, null)

    if not advised:
        assert advice is None
        return
    assert advice is not None
    assert "shows whether coulomb_friction at flexor is there" in advice.sentence
    assert advice.separation > advice.separation_before > 0.0
    assert advice.command.shape == (round(SECONDS / PERIOD), 2)
