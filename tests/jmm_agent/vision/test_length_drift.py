"""Lengths that drift: how it is modelled, found, named, and that the map holds for now."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.updaters import model_choice
from jmm_agent.vision.length_drift import (
    CHANGES,
    PAUSE,
    SPEEDS,
    LengthDrift,
    near_speeds,
)
from jmm_agent.vision.rest_fit import Rest
from tests.jmm_agent.small_robot import SmallRobot

MM_A_MINUTE = 1e-3 / 60.0


def test_what_drifts_steadily_for_a_short_time_is_speed_times_time() -> None:
    ages = np.array([3.0, 2.0, 1.0, 0.0])
    found = LengthDrift(2e-5, ages).covariance
    assert found is not None
    np.testing.assert_allclose(found, 4e-10 * np.outer(ages, ages), rtol=0.01)


def test_what_drifts_for_long_is_a_random_walk() -> None:
    ages = CHANGES * np.array([500.0, 300.0, 100.0])
    found = LengthDrift(1.0, ages).covariance
    assert found is not None
    walk = 2.0 * CHANGES * np.minimum.outer(ages, ages)
    np.testing.assert_allclose(found, walk, rtol=0.02)


def test_the_drift_is_that_of_speeds_that_are_correlated_in_time() -> None:
    rng, step, count = np.random.default_rng(0), 5.0, 200
    keep = np.exp(-step / CHANGES)
    speed = rng.normal(size=4000)
    drifted = [np.zeros(4000)]
    for _ in range(count):  # into the past, from now
        drifted.append(drifted[-1] + step * speed)
        speed = keep * speed + np.sqrt(1.0 - keep**2) * rng.normal(size=4000)
    ages = step * np.array([10, 60, 200])
    found = LengthDrift(1.0, ages).covariance
    assert found is not None
    simulated = np.cov([drifted[int(age / step)] for age in ages])
    np.testing.assert_allclose(found, simulated, rtol=0.1)


def test_no_drift_has_no_covariance() -> None:
    assert LengthDrift(0.0, np.array([2.0, 0.0])).covariance is None


@pytest.mark.parametrize(
    ("before", "after", "passed"),
    [(10.0, 12.5, 2.5), (10.0, 4.0, 0.0), (np.nan, 4.0, 0.0), (1.0, np.nan, 0.0), (0, 1e9, PAUSE)],
)
def test_time_passes_between_observations_of_one_episode(
    before: float, after: float, passed: float
) -> None:
    later = LengthDrift(0.0, np.array([5.0, 0.0]), before).at(after)
    np.testing.assert_array_equal(later.ages, np.array([5.0, 0.0]) + passed)


def test_an_observation_is_of_now_and_the_oldest_is_forgotten() -> None:
    drift = LengthDrift(0.0, np.array([5.0, 2.0]))
    np.testing.assert_array_equal(drift.observing(3).ages, [5.0, 2.0, 0.0])
    np.testing.assert_array_equal(drift.observing(2).ages, [2.0, 0.0])
    np.testing.assert_array_equal(LengthDrift().observing(3).ages, [0.0, 0.0, 0.0])


@pytest.mark.parametrize(("rank", "ranks"), [(0, [1, 2]), (3, [1, 2, 4, 5])])
def test_the_next_speeds_are_compared_with_the_present_one(rank: int, ranks: list[int]) -> None:
    noise = 3e-4
    speeds = np.array(SPEEDS) * noise / 60.0
    np.testing.assert_allclose(near_speeds(float(speeds[rank]), noise), speeds[ranks], atol=1e-15)


def drifting(size: float, seed: int, speed: float, count: int, **more: Any) -> SmallRobot:
    """A robot whose muscles drift by so many noises of a length a minute, after some looks."""
    robot = SmallRobot(5, 14, size, seed, **more)
    robot.speeds = speed * size * MM_A_MINUTE * np.random.default_rng(seed).choice([-1, 1], 14)
    robot.observe_several(count)
    return robot


@pytest.mark.parametrize(("size", "seed", "speed"), [(1.0, 0, 2.0), (0.2, 1, 4.0)])
def test_lengths_that_drift_are_found_to_and_the_map_holds_for_now(
    size: float, seed: int, speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = drifting(size, seed, speed, 45)
    found = robot.vision.memory.rests.drift
    assert 0.5 <= found.speed / (speed * size * MM_A_MINUTE) <= 2.0
    assert found.ages[0] == pytest.approx(44 * robot.pace)
    assert not robot.vision.elongated.any()
    monkeypatch.setattr(model_choice, "LEAST", 1000)
    without = drifting(size, seed, speed, 45)
    assert np.median(robot.error()) < 0.7 * np.median(without.error())


def test_rests_without_an_observation_do_not_hold_the_map_to_lengths_of_before() -> None:
    def after(rests: int) -> SmallRobot:
        robot = SmallRobot(5, 14, 1.0, 2)
        robot.speeds = 3.0 * MM_A_MINUTE * np.random.default_rng(2).choice([-1, 1], 14)
        given = tuple(
            Rest(robot.lengths(q), np.full(14, np.nan), q) for q in robot.postures(8)[:rests]
        )
        memory = robot.vision.memory
        robot.vision.memory = memory._replace(rests=memory.rests._replace(rests=given))
        robot.observe_several(60)
        return robot

    robot, without = after(8), after(0)
    assert robot.vision.memory.rests.drift.speed > 0.0
    assert robot.vision.memory.rests.rests == ()
    assert np.median(robot.error()) < 1.2 * np.median(without.error())


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_lengths_that_do_not_drift_are_not_found_to(seed: int) -> None:
    assert drifting(1.0, seed, 0.0, 30).vision.memory.rests.drift.speed == 0.0


def test_a_muscle_that_is_elongated_is_no_drift_of_all() -> None:
    robot = drifting(1.0, 3, 0.0, 20)
    robot.offset[4] += 0.015
    robot.observe_several(15)
    assert robot.vision.memory.rests.drift.speed == 0.0
    assert np.flatnonzero(robot.vision.elongated.any(axis=0)).tolist() == [4]
