"""Periods with which a residual repeats, and fits of events that repeat."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reality_gap.causes.base import SearchHints
from reality_gap.causes.external_force import CAUSE, REGULAR, periods_of
from reality_gap.inference.gauss_newton import Fit, null_fit
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.refinement import fit_next
from reality_gap.inference.repetition import repeating_periods
from reality_gap.inference.screening import screen
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Reading, Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import System, compile_system
from reality_gap.types import Floats
from tests.reality_gap.causes.machines import arm_study, elbow_study

SECONDS = 8.0
OF_COMMAND = 2 * np.pi / 5.0
"""Period of the first command of the arm [s]."""


def arm(folder: Path, seconds: float) -> Study:
    """A log of an arm with encoders of 1 mrad."""
    study, noise = arm_study(folder, seconds), {"p": 1e-3, "v": 0.02, "f": 0.05}
    channels = tuple(replace(c, noise=noise[c.name[0]]) for c in study.channels)
    return replace(study, channels=channels)


def residual(study: Study, period: float, size: float, each: bool = False) -> Floats:
    """Noise, and bumps of 0.1 s with a period through the study or in each episode."""
    readings = measured(study)
    starts = np.cumsum([0.0, *(e.duration for e in study.episodes)])
    time = readings.time + (0.0 if each else starts[readings.episode])
    noise = np.random.default_rng(0).normal(size=len(time))
    return np.asarray(noise + size * ((time - 0.3) % period < 0.1))


def found(study: Study, residual: Floats, through: bool = True) -> tuple[float, ...]:
    total = study.duration if through else study.episodes[0].duration
    hints = SearchHints(periods_of(total), period="study" if through else "episode")
    return repeating_periods(study, measured(study), residual, hints)


@pytest.mark.parametrize("period", [0.31, 0.9, 2.1])
def test_the_period_of_bumps_is_found(tmp_path: Path, period: float) -> None:
    study = arm(tmp_path, SECONDS)

    best, *_ = found(study, residual(study, period, 2.0))

    assert 1 / best == pytest.approx(1 / period, abs=0.25 / SECONDS)


def test_noise_has_no_period(tmp_path: Path) -> None:
    study = arm(tmp_path, SECONDS)

    assert found(study, residual(study, 1.0, 0.0)) == ()


def test_the_period_of_the_motion_is_left_out(tmp_path: Path) -> None:
    """What repeats with the motion may be an effect of the motion."""
    study = arm(tmp_path, SECONDS)

    periods = found(study, residual(study, OF_COMMAND, 2.0))

    assert all(abs(1 / p - 1 / OF_COMMAND) > 0.4 / SECONDS for p in periods)


@pytest.mark.parametrize("each", [False, True])
def test_times_are_counted_through_the_study_or_in_each_episode(tmp_path: Path, each: bool) -> None:
    study = elbow_study(tmp_path, 5.2)
    bumps = residual(study, 0.7, 2.0, each)

    best = found(study, bumps, through=not each)[:1]
    other = found(study, bumps, through=each)[:1]

    assert best == pytest.approx([0.7], abs=0.02)
    assert other != best


def candidates(system: System) -> list[Candidate]:
    """A single push and a train of pushes at the end."""
    return [Candidate(CAUSE, p, CAUSE.parameters(system, p)) for p in CAUSE.locations(system)]


def log_of(study: Study, hypothesis: Hypothesis) -> Study:
    """The log of a machine of a hypothesis, with noise."""
    with Replayer(study, 1) as replayer:
        readings, rng = replayer.measured, np.random.default_rng(0)
        errors = rng.normal(size=len(readings.value)) - replayer.residual(hypothesis)
    [episode] = study.episodes
    values = np.split(readings.value + readings.noise * errors, len(episode.readings))
    logged = zip(episode.readings, values, strict=True)
    new = tuple(Reading(reading.time, value) for reading, value in logged)
    return replace(study, episodes=(replace(episode, readings=new),))


def fits(study: Study, one: Candidate, values: dict[str, float]) -> list[Fit]:
    """Fits of both candidates to a log of one of them, best first."""
    truth = [(one, one.null_values() | values)]
    with Replayer(log_of(study, truth), 1) as replayer:
        null = replayer.residual([])
        noise = independent_noise(replayer.measured, np.zeros((len(null), 0)))
        problem = Problem(replayer, null, noise)
        sensitivities = screen(replayer, candidates(replayer.system), null)
        return list(fit_next(problem, sensitivities, null_fit(problem), 2))


def test_a_train_of_pushes_is_fitted_with_its_period(tmp_path: Path) -> None:
    """It begins in its second period."""
    study = arm(tmp_path, 5.0)
    _, train = candidates(compile_system(study))
    values = {"z": -2.0, "start": 1.1, "duration": 0.2, "period": 0.9}

    best, *_ = fits(study, train, values)

    [(candidate, fitted)] = best.hypothesis
    assert candidate.location.note == REGULAR
    assert fitted["period"] == pytest.approx(0.9, abs=0.005)
    assert fitted["start"] == pytest.approx(1.1, abs=0.02)
    assert fitted["duration"] == pytest.approx(0.2, abs=0.05)
    assert fitted["z"] == pytest.approx(-2.0, abs=0.4)


def test_a_single_push_is_no_train(tmp_path: Path) -> None:
    study = arm(tmp_path, 5.0)
    single, _ = candidates(compile_system(study))

    best, *others = fits(study, single, {"z": -2.0, "start": 1.6, "duration": 0.3})

    assert best.candidates[0].location.note == ""
    assert all(best.evidence > one.evidence + 20.0 for one in others)


def test_a_log_that_does_not_repeat_costs_no_replays(tmp_path: Path) -> None:
    study = arm(tmp_path, 3.0)
    with Replayer(log_of(study, []), 1) as replayer:
        [_, train] = candidates(replayer.system)

        assert screen(replayer, [train], replayer.residual([])) == ()
