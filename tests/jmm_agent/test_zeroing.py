"""Lengths that were zeroed anew: noticed if not announced, and learned again in a few observations.

Robot, map and marker are those of `test_permanent_elongation`: a small map, all lengths 15 mm off.
"""

from __future__ import annotations

from copy import deepcopy
from functools import cache

import numpy as np
import pytest

from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.updaters import AntagonismOptions, AntagonismUpdater, VisionOptions, VisionUpdater
from jmm_agent.vision.hold_out import HoldOutOptions
from tests.jmm_agent.small_map import LIMITS, make_map, postures
from tests.jmm_agent.small_robot import SmallRobot
from tests.jmm_agent.vision.test_permanent_elongation import marker_residual, observed

BEFORE, AFTER = 15, 4
TRUE = postures(BEFORE + AFTER, 4)
TEST = postures(40, 6)
SHIFT = 0.0035 * np.array([1.3, -0.9, 0.8, -1.2, 1.1])
"""Change of each length by the zeroing [m]."""
SHAPE_ERROR = 0.144
"""Error of the map that `BEFORE` observations leave, if the zero posture is not fitted [mm]."""


class Robot:
    """A Vision Updater, and a robot whose lengths are shorter by some shift."""

    def __init__(self, **options: object) -> None:
        prior = MapPrior(make_map(0), postures(100, 8), PriorOptions())
        rng = np.random.default_rng(0)
        learner = Learner(make_map(0), LIMITS, RidgeRule(prior), BatchOptions(rehearsal=0), rng)
        chosen = VisionOptions(distance=0.0, **options)  # type: ignore[arg-type]
        self.vision = VisionUpdater(learner, prior, marker_residual, LIMITS, chosen)
        self.learner, self.shift = learner, np.zeros(5)

    def observe(self, q: np.ndarray, antagonism: Pairs | None = None) -> bool:
        """Observe the hand at a posture (n,) [rad]; whether a zeroing was noticed."""
        found, calm = observed(q, self.shift), np.zeros(5)
        seen = self.vision.seen(
            found.pose, found.guess, found.lengths, found.lengths, calm, antagonism
        )
        assert seen.learned, seen.reason
        return seen.zeroed

    def error_mm(self) -> float:
        """RMS error of the map over other postures [mm]."""
        true = make_map(0).lengths(TEST) + 0.015 - self.shift
        return float(1e3 * np.sqrt(np.mean((self.learner.map.lengths(TEST) - true) ** 2)))


@cache
def learned_once(**options: object) -> Robot:
    """A robot that has learned from `BEFORE` observations."""
    robot = Robot(**options)
    robot.vision.begin()
    for q in TRUE[:BEFORE]:
        assert not robot.observe(q)
    return robot


def learned(**options: object) -> Robot:
    """A copy of such a robot."""
    return deepcopy(learned_once(**options))


@pytest.mark.parametrize("fit", ["together", "rests"])
@pytest.mark.parametrize("announced", [True, False])
def test_what_was_learned_of_shape_stays_and_offsets_are_learned_again(
    announced: bool, fit: str
) -> None:
    robot, fresh = learned(fit=fit), Robot(fit=fit)
    assert robot.error_mm() < SHAPE_ERROR
    robot.vision.begin()
    if announced:
        robot.vision.zeroed()
    robot.shift = fresh.shift = SHIFT
    noticed = [robot.observe(TRUE[BEFORE])]
    fresh.observe(TRUE[BEFORE])
    assert robot.error_mm() < fresh.error_mm()
    noticed += [robot.observe(q) for q in TRUE[BEFORE + 1 :]]
    assert sum(noticed) == robot.vision.zeroings == (0 if announced else 1)
    assert robot.error_mm() < 1.2 * SHAPE_ERROR
    share = (PriorOptions().zeroing / PriorOptions().elongation) ** 2
    counts = np.vstack([np.full((BEFORE, 5), share), np.zeros((AFTER, 5))])
    np.testing.assert_allclose(robot.vision.elongated, counts)


@pytest.mark.parametrize("elongated", [(), (2,), (0, 3)])
def test_no_zeroing_is_noticed_where_there_is_none(elongated: tuple[int, ...]) -> None:
    robot = learned()
    robot.vision.begin()
    robot.shift = 0.010 * np.isin(np.arange(5), elongated)
    assert not any(robot.observe(q) for q in TRUE[BEFORE:])
    expected = np.outer(np.arange(BEFORE + AFTER) < BEFORE, robot.shift > 0.0)
    np.testing.assert_array_equal(robot.vision.elongated, expected)


def test_looking_for_a_zeroing_changes_no_bit_where_there_is_none() -> None:
    robots = learned(), learned(zeroing_recent=0)
    for robot in robots:
        robot.vision.begin()
        for q in TRUE[BEFORE:]:
            robot.observe(q)
    one, other = (robot.learner.map for robot in robots)
    for group, same in zip(one.groups, other.groups, strict=True):
        np.testing.assert_array_equal(group.W2, same.W2)
        np.testing.assert_array_equal(group.b2, same.b2)


