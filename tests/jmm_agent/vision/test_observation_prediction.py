"""Looks are predicted before they are learned, and updates that are not worth it are refused."""

from __future__ import annotations

import logging
from functools import cache

import numpy as np
import pytest

from jmm_agent.guard.faults import NOTHING_LEARNED
from jmm_agent.learning_monitor import LearningMonitor, LearningMonitorOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.prediction_record import PredictionRecord
from jmm_agent.settling import SettlingDetector, SettlingOptions
from jmm_agent.updaters import Seen, VisionUpdater
from jmm_agent.updaters.forecast import NO_BETTER, REFUSED, why_not_applied
from jmm_agent.vision.hand_error import HandErrors
from jmm_agent.vision.observation_prediction import ObservationPrediction
from jmm_agent.vision.rest_fit import Rest
from tests.jmm_agent.vision.seen_robots import (
    LEVER,
    POSITION_NOISE,
    SeenRobot,
    hand_postures,
    map_of,
    postures,
    see,
    updater,
)

ROBOTS, COUNT = 12, 8


@cache
def predictions(larger: float) -> list[list[ObservationPrediction]]:
    """What was expected of the looks at robots whose errors are larger than the prior says."""
    found = []
    for seed in range(ROBOTS):
        robot, vision = SeenRobot(seed, larger), updater(judged=False, position_residual=1.0)
        observations = [see(vision, robot.observation(q)) for q in postures(COUNT, 500 + seed)]
        found.append([seen.predicted for seen in observations])
    return found


def covered(robots: list[list[ObservationPrediction]]) -> float:
    return float(np.mean([one.inside for observations in robots for one in observations]))


def recorded(robots: list[list[ObservationPrediction]]) -> float:
    """Share of looks in the regions, once each robot's factor is learned from the looks before."""
    records = []
    for observations in robots:
        records.append(PredictionRecord())
        for one in observations:
            records[-1].add(Seen(one.angles, one.angles, True, "", predicted=one))
    return sum(record.inside for record in records) / sum(record.count for record in records)


def test_regions_of_95_percent_cover_observations_at_robots_of_the_prior() -> None:
    robots = predictions(1.0)
    assert 0.90 <= covered(robots) <= 0.98
    assert 0.90 <= recorded(robots) <= 0.98


@pytest.mark.parametrize("larger", [0.3, 3.0])
def test_regions_adapt_to_robots_with_other_errors_than_the_prior(larger: float) -> None:
    robots = predictions(larger)
    raw, learned = covered(robots), recorded(robots)
    assert not 0.90 <= raw <= 0.98
    assert 0.88 <= learned <= 0.98


@pytest.mark.parametrize("fit", ["together", "incremental"])
def test_a_fit_without_zero_posture_predicts_as_well(fit: str) -> None:
    robot, vision = SeenRobot(1), updater(fit=fit)
    observations = [see(vision, robot.observation(q)).predicted for q in postures(5, 3)]
    errors = [one.position_error for one in observations]
    stds = [one.position_std for one in observations]
    assert errors[-1] < 0.5 * errors[0]
    assert stds[-1] < 0.5 * stds[0]


def test_each_observation_alone_is_not_predicted_nor_judged() -> None:
    robot, vision = SeenRobot(1), updater(fit="alone")
    for q in postures(3, 3):
        seen = see(vision, robot.observation(q))
        assert seen.predicted is None
        assert seen.hand_error is None
    record = PredictionRecord()
    record.add(seen)
    assert record.count == 0
    assert np.isnan(record.coverage)


def test_what_is_expected_does_not_depend_on_the_pose() -> None:
    robot, vision = SeenRobot(2), updater()
    for q in postures(3, 3):
        see(vision, robot.observation(q))
    observation = robot.observation(postures(1, 9)[0])
    moved = observation.pose.copy()
    moved[:3, 3] += 0.5
    one, other = (
        vision.forecast.predict(vision.memory, [*vision.memory.observations, each])
        for each in (observation, observation._replace(pose=moved))
    )
    assert one is not None
    assert other is not None
    np.testing.assert_array_equal(one.angles, other.angles)
    np.testing.assert_array_equal(one.std, other.std)
    assert other.distance > 2.0 * one.distance
    assert not other.inside


