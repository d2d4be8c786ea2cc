"""Linearisation about deviations that change the readings by many noises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from reality_gap import Diagnosis, Options, Verdict, diagnose
from reality_gap.causes import CATALOGUE
from reality_gap.inference.expansion import Expanded, expand, handicaps, is_small, suits
from reality_gap.inference.likelihood import independent_noise
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import list_candidates, screen
from reality_gap.inference.tolerances import (
    Tolerance,
    list_tolerances,
    tolerance_columns,
)
from reality_gap.inference.whitening import whitening
from reality_gap.simulation.hypothesis import Hypothesis, Part
from reality_gap.simulation.replayer import Expansion, Replayer
from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.study.splits import REPORT, split
from reality_gap.types import Floats
from tests.reality_gap.causes.candidates import candidate

NOISE = 1e-4
"""Noise of the encoders [rad]."""
slow = partial(pytest.param, marks=pytest.mark.slow)
SWING = """<mujoco><option timestep="0.002" integrator="implicitfast"/>
<default><joint axis="0 1 0" stiffness="0.5" damping="0.02"/></default><worldbody>
<body name="upper"><joint name="shoulder"/>
<geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="0.3"/>
<body name="lower" pos="0 0 -0.3"><joint name="elbow"/>
<geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.25" mass="0.2"/></body></body></worldbody>
<actuator><motor name="m_shoulder" joint="shoulder"/><motor name="m_elbow" joint="elbow"/>
</actuator>
<sensor><jointpos name="shoulder_angle" joint="shoulder"/><jointpos name="elbow_angle"
joint="elbow"/></sensor></mujoco>"""
"""Two links on weak springs, moved by motors without feedback."""
KINDS = ("link_mass", "centre_of_mass", "joint_stiffness", "viscous_friction", "force_scale")


FALLING = SWING.replace("<option", '<option gravity="0 0 9.81"').replace(
    'stiffness="0.5"', 'stiffness="1.5"'
)
"""The same links upside down, so that small deviations grow."""


def study_of(folder: Path, deviations: list[Part], model: str = SWING) -> Study:
    """A log of the machine with deviations."""
    path = folder / "swing.xml"
    path.write_text(model)
    time = np.arange(0.0, 6.0, 0.02)
    command = np.stack([0.5 * np.sin(4.1 * time), 0.3 * np.sin(6.3 * time)], axis=1)
    channels = tuple(Channel(name, name, noise=NOISE) for name in ("shoulder_angle", "elbow_angle"))
    silent = tuple(Reading(time, np.zeros(len(time))) for _ in channels)
    study = Study("swing", path, channels, (Episode("swing", time, command, silent),))
    with Replayer(study) as replayer:
        clean = replayer.replay(deviations).prediction
        of = [clean[replayer.measured.channel == c] for c in range(len(channels))]
    rng = np.random.default_rng(4)
    readings = tuple(Reading(time, x + NOISE * rng.standard_normal(len(x))) for x in of)
    return Study("swing", path, channels, (Episode("swing", time, command, readings),))


def tolerances_of(replayer: Replayer) -> list[Tolerance]:
    causes = [CATALOGUE[id] for id in KINDS]
    found = screen(replayer, list_candidates(replayer.system, causes), replayer.residual([]))
    return list(list_tolerances(found))


def power(columns: Floats, residual: Floats) -> float:
    """Mean square of the whitened residual of all readings; 1 for a machine without a fault."""
    ones = np.ones(len(residual))
    whiten = whitening(columns, ones, ones.astype(bool))
    return float(np.mean(whiten(residual) ** 2))


@pytest.fixture(scope="module")
def tolerances(tmp_path_factory: pytest.TempPathFactory) -> list[Tolerance]:
    with Replayer(study_of(tmp_path_factory.mktemp("nominal"), [])) as replayer:
        return tolerances_of(replayer)


def deviations_of(tolerances: list[Tolerance], seed: int) -> list[Part]:
    """Deviations of all parameters by 1.5 tolerances."""
    rng = np.random.default_rng(seed)
    return [one.deviation(1.5 * float(rng.choice([-1.0, 1.0]))) for one in tolerances]


def powers(folder: Path, deviations: list[Part], model: str = SWING) -> tuple[float, float]:
    """The power with linear columns, and that of the expansion."""
    with Replayer(study_of(folder, deviations, model)) as replayer:
        null, own = replayer.residual([]), tolerances_of(replayer)
        columns = tolerance_columns(replayer, own, null)
        assert np.sqrt(np.mean(null**2)) > 100.0
        assert not is_small(replayer, columns, null)
        found = expand(replayer, own, columns, [], null)
        assert replayer.expansion.parts == ()
        replayer.expansion = found.expansion
        return power(columns, null), power(found.columns, replayer.residual([]))


@pytest.mark.parametrize("seed", [1, 2])
def test_large_effects_of_small_deviations_are_not_taken_for_a_fault(
    tmp_path: Path, tolerances: list[Tolerance], seed: int
) -> None:
    linear, corrected = powers(tmp_path, deviations_of(tolerances, seed))
    assert linear > 2.0
    assert corrected < 1.3


@pytest.mark.parametrize("seed", [slow(1), 2, slow(3)])
def test_deviations_that_grow_with_the_time_are_found(tmp_path: Path, seed: int) -> None:
    """Each is of 1.5 tolerances, so that their prior alone leaves 1.1."""
    with Replayer(study_of(tmp_path, [], FALLING)) as replayer:
        deviations = deviations_of(tolerances_of(replayer), seed)

    linear, corrected = powers(tmp_path, deviations, FALLING)

    assert linear > 20.0
    assert corrected < 1.3


def test_the_model_is_less_likely_about_deviations_that_it_does_not_have(tmp_path: Path) -> None:
    with Replayer(study_of(tmp_path, [])) as replayer:
        null, own = replayer.residual([]), tolerances_of(replayer)
        plain = expand(replayer, own, tolerance_columns(replayer, own, null), [], null)
        parts = tuple(one.deviation(3.0) for one in own[:4])
        effects = np.array([3.0 * one.column for one in own[:4]])
        frame = Expanded(Expansion(parts, effects), plain.columns, null, 1.0)

        problem = Problem(replayer, null, independent_noise(replayer.measured, plain.columns))
        inflation = np.full(len(null), 4.0)
        correlated = replace(problem.noise_model, inflation=inflation)
        same = handicaps(problem, plain, plain, null)
        replayer.expansion = frame.expansion
        residual = replayer.residual([])
        other, _ = handicaps(problem, plain, frame, residual)
        fewer, _ = handicaps(replace(problem, noise_model=correlated), plain, frame, residual)
        diverged = handicaps(problem, plain, frame, np.nan * residual)

    assert same == diverged == (0.0, 0.0)
    assert other > 5.0
    assert fewer == pytest.approx(0.25 * other)


def test_where_the_model_is_far_off_only_the_ratio_of_what_is_left_makes_it_less_likely(
    tmp_path: Path,
) -> None:
    """The variance of what a model leaves is not known there."""
    with Replayer(study_of(tmp_path, [])) as replayer:
        left = 100.0 * np.random.default_rng(2).standard_normal(len(replayer.measured.value))
        use = split(replayer.measured) != REPORT
        own = Expanded(Expansion(), np.zeros((len(left), 0)), left, float(np.mean(left[use] ** 2)))
        problem = Problem(replayer, left, independent_noise(replayer.measured, own.columns))
        known, profiled = handicaps(problem, own, own._replace(power=0.0), 1.1 * left)

    assert known == pytest.approx(0.5 * 0.21 * np.sum(left[use] ** 2))
    assert profiled == pytest.approx(np.count_nonzero(use) * np.log(1.1), rel=0.01)


def test_a_cause_has_its_value_and_no_deviation_beside_it(tmp_path: Path) -> None:
    with Replayer(study_of(tmp_path, [])) as replayer:
        mass, lower = (candidate(replayer.system, "link_mass", one) for one in ("upper", "lower"))
        part = (mass, mass.null_values() | {"mass": 0.02})
        other = (lower, lower.null_values() | {"mass": 0.01})
        alone, both = replayer.residuals([[part], [other, part]])
        effects = np.array([np.full(len(alone), 5.0), np.full(len(alone), 1.0)])
        replayer.expansion = Expansion((part, other), effects)

        np.testing.assert_array_equal(replayer.residual([part]), both + 1.0)
        np.testing.assert_array_equal(replayer.residual([other, part]), both)


def test_friction_before_a_force_sensor_deviates_and_zeros_of_sensors_do_not(
    lever_study: Study,
) -> None:
    with Replayer(lever_study) as replayer:
        causes = [CATALOGUE[id] for id in ("coulomb_friction", "tension_offset", "force_scale")]
        found = screen(replayer, list_candidates(replayer.system, causes), replayer.residual([]))
        able = {str(t.candidate) for t in list_tolerances(found) if suits(replayer.system, t)}

    assert "coulomb_friction at flexor (before the force sensor)" in able
    assert "force_scale at flexor" in able
    assert not any(one.startswith("tension_offset") for one in able)


@pytest.mark.slow
def test_what_is_not_linear_in_deviations_is_no_stop(tmp_path: Path) -> None:
    """A linear model leaves what a spring at one side explains by 160 nats."""
    with Replayer(study_of(tmp_path, [], FALLING)) as replayer:
        deviations = deviations_of(tolerances_of(replayer), 2)
    study = study_of(tmp_path, deviations, FALLING)

    found = diagnose(study, causes=[CATALOGUE[id] for id in KINDS], options=Options(suggest=False))

    assert found.verdict is Verdict.NOTHING_WRONG
    assert found.rms_before > 1000.0


def test_deviations_that_are_hardly_linear_cost_few_replays(
    tmp_path: Path, tolerances: list[Tolerance], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is not linear is a small part of each reading, and many nats in all of them."""
    monkeypatch.setattr("reality_gap.inference.expansion.LARGE", 100.0)
    rng = np.random.default_rng(7)
    small = [one.deviation(0.4 * float(rng.choice([-1.0, 1.0]))) for one in tolerances]
    with Replayer(study_of(tmp_path, small)) as replayer:
        null, own = replayer.residual([]), tolerances_of(replayer)
        columns = tolerance_columns(replayer, own, null)
        replayed: list[Hypothesis] = []
        plain = replayer.residuals

        def counted(hypotheses: Sequence[Hypothesis]) -> list[Floats]:
            replayed.extend(hypotheses)
            return plain(hypotheses)

        monkeypatch.setattr(replayer, "residuals", counted)
        found = expand(replayer, own, columns, [], null)
        monkeypatch.setattr(replayer, "residuals", plain)
        replayer.expansion = found.expansion
        corrected = replayer.residual([])

    assert len(replayed) <= len(own) + 15
    gain = 0.5 * len(null) * (power(columns, null) - power(found.columns, corrected))
    assert gain > 3.0


