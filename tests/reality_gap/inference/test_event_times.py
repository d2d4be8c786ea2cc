"""Times of events, and effects whose slope at the null tells nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes import CATALOGUE
from reality_gap.inference.folds import Folds
from reality_gap.inference.forward_selection import polish
from reality_gap.inference.gauss_newton import Fit, null_fit, rescore, start_penalty
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.ranking import rank
from reality_gap.inference.refinement import fit_next
from reality_gap.inference.screening import screen
from reality_gap.inference.theta import is_tolerable, to_theta
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.simulation.synthetic import simulate_study
from reality_gap.study.data import Study
from reality_gap.study.system import compile_system
from tests.reality_gap.causes.machines import arm_study, elbow_study, pushed_screw


def problem_of(replayer: Replayer) -> Problem:
    null = replayer.residual([])
    return Problem(replayer, null, independent_noise(replayer.measured, np.zeros((len(null), 0))))


def candidate(study: Study, id: str, kind: str, elements: int) -> Candidate:
    cause, system = CATALOGUE[id], compile_system(study)
    location = next(
        p for p in cause.locations(system) if p.kind == kind and len(p.elements) == elements
    )
    return Candidate(cause, location, cause.parameters(system, location))


def found(study: Study, one: Candidate, values: dict[str, float]) -> tuple[float, Fit]:
    """Linear evidence and fit of a candidate whose effect is in the data."""
    truth = simulate_study(study, [(one, one.null_values() | values)], np.random.default_rng(0))
    with Replayer(truth) as replayer:
        problem = problem_of(replayer)
        sensitivities = screen(replayer, [one], problem.null_residual)
        base = null_fit(problem)
        evidence = rank(problem, sensitivities, base)[0].evidence
        return evidence, polish(problem, fit_next(problem, sensitivities, base, 1), base)[0]


def test_edges_that_were_fitted_beside_large_noise_are_searched_again(tmp_path: Path) -> None:
    study = pushed_screw(tmp_path, 4.1, 7.3)
    push = candidate(study, "external_force", "body", 1)
    values = push.null_values() | {"x": 40.0, "start": 4.6, "duration": 2.2}
    with Replayer(study) as replayer:
        problem, base = problem_of(replayer), null_fit(problem_of(replayer))
        theta = to_theta([(push, values)])
        residual = replayer.residual([(push, values)])
        rough = Fit([(push, values)], residual, np.zeros((len(residual), len(theta))), theta, 0.0)
        [found] = polish(problem, [rescore(problem, rough)], base)
    times = found.hypothesis[0][1]
    assert times["start"] == pytest.approx(4.1, abs=0.05)
    assert times["start"] + times["duration"] == pytest.approx(7.3, abs=0.05)


def test_a_long_push_is_screened_as_several_short_ones_in_a_row(tmp_path: Path) -> None:
    study = pushed_screw(tmp_path, 4.1, 7.3)
    push = candidate(study, "external_force", "body", 1)
    with Replayer(study) as replayer:
        null = replayer.residual([])
        found = screen(replayer, [push], null)
        long = [s for s in found if s.fixed["duration"] > 1.0]
        assert long
        for one in long[:: len(long) // 5]:
            force = {"x": push.parameter("x").scale}
            replayed = null - replayer.residual([(push, {**one.fixed, **force})])
            own = one.columns[:, one.names.index("x")]
            assert np.linalg.norm(own - replayed) < 0.01 * np.linalg.norm(replayed)


@pytest.mark.parametrize(("start", "duration"), [(0.8, 1.4)])
def test_the_end_of_a_push_is_found_as_its_start_is(
    tmp_path: Path, start: float, duration: float
) -> None:
    study = arm_study(tmp_path, 3.0)
    push = candidate(study, "external_force", "body", 1)
    force = {"x": 1.0, "y": 0.0, "z": -2.0}

    _, fit = found(study, push, force | {"start": start, "duration": duration})

    values = fit.hypothesis[0][1]
    assert values["start"] == pytest.approx(start, abs=0.02)
    assert values["duration"] == pytest.approx(duration, abs=0.05)
    assert values["z"] == pytest.approx(-2.0, abs=0.3)


@pytest.mark.parametrize("time", [0.37, 1.48, 2.6])
def test_the_moment_of_an_elongation_is_found_and_pays(tmp_path: Path, time: float) -> None:
    """It is known from one block of readings only, from which the others do not predict it."""
    study = elbow_study(tmp_path)
    longer = candidate(study, "wire_elongation", "tendon", 1)
    values = {"elongation": 4e-4, "time": time}
    truth = simulate_study(study, [(longer, values)], np.random.default_rng(0), 1.0 / 16.0)
    with Replayer(truth) as replayer:
        problem = problem_of(replayer)
        sensitivities, base = screen(replayer, [longer], problem.null_residual), null_fit(problem)
        fit = polish(problem, fit_next(problem, sensitivities, base, 1), base)[0]
        gain = Folds(problem, fit).cross_validated(base)

    fitted = fit.hypothesis[0][1]
    assert fitted["time"] == pytest.approx(time, abs=0.01)
    assert fitted["elongation"] == pytest.approx(4e-4, rel=0.1)
    assert 0.5 * fit.evidence < gain.low < gain.value


def test_a_delay_of_39_ms_is_screened_and_fitted(tmp_path: Path) -> None:
    study = elbow_study(tmp_path)
    late = candidate(study, "delay", "actuator", 3)

    evidence, fit = found(study, late, {"delay": 0.039})

    assert evidence > 100.0
    assert fit.hypothesis[0][1]["delay"] == pytest.approx(0.039, abs=0.002)


def test_a_limit_that_was_never_reached_is_screened_and_fitted(tmp_path: Path) -> None:
    """At the nominal limit the slope is 0."""
    study = arm_study(tmp_path)
    limit = candidate(study, "force_limit", "actuator", 1)

    evidence, fit = found(study, limit, {"limit": 3.0})

    assert evidence > 100.0
    assert fit.hypothesis[0][1]["limit"] == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(
    ("id", "kind", "note", "least"),
    [
        ("delay", "actuator", "", 0.6),
        ("delay", "sensor", "", 0.6),
        ("actuator_lag", "actuator", "of the command", 1.0),
    ],
)
def test_times_below_what_a_time_step_resolves_are_no_causes(
    tmp_path: Path, id: str, kind: str, note: str, least: float
) -> None:
    """A delay of 0.77 steps is one; a step does not resolve a filter that is faster."""
    study = elbow_study(tmp_path)
    system, step = compile_system(study), study.spec().option.timestep
    found = [x for x in CATALOGUE[id].locations(system) if x.kind == kind and x.note == note]

    assert found
    for location in found:
        [parameter] = CATALOGUE[id].parameters(system, location)
        assert parameter.least == pytest.approx(least * step)


@pytest.mark.parametrize(("steps", "tolerable"), [(0.5, True), (1.0, False)])
def test_a_deviation_that_every_good_model_has_is_no_cause(
    tmp_path: Path, steps: float, tolerable: bool
) -> None:
    """However precise the data are, a delay of half a time step is that of an integrator."""
    study = elbow_study(tmp_path)
    late = candidate(study, "delay", "actuator", 3)
    delay = {"delay": steps * study.spec().option.timestep}
    with Replayer(simulate_study(study, [(late, delay)], np.random.default_rng(0))) as replayer:
        problem = problem_of(replayer)
        exact = 1e3 * replayer.residuals([[], [(late, delay)]])[0]
        problem = Problem(replayer, exact, problem.noise_model)
        theta = np.array([delay["delay"] / late.parameters[0].scale])
        fit = Fit([(late, delay)], 0.0 * exact, np.ones((len(exact), 1)), theta, 0.0)

        assert is_tolerable(late, delay) is tolerable
        assert (rescore(problem, fit).evidence <= 0.0) is tolerable


def test_causes_that_explain_anything_a_little_need_more_evidence(tmp_path: Path) -> None:
    study = arm_study(tmp_path)
    push = candidate(study, "external_force", "body", 1)
    single = candidate(study, "delay", "actuator", 1)
    both = candidate(study, "delay", "actuator", 2)

    odds = [one.cause.prior(one.location) for one in (push, single, both)]

    assert odds[0] <= odds[1] < odds[2] == 0.0
    assert start_penalty(single) == pytest.approx(-odds[1])
