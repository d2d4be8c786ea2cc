"""Slopes of tolerances beside a cause that changes the motion of a machine."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import CATALOGUE, Options, Study, diagnose, load_study
from reality_gap.inference.forward_selection import Settings, search
from reality_gap.inference.gauss_newton import Fit, rescore
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.relinearisation import relinearised
from reality_gap.inference.screening import list_candidates, screen
from reality_gap.inference.tolerances import list_tolerances, tolerance_columns
from reality_gap.simulation.replayer import Replayer

PENDULUM = """<mujoco><option timestep="0.002"/><worldbody><body pos="0 0 1">
<joint name="pivot" axis="0 1 0" frictionloss="{friction}"/>
<inertial pos="0 0 -0.43" mass="0.675" diaginertia="0.0033 0.0033 0.0007"/></body></worldbody>
<actuator><motor name="motor" joint="pivot" ctrlrange="-12 12"/></actuator>
<sensor><jointpos name="angle" joint="pivot"/></sensor></mujoco>"""
STUDY = """name: pendulum
model: model.xml
episodes: [{commands: log.csv}]
time: {column: time, unit: s}
actuators: {motor: {column: torque, unit: N m}}
sensors: {angle: {column: angle, unit: rad, noise: 1e-3}}
initial: {joints: first_reading, settle: 0, restart: 0}
"""
IDS = ("coulomb_friction", "viscous_friction", "link_mass", "force_scale", "armature")


def swung(folder: Path, friction: float, seconds: float = 6.0) -> Study:
    """A log of a pendulum that motors swing without feedback; its model has no friction."""
    (folder / "model.xml").write_text(PENDULUM.format(friction=0.0))
    (folder / "STUDY.yaml").write_text(STUDY)
    real = mujoco.MjModel.from_xml_string(PENDULUM.format(friction=friction))
    data, rng, rows = mujoco.MjData(real), np.random.default_rng(0), []
    for t in np.arange(0.0, seconds, 0.004):
        data.ctrl[0] = 1.6 * np.sin(2.0 * t) + 1.1 * np.sin(3.1 * t + 1.0) + 0.5 * np.sin(5.3 * t)
        rows.append([t, data.ctrl[0], data.qpos[0] + 1e-3 * rng.standard_normal()])
        mujoco.mj_step(real, data, 2)
    np.savetxt(folder / "log.csv", rows, "%.9g", ",", header="time,torque,angle", comments="")
    return load_study(folder / "STUDY.yaml")


@pytest.fixture
def problem(tmp_path: Path) -> Iterator[Problem]:
    with Replayer(swung(tmp_path, 0.2)) as replayer:
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


def test_friction_that_ends_a_free_swing_is_the_only_cause(tmp_path: Path) -> None:
    causes = [CATALOGUE[id] for id in IDS]
    found = diagnose(swung(tmp_path, 0.2), causes=causes, options=Options(suggest=False))

    [cause] = found.causes
    assert cause.candidate.cause.id == "coulomb_friction"
    assert cause.parameters["friction"].value == pytest.approx(0.2, rel=0.15)
    assert found.rms_after < 0.05 * found.rms_before