def test_a_fault_is_not_taken_for_deviations(tmp_path: Path, tolerances: list[Tolerance]) -> None:
    heavy = next(one for one in tolerances if str(one.candidate) == "link_mass at lower")
    fault = heavy.deviation(0.3 * 0.2 / abs(heavy.size))  # 30 % of 0.2 kg
    parts = [*deviations_of(tolerances, 1), fault]
    _, corrected = powers(tmp_path, parts)
    assert corrected > 3.0
    with Replayer(study_of(tmp_path, parts)) as replayer:
        null, own = replayer.residual([]), tolerances_of(replayer)
        columns = tolerance_columns(replayer, own, null)
        beside = expand(replayer, own, columns, [fault], replayer.residual([fault]))
        assert beside.power < 0.5 * corrected


@pytest.mark.parametrize(
    ("seed", "faulty", "verdict", "names"),
    [
        (4, False, Verdict.NOTHING_WRONG, []),
        pytest.param(3, True, Verdict.NAMED, ["link_mass at lower"], marks=pytest.mark.slow),
        pytest.param(  # slopes at the null do not lead there
            2, True, Verdict.NAMED, ["link_mass at lower"], marks=pytest.mark.slow
        ),
    ],
)
def test_deviations_are_silent_and_a_fault_beside_them_is_not(
    tmp_path: Path,
    tolerances: list[Tolerance],
    seed: int,
    faulty: bool,
    verdict: Verdict,
    names: list[str],
) -> None:
    heavy = next(one for one in tolerances if str(one.candidate) == "link_mass at lower")
    fault = [heavy.deviation(0.3 * 0.2 / abs(heavy.size))] if faulty else []
    study = study_of(tmp_path, [*deviations_of(tolerances, seed), *fault])
    causes = [CATALOGUE[id] for id in KINDS]
    used = list[Replayer]()

    def keep(replayer: Replayer, *others: object) -> None:
        used.append(replayer)

    found = diagnose(study, causes=causes, options=Options(suggest=False), watch=keep)

    assert found.verdict is verdict
    assert [str(cause.candidate) for cause in found.causes] == names
    with Replayer(study) as replayer:
        replayer.own_step = bool(found.measures["own_time_step"])
        replayer.step_error = used[0].step_error  # that of the machine with the cause
        report = split(replayer.measured) == REPORT
        for parts, rms in (([], found.rms_before), (fault_of(found), found.rms_after)):
            own = np.sqrt(np.mean(replayer.residual(parts)[report] ** 2))
            assert rms == pytest.approx(own, rel=1e-6)


