"""Muscle Jacobians: true moment arms, sweeps, errors and turns, verdict on the claim."""

from typing import Any

import numpy as np
import pytest

from experiments.muscle_jacobian.moment_arms import (
    ANALYTIC,
    DIFFERENCE,
    FIVE_POINTS,
    QUADRATIC,
    STEP,
    TRUE,
    Curves,
    by_map,
    curves,
    inner,
    slope,
    sweeps,
)
from experiments.muscle_jacobian.robot import estimator_errors, learn, record
from experiments.muscle_jacobian.roughness import ALL, measures, numbers, turns
from experiments.muscle_jacobian.run import QUICK, conclude
from experiments.muscle_jacobian.tables import (
    OURS,
    PAPER,
    RULE,
    STAGES,
    metrics,
    statements,
    verdict,
)
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.recipe import Recipe
from jmm_agent.mapping.training import train
from jmm_agent.nominal_model import NominalModel
from jmm_agent.types import Floats
from kengoro.robots import shuffled_postures
from kengoro.trained_maps import ARM, nominal_model
from kengoro_env.assets import asset_path
from kengoro_env.names import GROUP_JOINTS
from kengoro_env.robot.nominal_model import NominalArm


@pytest.fixture(scope="module")
def nominal() -> NominalModel:
    return nominal_model()


@pytest.fixture(scope="module")
def rough(nominal: NominalModel) -> JointMuscleMap:
    """A map that was hardly trained, so that its Jacobians differ from each other."""
    return train(nominal, 0, Recipe(hidden=100, samples=2_000, steps=10))[0]


def test_sweeps_go_through_the_whole_range_of_one_joint(nominal: NominalModel) -> None:
    swept = sweeps(nominal, 3, np.random.default_rng(0))
    assert [sweep.joint for sweep in swept] == list(range(len(nominal.joints)))
    for joint, postures in swept:
        low, high = nominal.lower[joint], nominal.upper[joint]
        assert postures[:, 0, joint] == pytest.approx(low)
        assert np.all(postures[:, -1, joint] > high - STEP)
        assert np.all(postures[:, -1, joint] < high + 1e-9)
        np.testing.assert_allclose(np.diff(postures[:, :, joint]), STEP)
        others = np.delete(postures, joint, axis=2)
        assert not np.ptp(others, axis=1).any()
        assert np.ptp(others, axis=0).all(axis=1).all()


def test_both_derivatives_are_those_of_the_map(
    nominal: NominalModel, rough: JointMuscleMap
) -> None:
    q = np.random.default_rng(0).uniform(nominal.lower, nominal.upper, (6, 14))
    for joint in range(14):
        np.testing.assert_allclose(
            by_map(rough, q, joint, QUADRATIC), rough.jacobian_quadratic(q)[:, :, joint], atol=1e-12
        )
        analytic = by_map(rough, q, joint, ANALYTIC)
        np.testing.assert_array_equal(analytic, rough.jacobian(q)[:, :, joint])
        # The paper's difference over 0.1 deg is the analytic derivative.
        np.testing.assert_allclose(slope(rough, q, joint, DIFFERENCE), analytic, atol=1e-5)
    assert np.ptp(np.degrees(DIFFERENCE)) == pytest.approx(0.1)
    assert np.degrees(FIVE_POINTS) == pytest.approx([-20, -10, 10, 20])


def test_turns_are_counted_only_where_the_line_goes_back_far_enough() -> None:
    x = np.linspace(0.0, 1.0, 400)
    lines = np.array(
        [
            5.0 * x,
            np.sin(np.pi * x) * 3.0,
            3.0 * np.sin(6.0 * np.pi * x),
            5.0 * x + 0.2 * np.sin(40.0 * np.pi * x),
            0.4 * np.sin(6.0 * np.pi * x),
            -3.0 * np.cos(4.0 * np.pi * x),
        ]
    )
    np.testing.assert_array_equal(turns(lines, 1.0), [0, 1, 6, 0, 0, 3])
    np.testing.assert_array_equal(turns(-lines, 1.0), turns(lines, 1.0))


def lines(kinds: dict[str, Floats]) -> Curves:
    return Curves("neck", 0, {kind: line[None, :, None] for kind, line in kinds.items()})


def test_errors_and_bends_are_those_of_the_curves() -> None:
    angle = STEP * np.arange(31)
    true = 10.0 * np.cos(angle)
    curved = true + 2.0 * np.sin(20.0 * angle)
    found = measures([lines({ANALYTIC: curved, QUADRATIC: true + 3.0, TRUE: true})])
    analytic, quadratic = (numbers(found, kind) for kind in (ANALYTIC, QUADRATIC))
    assert quadratic["error"] == pytest.approx(3.0)
    assert analytic["error"] == pytest.approx(2.0 / np.sqrt(2.0), rel=0.1)
    assert quadratic["roughness"] == pytest.approx(1.0)
    assert found[TRUE][ALL]["bend"] == pytest.approx(
        10.0 * np.sqrt(np.mean(np.cos(angle[1:-1]) ** 2)), rel=0.01
    )
    assert analytic["roughness"] > 20.0
    assert analytic["turns"] > 4.0
    assert quadratic["turns"] == 0.0
    assert found[TRUE]["neck"] == found[TRUE][ALL]


