"""Gap to skill: an extended model settles at its commands, and shares are right."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest

import experiments.gap_to_skill.run as experiment
from experiments.gap_to_skill.extended_arm import ExtendedArm, extended_map, least_pull
from experiments.gap_to_skill.run import Sizes, make_plan, run
from experiments.gap_to_skill.tables import (
    EXTENDED,
    NOMINAL,
    metrics,
    seed_entry,
    shares_removed,
    tables,
)
from experiments.harness.errors import ExperimentError
from experiments.posture_accuracy.run import AWAY, away
from jmm_agent.mapping.recipe import Recipe
from kengoro.recording import whole_arm
from kengoro.study_model import study_model, zero_lengths
from kengoro.trained_maps import nominal_model, trained_map
from kengoro.visits import ANGLES, Visits, no_visits
from kengoro_env.names import JOINTS
from kengoro_env.postures import posture_set
from kengoro_env.robot.robot import Robot
from reality_gap import Verdict

MUSCLES = nominal_model().muscles
TINY = Sizes(2, go=0.5, stay=0.5, learned=1, targets=1, starts=1, move=0.6, patience=0.8)


def nominal_spec() -> mujoco.MjSpec:
    return study_model(whole_arm().scene)


def extended(spec: mujoco.MjSpec) -> ExtendedArm:
    spec.compile()
    return ExtendedArm(spec.to_xml(), MUSCLES, zero_lengths(nominal_spec(), MUSCLES))


def off(robot: Robot, posture: np.ndarray, command: np.ndarray) -> float:
    """How far the robot settles from a posture [deg], RMS over joints."""
    robot.reset(posture, np.random.default_rng(0))
    for _ in range(100):
        robot.step(command)
    return float(np.degrees(np.sqrt(np.mean((robot.joint_angles - posture) ** 2))))


def test_a_nominal_robot_settles_at_its_commands() -> None:
    robot, arm = Robot(whole_arm().scene), extended(nominal_spec())
    postures = posture_set()[:4]
    for posture, command, path in zip(
        postures, arm.commands(postures), arm.paths(postures), strict=True
    ):
        assert off(robot, posture, command) < 0.05
        assert off(robot, posture, path) > 0.3  # muscle lengths alone let it sag


def test_commands_of_a_model_with_soft_muscles_are_shorter() -> None:
    soft = nominal_spec()
    for muscle in MUSCLES:
        motor = soft.actuator(muscle)
        motor.gainprm[0] /= 2
        motor.biasprm[1] /= 2
    posture = posture_set()[:1]
    paths = extended(nominal_spec()).paths(posture)
    hard, softer = (
        arm.commands(posture) - paths for arm in (extended(nominal_spec()), extended(soft))
    )
    assert hard.min() < -1e-4
    np.testing.assert_allclose(softer, 2 * hard, atol=1e-7)


def test_commands_are_as_a_wrong_encoder_reads() -> None:
    """A servo that feeds back 5 mm too much is commanded 5 mm more."""
    wrong = nominal_spec()
    motor = wrong.actuator("biceps")
    motor.biasprm[0] -= motor.gainprm[0] * 0.005
    posture = posture_set()[:1]
    change = (extended(wrong).commands(posture) - extended(nominal_spec()).commands(posture))[0]
    expected = np.where(np.array(MUSCLES) == "biceps", 0.005, 0.0)
    np.testing.assert_allclose(change, expected, atol=1e-7)


def test_friction_changes_no_command() -> None:
    """Bristles of a diagnosis are actuators without input."""
    rubbing = nominal_spec()
    brake = rubbing.add_actuator(
        name="usual", trntype=mujoco.mjtTrn.mjTRN_TENDON, target=MUSCLES[0]
    )
    brake.set_to_dcmotor(
        motorconst=[0.0, 0.0],
        resistance=1.0,
        lugre=[1e4, 10.0, 2.0, 2.0, 1e-3],
        ctrlspec=int(mujoco.mjtCtrlInput.mjINPUT_NONE),
    )
    posture = posture_set()[:2]
    commands = extended(rubbing).commands(posture)
    np.testing.assert_allclose(commands, extended(nominal_spec()).commands(posture), atol=1e-12)


def test_pull_is_least_and_holds() -> None:
    rng = np.random.default_rng(0)
    arms, weight, least = rng.normal(0.0, 0.03, (8, 2)), np.array([3.0, -1.0]), np.full(8, 30.0)
    pull = least_pull(arms, weight, least)
    assert pull.min() >= 30.0
    np.testing.assert_allclose(arms.T @ pull, weight, atol=1e-4)
    held = arms.T @ least  # what the least tensions hold already needs no more
    np.testing.assert_allclose(least_pull(arms, held, least), least, atol=1e-6)


def test_map_predicts_the_commands() -> None:
    shifted = nominal_spec()
    for muscle in MUSCLES:
        motor = shifted.actuator(muscle)
        motor.biasprm[0] -= motor.gainprm[0] * 0.03
    arm, postures = extended(shifted), posture_set()[:300]
    recipe = Recipe(hidden=100, samples=2000, steps=2)
    found = extended_map(arm, postures, recipe)
    fresh = posture_set()[300:350]
    assert np.sqrt(np.mean((found.lengths(fresh) - arm.commands(fresh)) ** 2)) < 2e-3


def test_a_model_without_the_muscles_is_refused() -> None:
    with pytest.raises(ExperimentError, match=r"The extended model cannot be used: .*neck_yaw"):
        ExtendedArm("<mujoco/>", ("biceps",), np.zeros(1))


def test_new_postures_are_far_from_all_that_the_robot_knows() -> None:
    plan = make_plan(4, Sizes())
    known = np.vstack([plan.learned, plan.recorded])
    assert len(known) == 57
    assert len(plan.targets) == 5
    assert away(plan.targets, known)[0].min() >= AWAY
    all_postures = np.vstack([plan.first[None], *plan[1:]])
    assert len(np.unique(all_postures, axis=0)) == len(all_postures)
    with pytest.raises(ExperimentError, match="are needed"):
        make_plan(4, Sizes(targets=1000))


def stand_in(study: Any) -> SimpleNamespace:
    """A diagnosis that finds nothing."""
    assert [len(episode.readings) > 36 for episode in study.episodes] == [True]
    spec = study.spec()
    spec.compile()
    return SimpleNamespace(
        extended_xml=spec.to_xml(),
        verdict=Verdict.NOTHING_WRONG,
        causes=(),
        rms_before=2.0,
        rms_after=2.0,
        gain=None,
        seconds=1.0,
    )


def test_a_diagnosed_robot_moves_by_the_map_of_its_diagnosis(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    maps = request.config.cache.mkdir("maps")
    trained_map(maps)
    asked: list[str] = []

    def remembered(arm: ExtendedArm, postures: np.ndarray) -> Any:
        asked.append(type(arm).__name__)
        return trained_map(maps)

    monkeypatch.setattr(experiment, "diagnose", stand_in)
    monkeypatch.setattr(experiment, "extended_map", remembered)
    found = run(EXTENDED, 3, TINY, maps)
    assert asked == ["ExtendedArm"]
    assert found["diagnosis"]["verdict"] == "nothing_wrong"
    assert len(found["before"]["time"]) == len(found["after"]["time"]) == 1
    # the same map, so before anything is learned the robot goes where the drawing sends it
    other = run(NOMINAL, 3, TINY, maps)
    assert other["diagnosis"] is None
    assert other["before"]["true"] == found["before"]["true"]


def made_up(error: float) -> Visits:
    """One visit that ends off its target by some degrees in all joints."""
    visits = no_visits()
    for key in ANGLES:
        angle = np.radians(error) if key == "target" else 0.0
        visits[key].append(np.full(len(JOINTS), angle).tolist())
    visits["max_tension"].append(100.0)
    visits["time"].append(1.0)
    return visits


def entries(*robots: tuple[float, float]) -> dict[int, dict[str, Any]]:
    """Entries of robots by their errors before learning, of nominal and diagnosed map."""
    diagnosis = {
        "verdict": "named",
        "causes": [{"cause": "joint_offset", "parameters": 14}],
        "rms_before": 50.0,
        "rms_after": 4.0,
        "gain": None,
        "seconds": 100.0,
    }
    return {
        seed: {
            condition: seed_entry(
                {
                    "before": made_up(error),
                    "after": made_up(1.0),
                    "starts": 1,
                    "diagnosis": diagnosis,
                }
            )
            for condition, error in zip((NOMINAL, EXTENDED), errors, strict=True)
        }
        for seed, errors in enumerate(robots)
    }


def test_the_removed_share_is_of_the_nominal_error() -> None:
    robots = entries((10.0, 2.0), (8.0, 4.0), (12.0, 9.0))
    removed = shares_removed(robots, "target_true_deg")
    np.testing.assert_allclose(removed, [0.8, 0.5, 0.25], atol=1e-3)
    found = metrics(robots)["rmse_removed_before_learning"]
    assert found["median"] == pytest.approx(0.5, abs=1e-3)
    assert found["worst"] == pytest.approx(0.25, abs=1e-3)
    assert metrics(entries((10.0, 1.0)))["rmse_removed_before_learning"]["reached"]
    assert not metrics(entries((10.0, 6.0)))["rmse_removed_before_learning"]["reached"]


def test_tables_list_each_robot_and_its_causes() -> None:
    found = tables(entries((10.0, 2.0), (8.0, 4.0)))
    assert found[1].rows[0][:3] == (0, "10.0 -> 1.0", "2.0 -> 1.0")
    assert "joint_offset (14)" in found[2].rows[1]