def fault_of(found: Diagnosis) -> list[Part]:
    """The named causes with their values."""
    return [(c.candidate, {n: e.value for n, e in c.parameters.items()}) for c in found.causes]


def test_deviations_are_found_where_clocks_do_not_begin_at_zero(tmp_path: Path) -> None:
    """Readings begin 2 s after the commands, as in a log that was cut."""
    with Replayer(study_of(tmp_path, [], FALLING)) as replayer:
        deviations = deviations_of(tolerances_of(replayer), 1)
    study = study_of(tmp_path, deviations, FALLING)
    [episode] = study.episodes
    cut = tuple(Reading(r.time[100:], r.value[100:]) for r in episode.readings)
    with Replayer(replace(study, episodes=(replace(episode, readings=cut),))) as replayer:
        null, own = replayer.residual([]), tolerances_of(replayer)
        columns = tolerance_columns(replayer, own, null)
        found = expand(replayer, own, columns, [], null)
        replayer.expansion = found.expansion

        assert power(found.columns, replayer.residual([])) < 1.3


SERVO = """<mujoco><option timestep="0.002"/><worldbody><body>
<joint name="hinge" axis="0 1 0" damping="0.1"/>
<geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="0.3"/></body></worldbody>
<actuator><position name="servo" joint="hinge" kp="30" kv="1"/></actuator>
<sensor><jointpos name="angle" joint="hinge"/></sensor></mujoco>"""


