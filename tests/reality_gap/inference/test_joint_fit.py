"""Joint fit of what a person would free at a machine that is wrong by many noises."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from reality_gap import CATALOGUE, Options, Study, diagnose, load_study
from reality_gap.inference.calibration import calibrate
from reality_gap.inference.descent import descend
from reality_gap.inference.equivalence import alternatives
from reality_gap.inference.forward_selection import Search, Settings, Step, search
from reality_gap.inference.gauss_newton import Fit, fit
from reality_gap.inference.joint_fit import USUAL, eliminated, joint_fit
from reality_gap.inference.joint_search import JointSearch, extending
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.relinearisation import relinearised
from reality_gap.inference.screening import Sensitivity, list_candidates, screen
from reality_gap.inference.theta import is_tolerable
from reality_gap.inference.tolerances import list_tolerances, tolerance_columns
from reality_gap.simulation.hypothesis import Hypothesis
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.splits import REPORT, split
from reality_gap.types import Floats

MODEL = """<mujoco><option timestep="{step}" integrator="implicitfast"/><worldbody>
<body pos="0 0 1"><joint name="flex" axis="0 1 0" damping="{damping}" armature="{rotor}"
frictionloss="{friction}"/><geom type="capsule" fromto="0 0 0 0.15 0 0" size="0.02" mass="0.3"/>
</body></worldbody>
<actuator><position name="servo" joint="flex" kp="{kp}" kv="{kv}"/></actuator>
<sensor><jointpos name="angle" joint="flex"/></sensor></mujoco>"""
STUDY = """name: servo
model: model.xml
episodes: [{commands: log.csv}]
time: {column: time, unit: s}
actuators: {servo: {column: command, unit: rad}}
sensors: {angle: {column: angle, unit: rad, noise: 5e-4}}
initial: {joints: first_reading, settle: 0}
"""
NOMINAL = {"damping": 0.6, "rotor": 0.03, "friction": 0.0, "kp": 400.0, "kv": 8.0}
REAL = {"damping": 0.1, "rotor": 0.02, "friction": 0.25, "kp": 9.0, "kv": 0.4}
STRONG = {"damping": 0.1, "rotor": 0.005, "friction": 0.1, "kp": 25.0, "kv": 1.0}
WEAK = {"damping": 0.05, "rotor": 0.004, "friction": 0.03, "kp": 0.5, "kv": 0.05}


def soft_servo(
    folder: Path,
    nominal: dict[str, float] = NOMINAL,
    machine: dict[str, float] = REAL,
    seconds: float = 8.0,
) -> Study:
    """A log of a servo that is softer than drawn; by default, its friction was not drawn."""
    (folder / "model.xml").write_text(MODEL.format(step=0.002, **nominal))
    (folder / "STUDY.yaml").write_text(STUDY)
    real = mujoco.MjModel.from_xml_string(MODEL.format(step=0.0005, **machine))
    data, rng, rows = mujoco.MjData(real), np.random.default_rng(0), []
    for k, t in enumerate(np.arange(0.0, seconds, 0.02)):
        step = 0.4 * float(rng.uniform(-1.0, 1.0)) if k % 60 == 0 else rows[-1][1]
        rows.append([t, step, data.qpos[0] + 5e-4 * rng.standard_normal()])
        data.ctrl[0] = step + 0.2 * np.sin(3.0 * t)
        rows[-1].append(data.ctrl[0])
        mujoco.mj_step(real, data, 40)
    table = np.array(rows)[:, [0, 3, 2]]
    np.savetxt(folder / "log.csv", table, "%.9g", ",", header="time,command,angle", comments="")
    return load_study(folder / "STUDY.yaml")


def problem_of(replayer: Replayer) -> Problem:
    null = replayer.residual([])
    return Problem(replayer, null, independent_noise(replayer.measured, np.zeros((len(null), 0))))


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Problem]:
    with Replayer(soft_servo(tmp_path_factory.mktemp("servo"))) as replayer:
        yield problem_of(replayer)


@pytest.fixture(scope="module")
def weak(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Problem]:
    with Replayer(soft_servo(tmp_path_factory.mktemp("weak"), STRONG, WEAK, 4.0)) as replayer:
        yield problem_of(replayer)


def screened(problem: Problem) -> list[Sensitivity]:
    candidates = list_candidates(problem.system, [CATALOGUE[id] for id in USUAL])
    return list(screen(problem.replayer, candidates, problem.null_residual))


def chain_of(problem: Problem, screens: Sequence[Sensitivity]) -> list[Fit]:
    joint = joint_fit(problem, screens, [[]])
    assert joint is not None
    return eliminated(problem, joint, 3.0)


@pytest.fixture(scope="module")
def chain(problem: Problem) -> list[Fit]:
    return chain_of(problem, screened(problem))


def test_large_causes_are_fitted_together(problem: Problem, chain: list[Fit]) -> None:
    best = {candidate.cause.id: values for candidate, values in chain[-1].hypothesis}
    gain = NOMINAL["kp"] * (1.0 + best["position_gain"]["excess"])
    friction = best["coulomb_friction"]["friction"]
    assert friction / gain == pytest.approx(REAL["friction"] / REAL["kp"], rel=0.1)
    assert "link_mass" not in best
    left = float(np.sqrt(np.mean(chain[-1].residual ** 2)))
    assert left < 0.05 * float(np.sqrt(np.mean(problem.null_residual**2)))


def test_each_fit_has_one_cause_more_that_adds_enough(chain: list[Fit]) -> None:
    assert [len(fitted.hypothesis) for fitted in chain] == list(range(1, len(chain) + 1))
    for fewer, more in itertools.pairwise(chain):
        assert set(fewer.candidates) < set(more.candidates)
    assert chain[-1].evidence - chain[-2].evidence > 3.0


def test_a_servo_that_is_fifty_times_weaker_is_predicted_to_the_noise(
    weak: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Starts whose replays diverge do no harm."""
    exact = weak.replayer.residuals

    def diverging(hypotheses: Sequence[Hypothesis]) -> list[Floats]:
        found = exact(hypotheses)
        for one, residual in zip(hypotheses, found, strict=True):
            if any(c.cause.id == "position_gain" and v["excess"] > 8.0 for c, v in one):
                residual[len(residual) // 2 :] = np.nan
        return found

    screens = screened(weak)
    monkeypatch.setattr(weak.replayer, "residuals", diverging)
    monkeypatch.setattr(weak.replayer, "residual", lambda one: diverging([one])[0])

    best = chain_of(weak, screens)[-1]

    # What every good model may have is no cause.
    assert not any(is_tolerable(*part) for part in best.hypothesis)
    assert best.evidence == best.raw_evidence > 0.0
    found = {candidate.cause.id: values for candidate, values in best.hypothesis}
    assert float(np.sqrt(np.mean(best.residual**2))) < 1.5
    assert 1.0 + found["position_gain"]["excess"] == pytest.approx(0.02, rel=0.05)
    assert found["coulomb_friction"]["friction"] == pytest.approx(-0.07, rel=0.05)
    assert "force_offset" not in found


def test_a_descent_finds_a_factor_that_a_usual_fit_does_not(weak: Problem) -> None:
    each = {one.candidate.cause.id: one.candidate for one in screened(weak)}
    sizes = [each[id] for id in ("coulomb_friction", "viscous_friction", "armature")]
    start = [(one, dict(one.null_values())) for one in sizes]
    start += [(each[id], {"excess": -0.9}) for id in ("position_gain", "velocity_gain")]
    own = weak.widened(weak.replayer.residual(start))

    found = descend(own, start, 8)

    left, plain = weak.replayer.residual(found), fit(own, start).residual
    assert np.mean(left**2) < 0.1 * np.mean(plain**2)
    values = {one.cause.id: v for one, v in found}
    assert 1.0 + values["position_gain"]["excess"] == pytest.approx(0.02, rel=0.05)
    assert values["coulomb_friction"]["presliding"] == start[0][1]["presliding"]


def test_too_many_parameters_are_not_fitted_together(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reality_gap.inference.joint_fit.MOST", 3)
    assert joint_fit(problem, screened(problem), [[]]) is None


@pytest.mark.slow
def test_a_soft_servo_is_predicted_nearly_to_the_noise(tmp_path: Path) -> None:
    found = diagnose(soft_servo(tmp_path), options=Options(suggest=False))

    assert found.verdict.has_names
    assert {"position_gain", "coulomb_friction"} <= {c.candidate.cause.id for c in found.causes}
    assert found.rms_before > 50.0
    values = {c.candidate.cause.id: c.parameters for c in found.causes}
    gain = NOMINAL["kp"] * (1.0 + values["position_gain"]["excess"].value)
    assert gain == pytest.approx(REAL["kp"], rel=0.15)
    assert values["coulomb_friction"]["friction"].value == pytest.approx(REAL["friction"], rel=0.1)
    assert found.calibration is not None
    assert found.calibration.rms < 2.0


def test_it_replaces_causes_that_leave_much(problem: Problem) -> None:
    first = search(problem, screened(problem), Settings(most=1))
    assert len(first.best.hypothesis) == 1

    found = JointSearch(Settings()).after(problem, first)

    assert found.together
    assert len(found.steps) == len(found.best.hypothesis) == len(found.joint) > 1
    assert np.mean(found.best.residual**2) < 0.2 * np.mean(first.best.residual**2)
    little = replace(first, best=found.best)
    assert JointSearch(Settings()).after(problem, little) is little


def test_a_search_begins_with_it_where_it_leaves_little(
    weak: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    screens, joint = screened(weak), JointSearch(Settings())

    found = search(weak, screens, Settings(), find_together=joint.instead)

    assert float(np.sqrt(np.mean(found.best.residual**2))) < 1.5
    values = {candidate.cause.id: v for candidate, v in found.best.hypothesis}
    assert 1.0 + values["position_gain"]["excess"] == pytest.approx(0.02, rel=0.05)
    assert [len(step.base.hypothesis) for step in found.steps] == list(range(len(found.steps)))
    for one in alternatives(found, Settings(), retry=False):
        others = [fitted for fitted in one.tried if fitted.hypothesis is not found.best.hypothesis]
        assert not any(set(o.candidates) == set(found.best.candidates) for o in others)
    # It is done once, and its causes are taken only where a first cause leaves much.
    monkeypatch.setattr("reality_gap.inference.joint_search.joint_fit", None)
    first = search(weak, screens, Settings(most=1)).steps[0]
    taken = joint.instead(weak, screens, first)
    assert taken is not None
    assert set(taken.best.candidates) == set(found.best.candidates)
    assert len(taken.steps[0].tried) > 1
    for step in taken.steps:
        assert step.tried[0].candidates[:-1] == step.base.candidates
    small = replace(first, tried=(taken.best, *first.tried))
    assert joint.instead(weak, screens, small) is None
    monkeypatch.setattr("reality_gap.inference.joint_search.LITTLE", 0.5)
    assert joint.instead(weak, screens, first) is None


def test_a_step_adds_its_cause_last_and_is_no_alternative_to_it(problem: Problem) -> None:
    each = {one.candidate.cause.id: one.candidate for one in screened(problem)}
    friction, gain = each["coulomb_friction"], each["position_gain"]
    added, count = [(friction, friction.null_values()), (gain, {"excess": -0.5})], 4
    theta = np.arange(len(friction.parameters) + 1.0)
    none = np.zeros(count)
    fitted = Fit(added, none, np.tile(theta, (count, 1)), theta, 1.0)
    base = Fit(added[1:], none, np.full((count, 1), theta[-1]), theta[-1:], 0.5)

    found = extending(base, fitted)

    assert found.candidates == (gain, friction)
    np.testing.assert_array_equal(found.theta, np.roll(theta, 1))
    np.testing.assert_array_equal(found.jacobian[0], np.roll(theta, 1))
    other = replace(found, hypothesis=[*added[1:], (each["armature"], {"inertia": 0.01})])
    for tried, expected in (((found,), False), ((found, other), True), ((other,), True)):
        result = Search(problem, (Step(base, tried, 9.0, 3.0),), found, ())
        assert (result.step_beside(base.hypothesis) is not None) is expected


def test_a_calibrated_model_begins_at_the_joint_fit(problem: Problem, chain: list[Fit]) -> None:
    joint = chain[-1]

    found = calibrate(problem, [], [], joint.hypothesis)

    assert found is not None
    assert found.together
    left = joint.residual[split(problem.measured) == REPORT]
    assert found.rms == pytest.approx(float(np.sqrt(np.mean(left**2))))
    assert {one.candidate for one in found.corrections} <= set(joint.candidates)
    model = mujoco.MjModel.from_xml_string(found.xml)
    values = {c.cause.id: v for c, v in joint.hypothesis}
    gain = NOMINAL["kp"] * (1.0 + values["position_gain"]["excess"])
    assert model.actuator("servo").gainprm[0] == pytest.approx(gain, rel=1e-4)
    assert calibrate(problem, joint.hypothesis, [], []) is None


@pytest.mark.parametrize("gain", [0.02, 1.6])
def test_tolerances_of_forces_are_as_large_as_a_servo_is_strong(
    tmp_path: Path, gain: float
) -> None:
    ids = ("position_gain", "force_offset", "coulomb_friction", "joint_offset", "link_mass")
    with Replayer(soft_servo(tmp_path, seconds=4.0)) as replayer:
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
            before = float(np.linalg.norm(columns[:, i]))
            ends = sorted([size, gain * size])
            force = one.parameter.unit.startswith("N")
            assert force != (one.candidate.cause.id in ("joint_offset", "link_mass"))
            expected = float(np.clip(before, *ends)) if force else size
            own = float(np.linalg.norm(found.noise_model.tolerances[:, i]))
            assert own == pytest.approx(expected, rel=0.02)
            if gain < 1.0 and one.candidate.cause.id == "force_offset":
                assert size > 20.0 * before