def test_the_inner_part_leaves_the_reach_of_the_five_points(
    nominal: NominalModel, rough: JointMuscleMap
) -> None:
    swept = sweeps(nominal, 2, np.random.default_rng(0))
    found = list(curves(rough, NominalArm(asset_path(ARM)).moment_arms, swept))
    assert len(found) == sum(len(group.joint_index) for group in rough.groups)
    kept = {(of.group, of.joint): of for of in inner(found)}
    for of in found:
        low, high = np.degrees([nominal.lower[of.joint], nominal.upper[of.joint]])
        points = 1 + int((high - low - 40.0) / 2.5 + 1e-6)
        if points < 5:
            assert (of.group, of.joint) not in kept
            continue
        for kind, arms in kept[of.group, of.joint].arms.items():
            assert arms.shape[1] in (points, points + 1)
            np.testing.assert_array_equal(arms, of.arms[kind][:, 8:-8])


def test_learning_changes_the_map_and_recording_does_not(rough: JointMuscleMap) -> None:
    session = learn(rough, 0, shuffled_postures(0)[:3], False, 1.0, 2.0)
    learned = session.agent.map
    assert session.agent.antagonism.fired + session.agent.vision.fired > 0
    assert not np.allclose(learned.lengths(np.zeros(14)), rough.lengths(np.zeros(14)))
    readings = record(session, np.repeat(shuffled_postures(0)[-1:], 3, axis=0), 1.0)
    assert session.agent.at_rest
    assert session.agent.map is learned
    assert len(readings.lengths) == len(readings.true) == 150
    assert np.ptp(readings.true, axis=0).max() > 0.1
    session.env.close()


def test_an_exact_map_lets_the_estimator_find_the_joints(nominal: NominalModel) -> None:
    from experiments.muscle_jacobian.robot import FilteredReadings

    jmm, _ = train(nominal, 0, Recipe(hidden=300, samples=3_000, steps=40))
    share = np.linspace(0.3, 0.6, 60)[:, None]
    true = nominal.lower + share * (nominal.upper - nominal.lower)
    limits = np.column_stack([nominal.lower, nominal.upper])
    found = estimator_errors(FilteredReadings(list(nominal.lengths(true)), list(true)), jmm, limits)
    assert found["analytic"] < 1.0
    assert found["quadratic"] < 2.0
    assert found["quadratic"] != found["analytic"]
    assert 0.0 < found["between"] < 2.0


def fake(analytic: float, quadratic: float, errors: tuple[float, float]) -> dict[str, Any]:
    """A result in which both Jacobians turn so often and err so much; the true one turns once."""
    of = {
        ANALYTIC: {"error": errors[0], "bend": 2.0, "turns": analytic},
        QUADRATIC: {"error": errors[1], "bend": 1.0, "turns": quadratic},
        TRUE: {"bend": 1.0, "turns": 1.0},
    }
    by_group = {kind: dict.fromkeys((ALL, *GROUP_JOINTS), found) for kind, found in of.items()}
    arms = np.zeros((61, 10)).tolist()
    evaluated = {
        "whole": by_group,
        "inner": by_group,
        "flexion": {ANALYTIC: arms, QUADRATIC: arms, TRUE: arms},
        "difference": 0.001,
    }
    estimator = {ANALYTIC: 1.0, QUADRATIC: 1.5, "between": 0.6}
    return {
        **dict.fromkeys(("nominal", "before", "after"), evaluated),
        "estimator": estimator,
    }


@pytest.mark.parametrize(
    ("turned", "errors", "claim", "words"),
    [
        ((3.0, 1.0), (2.0, 1.0), "yes", ("fewer", "smaller")),
        ((1.0, 2.0), (1.0, 2.0), "no", ("more", "larger")),
        ((1.0, 0.5), (1.0, 1.0), "in part", ("fewer", "no difference")),
        ((3.0, 3.0), (1.0, 1.0), "in part", ("no difference", "no difference")),
    ],
)
def test_the_verdict_follows_the_numbers(
    turned: tuple[float, float], errors: tuple[float, float], claim: str, words: tuple[str, str]
) -> None:
    result = {name: fake(*turned, errors) for name in (OURS, RULE, PAPER)}
    results = {0: result, 1: result}
    found = verdict(results, STAGES[0])
    assert (found.turns, found.error) == words
    assert found.claim == claim
    assert f"claim holds: {claim};" in statements(results)[0]
    numbers = metrics(results)
    gained = numbers["ours_quadratic_minus_analytic_error"]["median"]
    assert gained == pytest.approx(errors[1] - errors[0])
    assert numbers["ours_analytic_turns_per_true_turn"]["median"] == turned[0]


def test_findings_hold_every_map() -> None:
    result = {name: fake(3.0, 1.0, (2.0, 1.0)) for name in (OURS, RULE, PAPER)}
    found = conclude({0: result, 1: result}, QUICK)
    assert all(picture.png.startswith(b"\x89PNG") for picture in found.pictures)
    assert list(found.per_seed) == [0, 1]
    for table in found.tables:
        assert all(len(row) == len(table.head) for row in table.rows), table.title
    estimates = found.tables[-1].rows[0]
    assert [str(cell).split()[0] for cell in estimates[1:]] == ["1", "1.5", "0.6", "0.5"]