def test_encoders_are_known_before_the_pose_is() -> None:
    robot, vision, q = SeenRobot(2), updater(), postures(1, 9)[0]
    observation = robot.observation(q)
    without = vision.forecast.predict(vision.memory, [observation])
    with_them = vision.forecast.predict(vision.memory, [observation._replace(joint_angles=q)])
    assert without is not None
    assert with_them is not None
    assert np.abs(with_them.angles - q).max() < 0.01
    assert np.all(with_them.std < 0.01)
    assert np.all(without.std > with_them.std)


def test_numbers_that_are_not_measured_do_not_count() -> None:
    robot, vision = SeenRobot(2), updater()
    observation = robot.observation(postures(1, 9)[0])
    found = vision.forecast.predict(vision.memory, [observation])
    plain = vision.forecast.predict(vision.memory, [observation._replace(covariance=None)])
    assert found is not None
    assert plain is not None
    assert (found.measured, plain.measured) == (3, 6)
    assert np.isnan(found.rotation_error)
    assert np.isnan(found.rotation_std)
    assert found.position_error == pytest.approx(plain.position_error)
    assert "deg" not in found.sentence


def test_the_expected_error_is_that_of_many_observations() -> None:
    """Over robots of the prior the mean square of the first errors is what was expected."""
    first = [observations[0] for observations in predictions(1.0)]
    errors = np.sqrt(np.mean([one.position_error**2 for one in first]))
    expected = np.sqrt(np.mean([one.position_std**2 for one in first]))
    assert 0.7 < errors / expected < 1.4
    assert expected > 3.0 * POSITION_NOISE * np.sqrt(3.0)


class WrongRule:
    """A rule that moves all lengths, or turns right maps around once it is told to."""

    def __init__(self, wrong: float) -> None:
        self.wrong = wrong

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        layers = {group.name: (group.W2, group.b2 + self.wrong) for group in current.groups}
        return current.with_output_layers(layers)


def test_an_update_that_makes_the_hand_worse_is_not_applied_and_named() -> None:
    robot, vision = SeenRobot(4), updater(rule=WrongRule(400.0))
    before = map_of(vision)
    seen = see(vision, robot.observation(postures(1, 3)[0]))
    assert not seen.learned
    assert seen.reason == REFUSED
    assert seen.hand_error is not None
    assert seen.hand_error.after > seen.hand_error.before
    assert map_of(vision) is before
    assert vision.dropped == {REFUSED: 1}
    assert vision.fired == 0
    assert len(vision.memory.observations) == 1  # what was seen is not lost


def test_updates_are_applied_where_the_expected_error_falls_and_the_true_one_follows() -> None:
    judged, shares = hand_postures(), []
    for seed in range(6):
        robot, vision = SeenRobot(seed), updater()
        for q in postures(6, 700 + seed):
            seen = see(vision, robot.observation(q))
            assert seen.learned or seen.reason in (NO_BETTER, REFUSED)
            if seen.learned:
                assert seen.hand_error is not None
                assert seen.hand_error.falls
        rows = judged.rows(vision.forecast.prior.map, 0.001)
        off = map_of(vision).lengths(judged.postures) - robot.lengths(judged.postures)
        true = np.sqrt(np.mean(np.sum(np.einsum("pam,pm->pa", rows, off) ** 2, axis=1)))
        last = vision.forecast.hand_error(vision.memory, map_of(vision), map_of(vision))
        assert last is not None
        shares.append(true / last.after)
    assert 0.5 < np.median(shares) < 1.5


def test_a_map_that_holds_commands_is_not_judged() -> None:
    robot, vision = SeenRobot(4), updater(rule=WrongRule(400.0), lengths="min")
    seen = see(vision, robot.observation(postures(1, 3)[0]))
    assert seen.learned
    assert seen.hand_error is None


