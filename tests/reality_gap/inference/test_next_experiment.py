"""Tests of the choice of the next experiment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reality_gap.causes import cause
from reality_gap.diagnosis import Experiment
from reality_gap.inference.equivalence import Alternatives
from reality_gap.inference.gauss_newton import Fit, to_theta
from reality_gap.inference.motions import PERIOD, SECONDS
from reality_gap.inference.next_experiment import Apart, distances, halves, next_experiment
from reality_gap.inference.screening import candidates, screen
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.types import Floats

TOLERANCE = 0.2
"""Of the zero of a tension sensor [N]."""


@pytest.mark.parametrize(
    ("chances", "evidence", "expected"),
    [
        ([0.6, 0.4], [32.0], True),
        ([0.6, 0.4], [0.5], False),
        ([0.6, 0.2, 0.2], [32.0, 32.0], True),
        ([0.6, 0.2, 0.2], [32.0, 0.5], False),  # one rival stays as near as it is
        ([1.0, 0.0], [0.0], True),  # no doubt is left to halve
        ([0.8, 0.2], [32.0], True),
        ([0.8, 0.0], [32.0], False),  # the doubt is about what it tells nothing of
    ],
)
def test_an_experiment_has_to_promise_half_the_doubt(
    chances: list[float], evidence: list[float], expected: bool
) -> None:
    assert halves(np.array(chances), np.array(evidence)) is expected


def one_candidate(
    replayer: Replayer, null: Floats, id: str, values: dict[str, float]
) -> Alternatives:
    """A cause at the flexor by itself, which may as well not be there."""
    everyone = candidates(replayer.system, [cause(id)])
    [candidate] = (s for s in everyone if s.location.elements == ("flexor",))
    parts = [(candidate, values)]
    slopes = np.zeros((len(null), len(values)))
    fitted = Fit(parts, replayer.residual(parts), slopes, to_theta(parts), 6.0)
    return Alternatives(candidate, None, (fitted,), np.array([0.6]), np.array([6.0]), 6.0, ())


def advised(
    study: Study, id: str, values: dict[str, float], unmodelled: float = 0.0
) -> Experiment | None:
    """Where nothing but the zeros of tension sensors may be off."""
    with Replayer(study) as replayer:
        null = replayer.residual([])
        found = screen(replayer, candidates(replayer.system, [cause("tension_offset")]), [], null)
        fitted_candidates = [one_candidate(replayer, null, id, values)]
        return next_experiment(replayer, fitted_candidates, found, null, unmodelled)


def test_that_there_is_nobody_is_a_rival_too(lever_study: Study) -> None:
    advice = advised(lever_study, "coulomb_friction", {"friction": 3.0, "presliding": 1e-5})

    assert advice is not None
    assert "shows whether coulomb_friction at flexor is there" in advice.sentence
    assert advice.separation > advice.separation_before > 0.0
    assert advice.command.shape == (round(SECONDS / PERIOD), 2)


def test_whether_there_is_a_name_is_not_worth_an_experiment(lever_study: Study) -> None:
    values = {"friction": 3.0, "presliding": 1e-5}
    assert advised(lever_study, "coulomb_friction", values, unmodelled=0.4) is None


def test_rivals_that_are_not_replayed_count(lever_study: Study) -> None:
    values = {"friction": 3.0, "presliding": 1e-5}
    with Replayer(lever_study) as replayer:
        null = replayer.residual([])
        one = one_candidate(replayer, null, "coulomb_friction", values)
        weak = candidates(replayer.system, [cause("viscous_friction"), cause("force_offset")])[:5]
        slopes = np.zeros((len(null), 1))
        others = [Fit([(s, s.nulls())], null, slopes, np.zeros(1), 0.0) for s in weak]
        confidence = np.array([0.4] + [0.12] * 5)
        fitted_candidates = replace(one, tried=(*one.tried, *others), confidence=confidence)

        assert next_experiment(replayer, [fitted_candidates], [], null) is not None


def test_what_can_hardly_be_felt_is_not_worth_an_experiment(lever_study: Study) -> None:
    assert advised(lever_study, "coulomb_friction", {"friction": 1e-4, "presliding": 1e-5}) is None


def test_what_both_logs_would_say_alike_is_not_worth_an_experiment(lever_study: Study) -> None:
    """A zero that is off by eight tolerances is as unlikely after a minute more."""
    assert advised(lever_study, "tension_offset", {"offset": 8 * TOLERANCE}) is None


def test_tolerances_are_paid_for_once_in_all_logs() -> None:
    slack = np.array([[0.6], [0.8]])
    none = np.zeros((2, 0))
    log = Apart([10.0 * slack[:, 0]], [none], slack)
    free = Apart([10.0 * slack[:, 0]], [slack], slack)
    broken = Apart([np.array([np.nan, 1.0])], [none], slack)

    # A gap of ten tolerances that readings show 1 and 2 times as well as the tolerance is known.
    np.testing.assert_allclose(distances(2, log) ** 2, 100 * 1 / 2)
    np.testing.assert_allclose(distances(2, log, log) ** 2, 100 * 2 / 3)
    np.testing.assert_allclose(distances(2, log, broken), distances(2, log))
    # What the other's own parameters can do costs nothing.
    np.testing.assert_allclose(distances(2, free), 0.0, atol=1e-9)
