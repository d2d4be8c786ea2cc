"""Slopes of tolerances beside a cause that changes the motion of a machine."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from reality_gap import CATALOGUE, Study, load_study
from reality_gap.inference.forward_selection import Settings, search
from reality_gap.inference.gauss_newton import Fit, rescore
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.relinearisation import relinearised
from reality_gap.inference.screening import list_candidates, screen
from reality_gap.inference.tolerances import list_tolerances, tolerance_columns
from reality_gap.simulation.replayer import Replayer
from tests.reality_gap.simulation.swing import swung

SERVO = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>
<body pos="0 0 1"><joint name="flex" axis="0 1 0" damping="0.2" armature="0.01"/>
<geom type="capsule" fromto="0 0 0 0.15 0 0" size="0.02" mass="0.3"/></body></worldbody>
<actuator><position name="servo" joint="flex" kp="200" kv="6"/></actuator>
<sensor><jointpos name="angle" joint="flex"/></sensor></mujoco>"""
OF_SERVO = """name: servo
model: model.xml
episodes: [{commands: log.csv}]
time: {column: time, unit: s}
actuators: {servo: {column: command, unit: rad}}
sensors: {angle: {column: angle, unit: rad, noise: 5e-4}}
initial: {joints: first_reading, settle: 0}
"""
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


@pytest.mark.parametrize("gain", [0.02, 1.6])
def test_tolerances_of_forces_are_as_large_as_a_servo_is_strong(
    tmp_path: Path, gain: float
) -> None:
    time = np.arange(0.0, 4.0, 0.02)
    command = 0.3 * np.sin(5.0 * time)
    table = np.column_stack([time, command, 0.9 * command])
    header = "time,command,angle"
    np.savetxt(tmp_path / "log.csv", table, "%.9g", ",", header=header, comments="")
    (tmp_path / "model.xml").write_text(SERVO)
    (tmp_path / "STUDY.yaml").write_text(OF_SERVO)
    ids = ("position_gain", "force_offset", "coulomb_friction", "viscous_friction", "joint_offset")
    with Replayer(load_study(tmp_path / "STUDY.yaml")) as replayer:
        null = replayer.residual([])
        candidates = list_candidates(replayer.system, [CATALOGUE[id] for id in ids])
        tolerances = list(list_tolerances(screen(replayer, candidates, null)))
        columns = tolerance_columns(replayer, tolerances, null)
        noise_model = independent_noise(replayer.measured, columns)
        problem = Problem(replayer, null, noise_model, 1.0, tolerances)
        [one] = [t.candidate for t in tolerances if t.candidate.cause.id == "position_gain"]
        hypothesis = [(one, {"excess": gain - 1.0})]
        residual = replayer.residual(hypothesis)
        fitted = Fit(hypothesis, residual, np.zeros((len(residual), 1)), np.zeros(1), 0.0)

        found = relinearised(problem, fitted)

        assert found is not None
        for i, one in enumerate(tolerances):
            if one.candidate.cause.id == "position_gain":
                continue
            beside = fitted.residual - replayer.residual([one.deviation(0.1), *hypothesis])
            size = float(np.linalg.norm(10.0 * beside))
            own = float(np.linalg.norm(found.noise_model.tolerances[:, i]))
            before = float(np.linalg.norm(columns[:, i]))
            assert min(size, gain * size) * 0.99 <= own <= max(size, gain * size) * 1.01
            if gain < 1.0 and one.candidate.cause.id == "force_offset":
                assert size > 20.0 * before
                assert own < 1.5 * before