def test_an_update_is_applied_only_where_the_expected_error_falls() -> None:
    assert why_not_applied(None) == ""
    assert why_not_applied(HandErrors(0.02, 0.01)) == ""
    assert why_not_applied(HandErrors(0.02, 0.0201)) == NO_BETTER
    assert why_not_applied(HandErrors(0.02, 0.03)) == REFUSED


def test_rests_without_an_observation_are_learned_from_with_those_that_have_one() -> None:
    """The map is the most probable one of all rests, so that each update lowers the error."""

    def learned(seed: int, rests: int) -> float:
        robot, vision = SeenRobot(seed), updater()
        rested = [Rest(robot.lengths(q), np.full(8, np.nan), q) for q in postures(rests, 900)]
        memory = vision.memory
        vision.memory = memory._replace(rests=memory.rests._replace(rests=tuple(rested)))
        reasons = [see(vision, robot.observation(q)).reason for q in postures(4, 700 + seed)]
        assert set(reasons) == {""}
        at = postures(40, 5)
        off = map_of(vision).lengths(at) - robot.lengths(at)
        return float(np.sqrt(np.mean(off**2)))

    better = [learned(seed, 8) / learned(seed, 0) for seed in range(6)]
    assert np.median(better) < 0.85


@pytest.mark.parametrize(("reason", "named"), [(NO_BETTER, False), (REFUSED, True)])
def test_only_updates_that_would_do_harm_show_a_fault(reason: str, named: bool) -> None:
    monitor = LearningMonitor(LearningMonitorOptions(observations=10))
    for count in range(1, 13):
        monitor.observed(0, {reason: count})
    monitor.update(1.0, SettlingDetector(SettlingOptions()), ("m0",))
    kinds = [fault.kind for fault in monitor.faults]
    assert kinds == ([NOTHING_LEARNED] if named else [])
    assert not named or reason in monitor.faults[0].detail


def observation_of(distance: float, measured: int = 6) -> Seen:
    angles = np.zeros(4)
    one = ObservationPrediction(
        angles, np.full(4, 0.1), 0.02, 0.03, np.nan, np.nan, distance, measured
    )
    return Seen(angles, angles, True, "", predicted=one, hand_error=HandErrors(0.03, 0.02))


def test_the_factor_is_learned_from_observations_before_and_follows_a_change() -> None:
    record, rng = PredictionRecord(), np.random.default_rng(0)
    for _ in range(40):
        record.add(observation_of(0.1 * rng.chisquare(6)))
    assert 0.03 < record.factor < 0.3
    assert record.newest[-1].predicted.position_std == pytest.approx(
        0.03 * np.sqrt(record.newest[-1].predicted.position_std ** 2 / 0.03**2)
    )
    assert record.newest[0].predicted.position_std == 0.03  # nothing was known before the first
    record.add(observation_of(20.0))
    assert not record.newest[-1].predicted.inside
    for _ in range(6):
        record.add(observation_of(20.0))
    assert record.newest[-1].predicted.inside
    assert record.factor > 2.0


def test_a_observation_is_written_to_the_log(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        PredictionRecord().add(observation_of(3.0))
    assert "the hand is 20 mm (30 mm) from where it was expected" in caplog.text
    assert "goes from 30 mm to 20 mm with the new map" in caplog.text


def test_few_observations_make_wider_regions() -> None:
    narrow = observation_of(14.0).predicted
    assert narrow is not None
    assert not narrow.inside
    assert narrow.scaled(1.0, 6.0).inside


def test_a_robot_whose_hand_moves_with_all_joints_is_judged_by_its_lever() -> None:
    """Rows of the hand's error are its lever times how joints follow lengths."""
    vision: VisionUpdater = updater()
    nominal = vision.forecast.prior
    judged = hand_postures()
    rows, move = judged.rows(nominal.map, 1e-6), np.array([0.01, -0.02, 0.03, 0.01])
    changes = nominal.map.jacobian(judged.postures) @ move
    found = np.einsum("pam,pm->pa", rows, changes)
    np.testing.assert_allclose(found, np.tile(LEVER @ move, (12, 1)), rtol=1e-3, atol=1e-6)
