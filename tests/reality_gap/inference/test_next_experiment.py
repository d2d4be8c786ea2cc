"""Next experiment: which motion is chosen, and when none is worth it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from reality_gap.causes import find_cause
from reality_gap.causes.base import Location
from reality_gap.diagnosis import Experiment
from reality_gap.inference.equivalence import Alternatives
from reality_gap.inference.gauss_newton import Fit, null_fit
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.motions import PERIOD, SECONDS
from reality_gap.inference.next_experiment import (
    Separation,
    distances,
    halves_doubt,
    next_experiment,
)
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import list_candidates, screen
from reality_gap.inference.theta import to_theta
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study

TOLERANCE = 0.2
"""Tolerance of the zero of a tension sensor [N]."""


@pytest.mark.parametrize(
    ("chances", "evidence", "expected"),
    [
        ([0.6, 0.4], [32.0], True),
        ([0.6, 0.4], [0.5], False),
        ([0.6, 0.2, 0.2], [32.0, 32.0], True),
        ([0.6, 0.2, 0.2], [32.0, 0.5], False),  # one hypothesis stays as near as it is
        ([1.0, 0.0], [0.0], False),  # no doubt is left to halve
        ([1.0], [], False),
        ([1.0 - 1e-60, 1e-60], [10.0], False),
        ([0.999, 0.0005, 0.0005], [32.0, 32.0], False),
        ([0.9, 0.005], [32.0], False),  # nearly all doubt is about what it does not decide
        ([0.95, 0.05], [32.0], True),
        ([0.8, 0.2], [32.0], True),
        ([0.8, 0.0], [32.0], False),  # the doubt is about what it does not decide
    ],
)
def test_an_experiment_has_to_halve_the_doubt(
    chances: list[float], evidence: list[float], expected: bool
) -> None:
    assert halves_doubt(np.array(chances), np.array(evidence)) is expected


def problem_of(replayer: Replayer) -> Problem:
    """Return a problem without tolerances."""
    null = replayer.residual([])
    return Problem(replayer, null, independent_noise(replayer.measured, np.zeros((len(null), 0))))


def one_cause(problem: Problem, id: str, values: dict[str, float]) -> Alternatives:
    """Return a cause at the flexor that has no alternative but its absence."""
    found = list_candidates(problem.system, [find_cause(id)])
    [candidate] = (s for s in found if s.location == Location("tendon", ("flexor",)))
    parts = [(candidate, values)]
    slopes = np.zeros((len(problem.null_residual), len(values)))
    fitted = Fit(parts, problem.replayer.residual(parts), slopes, to_theta(parts), 6.0)
    without, evidence = null_fit(problem), np.array([6.0])
    return Alternatives(candidate, without, (fitted,), np.array([0.6]), evidence, 6.0, (True,), ())


def advised(
    study: Study, id: str, values: dict[str, float], unmodelled: float = 0.0
) -> Experiment | None:
    """Advise on one cause, with tolerances of the zeros of tension sensors only."""
    with Replayer(study) as replayer:
        problem = problem_of(replayer)
        zeros = list_candidates(replayer.system, [find_cause("tension_offset")])
        found = screen(replayer, zeros, problem.null_residual)
        return next_experiment(problem, [one_cause(problem, id, values)], found, unmodelled)


def test_the_absence_of_a_cause_is_an_alternative_to_it(lever_study: Study) -> None:
    values = {"friction": 3.0, "presliding": 1e-5, "creep": 0.0}
    advice = advised(lever_study, "coulomb_friction", values)

    assert advice is not None
    assert "shows whether coulomb_friction at flexor is there" in advice.sentence
    assert advice.separation > advice.separation_before > 0.0
    assert advice.command.shape == (round(SECONDS / PERIOD), 2)


def test_whether_there_is_a_name_is_not_worth_an_experiment(lever_study: Study) -> None:
    values = {"friction": 3.0, "presliding": 1e-5, "creep": 0.0}
    assert advised(lever_study, "coulomb_friction", values, unmodelled=0.4) is None


def test_a_cause_without_doubt_needs_no_experiment(
    lever_study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No motion is replayed to find that out."""
    monkeypatch.setattr("reality_gap.inference.next_experiment.feasible_motions", None)
    values = {"friction": 3.0, "presliding": 1e-5, "creep": 0.0}
    with Replayer(lever_study) as replayer:
        problem = problem_of(replayer)
        one = one_cause(problem, "coulomb_friction", values)
        certain = replace(one, confidence=np.array([1.0]))

        assert next_experiment(problem, [certain], [], 4.5e-16) is None


def test_candidates_that_are_not_replayed_count(lever_study: Study) -> None:
    values = {"friction": 3.0, "presliding": 1e-5, "creep": 0.0}
    with Replayer(lever_study) as replayer:
        problem = problem_of(replayer)
        one, null = one_cause(problem, "coulomb_friction", values), problem.null_residual
        causes = [find_cause("viscous_friction"), find_cause("force_offset")]
        weak = list_candidates(replayer.system, causes)[:5]
        slopes = np.zeros((len(null), 1))
        others = [Fit([(s, s.null_values())], null, slopes, np.zeros(1), 0.0) for s in weak]
        confidence = np.array([0.4] + [0.12] * 5)
        several = replace(one, tried=(*one.tried, *others), confidence=confidence)

        assert next_experiment(problem, [several], []) is not None


def test_a_cause_with_hardly_any_effect_is_not_worth_an_experiment(lever_study: Study) -> None:
    values = {"friction": 1e-4, "presliding": 1e-5, "creep": 0.0}
    assert advised(lever_study, "coulomb_friction", values) is None


def test_a_cause_on_which_both_logs_agree_is_not_worth_an_experiment(lever_study: Study) -> None:
    """A zero that is off by eight tolerances is as unlikely after another minute."""
    assert advised(lever_study, "tension_offset", {"offset": 8 * TOLERANCE}) is None


def test_tolerances_are_paid_for_once_in_all_logs() -> None:
    column = np.array([[0.6], [0.8]])
    none = np.zeros((2, 0))
    log = Separation([10.0 * column[:, 0]], [none], column)
    free = Separation([10.0 * column[:, 0]], [column], column)
    diverged = Separation([np.array([np.nan, 1.0])], [none], column)

    # The gap is ten tolerances; the readings show it as well as the tolerance is known, and twice.
    np.testing.assert_allclose(distances(log) ** 2, 100 * 1 / 2)
    np.testing.assert_allclose(distances(log, log) ** 2, 100 * 2 / 3)
    np.testing.assert_allclose(distances(log, diverged), distances(log))
    # Changes of the other hypothesis' own parameters have no penalty.
    np.testing.assert_allclose(distances(free), 0.0, atol=1e-9)
