"""Slopes of tolerances beside a cause that changes the motion of a machine."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from reality_gap import CATALOGUE, Study
from reality_gap.inference.forward_selection import Settings, search
from reality_gap.inference.gauss_newton import Fit, rescore
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.relinearisation import relinearised
from reality_gap.inference.screening import list_candidates, screen
from reality_gap.inference.tolerances import list_tolerances, tolerance_columns
from reality_gap.simulation.replayer import Replayer
from tests.reality_gap.simulation.swing import swung

IDS = ("coulomb_friction", "viscous_friction", "link_mass", "force_scale", "armature")


def swung_whole(folder: Path) -> Study:
    """A log of a pendulum with friction of 0.2 N m, which is replayed from its begin only."""
    return swung(folder, 0.2, seconds=6.0, restart=", restart: 0")[0]


@pytest.fixture
def problem(tmp_path: Path) -> Iterator[Problem]:
    with Replayer(swung_whole(tmp_path)) as replayer:
        null = replayer.residual([])
        candidates = list_candidates(replayer.system, [CATALOGUE[id] for id in IDS])
        tolerances = list(list_tolerances(screen(replayer, candidates, null)))
        columns = tolerance_columns(replayer, tolerances, null)
        noise_model = independent_noise(replayer.measured, columns)
        yield Problem(replayer, null, noise_model, 1.0, tolerances)


def with_friction(problem: Problem, size: float) -> Fit:
    [one] = [t.candidate for t in problem.tolerances if t.candidate.cause.id == IDS[0]]
    hypothesis = [(one, one.null_values() | {"friction": size})]
    residual = problem.replayer.residual(hypothesis)
    jacobian = np.zeros((len(residual), len(one.parameters)))
    return rescore(problem, Fit(hypothesis, residual, jacobian, np.zeros(len(one.parameters)), 0.0))


def test_slopes_are_those_beside_the_cause(problem: Problem) -> None:
    fitted = with_friction(problem, 0.2)
    found = relinearised(problem, fitted)

    assert found is not None
    replayer, columns = problem.replayer, found.noise_model.tolerances
    for i, one in enumerate(problem.tolerances):
        if one.candidate.matches(fitted.candidates[0]):
            assert not columns[:, i].any()
            continue
        changed = fitted.residual - replayer.residual([one.deviation(0.1), *fitted.hypothesis])
        error = np.linalg.norm(10.0 * changed - columns[:, i])
        assert error < 0.2 * np.linalg.norm(columns[:, i])
        assert error < 0.5 * np.linalg.norm(10.0 * changed - one.column)


def test_a_cause_that_hardly_changes_the_motion_keeps_them(problem: Problem) -> None:
    assert relinearised(problem, with_friction(problem, 1e-5)) is None


def test_a_search_goes_on_with_slopes_beside_what_it_found(problem: Problem) -> None:
    replayer = problem.replayer
    candidates = list_candidates(replayer.system, [CATALOGUE[id] for id in IDS])
    sensitivities = screen(replayer, candidates, problem.null_residual)

    found = search(problem, sensitivities, Settings(most=1))

    assert [c.cause.id for c in found.best.candidates] == ["coulomb_friction"]
    assert found.relinearised
    own = relinearised(problem, found.best)
    assert own is not None
    np.testing.assert_allclose(
        found.problem.noise_model.tolerances, own.noise_model.tolerances, rtol=1e-6
    )