@pytest.mark.parametrize(("recent", "noticed"), [(6, 1), (0, 0)])
def test_a_zeroing_within_an_episode_is_noticed_once_if_it_is_looked_for(
    recent: int, noticed: int
) -> None:
    robot = learned(zeroing_recent=recent)
    robot.vision.begin()
    noticed_before = [robot.observe(q) for q in TRUE[BEFORE : BEFORE + 3]]
    assert not any(noticed_before)
    robot.shift = 3.0 * SHIFT
    assert sum([robot.observe(q) for q in TRUE[BEFORE + 3 :]]) == noticed


def test_the_oldest_observations_may_be_forgotten_meanwhile() -> None:
    options = VisionOptions().observations
    small = type(options)(memory=BEFORE)
    robot = learned(observations=small)
    robot.vision.begin()
    robot.shift = SHIFT
    assert sum([robot.observe(q) for q in TRUE[BEFORE:]]) == 1
    assert robot.vision.elongated.shape == (BEFORE, 5)
    assert (robot.vision.elongated > 0).all(axis=1).sum() == BEFORE - AFTER


def test_a_memory_of_earlier_takes_a_zeroing_back() -> None:
    robot = learned()
    before = robot.vision.memory
    robot.vision.zeroed()
    assert (robot.vision.elongated > 0).all()
    robot.vision.memory = before
    assert not robot.vision.elongated.any()


def test_pairs_of_before_are_not_learned_with_the_observation_that_shows_a_zeroing() -> None:
    robots = learned(), learned()
    old = Pairs(TRUE[:1] + 0.1, make_map(0).lengths(TRUE[:1]) + 0.03, np.array([1e-3]))
    for robot, pairs in zip(robots, (None, old), strict=True):
        robot.vision.begin()
        robot.shift = 3.0 * SHIFT
        assert robot.observe(TRUE[BEFORE], pairs)
    assert robots[0].error_mm() == robots[1].error_mm()


def test_pairs_in_the_old_lengths_are_forgotten() -> None:
    robot = Robot(hold_out=HoldOutOptions())
    assert robot.vision.hold_out is not None
    pair = Pairs(TRUE[:1], np.zeros((1, 5)), np.ones(1))
    for _ in range(5):
        robot.vision.hold_out.keeps(pair)
    robot.vision.zeroed()
    assert len(robot.vision.hold_out.pairs.noise) == 0
    antagonism = AntagonismUpdater(robot.learner, AntagonismOptions())
    antagonism.settled(TRUE[0], np.zeros(5), Pairs.none(4, 5))
    antagonism.forget()
    assert antagonism.memory.last is None
    assert len(antagonism.pairs.noise) == 0


@pytest.mark.parametrize(("size", "seed"), [(1.0, 0), (0.3, 1), (3.0, 2)])
def test_a_zeroing_within_an_episode_is_found_from_the_muscles_that_seem_elongated(
    size: float, seed: int
) -> None:
    robot = SmallRobot(5, 14, size, seed)
    robot.observe_several(12)
    robot.zero = robot.zero + robot.rng.normal(0.0, 0.5, 5)
    before = np.median(robot.error())
    robot.observe_several(8)
    assert robot.vision.zeroings == 1
    assert np.median(robot.error()) < 0.3 * before


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_three_muscles_that_are_elongated_at_once_are_no_zeroing(seed: int) -> None:
    robot = SmallRobot(5, 14, 1.0, seed)
    robot.observe_several(12)
    robot.offset[[1, 6, 11]] += 0.012
    robot.observe_several(8)
    assert robot.vision.zeroings == 0
    assert np.flatnonzero(robot.vision.elongated.any(axis=0)).tolist() == [1, 6, 11]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_large_zeroing_is_one(seed: int) -> None:
    robot = SmallRobot(5, 14, 1.0, seed)
    robot.observe_several(12)
    robot.offset += robot.rng.normal(0.0, 0.03, 14)
    robot.observe_several(8)
    assert robot.vision.zeroings == 1


@pytest.mark.parametrize(("seed", "speed"), [(0, 2.0), (1, 4.0)])
def test_lengths_that_drift_are_not_taken_for_zeroed_in_the_next_episode(
    seed: int, speed: float
) -> None:
    robot = SmallRobot(5, 14, 1.0, seed)
    robot.speeds = speed * 1e-3 / 60.0 * robot.rng.choice([-1.0, 1.0], 14)
    robot.observe_several(25)
    for _ in range(3):
        robot.vision.begin()
        robot.observe_several(6)
    assert robot.vision.zeroings == 0


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 5])
def test_a_hand_that_was_seen_where_it_was_not_is_no_zeroing(seed: int) -> None:
    robot = SmallRobot(5, 14, 1.0, seed)
    robot.observe_several(12)
    robot.observe(robot.postures(1)[0])
    robot.observe_several(6)
    assert robot.vision.zeroings == 0