def test_a_mirrored_encoder_is_no_deviation_of_its_scale(tmp_path: Path) -> None:
    """The scale explains it by thousands of tolerances, beside which its noise is nothing."""
    path, noise = tmp_path / "servo.xml", 2e-6
    path.write_text(SERVO)
    time = np.arange(0.0, 8.0, 0.04)
    command = 0.8 * np.sin(2.0 * time)[:, None]

    def study(values: Floats) -> Study:
        episode = Episode("only", time, command, (Reading(time, values),))
        return Study("servo", path, (Channel("angle", "angle", noise=noise),), (episode,))

    with Replayer(study(0.0 * time)) as replayer:
        clean = replayer.replay([]).prediction + replayer.drift
    mirrored = noise * np.random.default_rng(1).standard_normal(len(time)) - clean
    causes = [CATALOGUE[id] for id in ("joint_offset", "encoder_scale", "viscous_friction")]

    found = diagnose(study(mirrored), causes=causes, options=Options(suggest=False))

    assert found.verdict is not Verdict.NOTHING_WRONG


PENDULUM = """<mujoco><option timestep="0.005"/><worldbody><body name="pole" pos="0 0 0.6">
<joint name="hinge" damping="0.1" axis="0 1 0"/>
<geom type="sphere" size="0.05" pos="0 0 0.5" mass="1"/></body></worldbody>
<actuator><motor name="torque" joint="hinge"/></actuator>
<sensor><jointpos name="angle" joint="hinge"/></sensor></mujoco>"""
"""A pendulum that a weak motor swings."""


def test_a_fault_that_leaves_little_more_than_noise_is_not_taken_for_deviations(
    tmp_path: Path,
) -> None:
    """What deviations in place of the load leave has the power of noise, by chance."""
    path, noise, mass = tmp_path / "pendulum.xml", 0.006, 0.06
    path.write_text(PENDULUM)
    time = np.arange(0.0, 10.0, 0.01)
    command = (0.6 * (np.sin(2.1 * time) + np.sin(3.7 * time)))[:, None]

    def study(values: Floats) -> Study:
        episode = Episode("only", time, command, (Reading(time, values),))
        return Study("pendulum", path, (Channel("angle", "angle", noise=noise),), (episode,))

    with Replayer(study(0.0 * time)) as replayer:
        load = candidate(replayer.system, "payload", "pole")
        clean = replayer.replay([(load, load.null_values() | {"mass": mass})]).prediction
    values = clean + noise * np.random.default_rng(2).standard_normal(len(time))
    causes = [CATALOGUE[id] for id in (*KINDS, "payload", "dead_zone", "clock_drift")]

    found = diagnose(study(values), causes=causes, options=Options(suggest=False))

    [cause] = found.causes
    assert {cause.candidate.cause.id, *cause.equivalent} == {"payload", "link_mass"}
    assert cause.parameters["mass"].low < mass < cause.parameters["mass"].high
