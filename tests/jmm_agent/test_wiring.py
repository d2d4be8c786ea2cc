"""Muscles that are not those of the nominal model: found by evidence, named, and put right.

The robots have other counts of joints and muscles than Kengoro's arm, and other sizes; they were
zeroed at another posture, and some of their joints are not seen.
"""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.commander import Commander
from jmm_agent.guard.faults import (
    MUSCLE_ABSENT,
    MUSCLE_REVERSED,
    MUSCLE_SNAPPED,
    MUSCLE_UNSTABLE,
    MUSCLES_SWAPPED,
    TENSION_LIMIT,
    MotorControl,
)
from jmm_agent.learning.job import LearningJob
from jmm_agent.map_consistency import CONTRADICTED, consistency_of
from jmm_agent.observation import SensorReadings
from jmm_agent.tension_watch import LASTING, TensionWatch
from jmm_agent.types import Floats, Ints
from jmm_agent.updaters.assignment import Assignment, step_between
from jmm_agent.updaters.wiring_evidence import Miswiring
from jmm_agent.vision.hold_out import HoldOutOptions
from jmm_agent.wiring import Wiring
from tests.jmm_agent.small_robot import SmallRobot, map_of

MOTORS = MotorControl()


def exchanged(muscles: int, first: int, second: int) -> Ints:
    order = np.arange(muscles)
    order[[first, second]] = second, first
    return order


def test_observations_that_are_held_out_count_no_more_once_muscles_are_exchanged_back() -> None:
    world = SmallRobot(order=exchanged(14, 2, 9), hold_out=HoldOutOptions(every=2))
    held = world.vision.hold_out
    assert held is not None
    for _ in range(12):
        before = len(held.pairs.noise)
        if world.observe():
            break
    assert world.named == [(MUSCLES_SWAPPED, (2, 9))]
    assert before > 0
    assert len(held.pairs.noise) == 0


@pytest.mark.parametrize(
    ("joints", "muscles", "size", "pair", "seed"),
    [(5, 14, 1.0, (2, 9), 0), (4, 10, 0.3, (0, 1), 1), (6, 18, 3.0, (16, 17), 2)],
)
def test_two_exchanged_muscles_are_named_within_five_observations_and_exchanged_back(
    joints: int, muscles: int, size: float, pair: tuple[int, int], seed: int
) -> None:
    world = SmallRobot(joints, muscles, size, seed, exchanged(muscles, *pair))
    world.observe_several(5)
    assert world.named == [(MUSCLES_SWAPPED, pair)]
    assert tuple(world.vision.assignment.channels(muscles)) == tuple(exchanged(muscles, *pair))
    world.observe_several(15)
    healthy = SmallRobot(joints, muscles, size, seed)
    healthy.observe_several(20)
    assert np.median(world.error()) < 1.5 * np.median(healthy.error()) + 1e-5
    assert world.error()[list(pair)].max() < 3.0 * healthy.error().max()


@pytest.mark.parametrize(("size", "seed"), [(1.0, 0), (0.3, 1)])
def test_a_muscle_that_does_not_follow_the_joints_is_named_and_left_out(
    size: float, seed: int
) -> None:
    world = SmallRobot(size=size, seed=seed)
    world.absent = 6
    world.observe_several(8)
    assert world.named == [(MUSCLE_ABSENT, (6,))]
    assert world.vision.assignment.left_out == (6,)
    world.observe_several(12)
    healthy = SmallRobot(size=size, seed=seed)
    healthy.observe_several(20)
    others = np.arange(14) != 6
    assert np.median(world.error()[others]) < 1.5 * np.median(healthy.error()[others])


def test_a_muscle_with_the_other_sign_is_named_and_left_out() -> None:
    world = SmallRobot(seed=3)
    world.signs[4] = -1.0
    world.observe_several(6)
    assert world.named == [(MUSCLE_REVERSED, (4,))]
    assert world.vision.assignment.left_out == (4,)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_named_on_a_robot_like_its_model(seed: int) -> None:
    world = SmallRobot(seed=seed, size=(1.0, 0.3)[seed % 2])
    world.observe_several(16)
    assert world.named == []


def test_muscles_with_the_same_path_are_not_distinguished() -> None:
    world = SmallRobot(order=exchanged(14, 0, 1), twins=True)
    world.observe_several(8)
    assert world.named == []


def test_one_pose_of_another_posture_names_no_muscle() -> None:
    for wrong_at in (0, 2, 4):
        world = SmallRobot(seed=5)
        for number in range(6):
            world.observe(world.postures(1)[0] if number == wrong_at else None)
        assert world.named == []


def test_a_muscle_that_is_elongated_again_and_again_is_left_out() -> None:
    world = SmallRobot(seed=1)
    world.observe_several(8)
    for _ in range(4):
        world.offset[3] += 0.03
        world.observe_several(3)
    assert world.named == [(MUSCLE_UNSTABLE, (3,))]
    assert world.vision.assignment.left_out == (3,)


def test_a_muscle_that_was_elongated_once_is_not_named() -> None:
    for seed in range(3):
        world = SmallRobot(seed=seed)
        world.observe_several(6)
        world.offset[3] += 0.02
        world.observe_several(6)
        assert world.named == []


def test_muscles_are_named_but_kept_where_a_joint_would_have_none_left() -> None:
    world = SmallRobot(joints=4, muscles=6, seed=2)
    watch = world.vision._wiring
    assert watch.may_leave_out(Assignment(), (0,))
    assert not watch.may_leave_out(Assignment(left_out=(1,)), (0,))
    kept = Assignment().finding(Miswiring(MUSCLE_ABSENT, (0,)), 6, leave_out=False)
    assert (kept.left_out, len(kept.named)) == ((), 1)


def test_a_job_from_before_an_exchange_is_learned_in_the_order_of_now() -> None:
    now = Assignment().finding(Miswiring(MUSCLES_SWAPPED, (0, 2)), 4)
    values = np.array([10.0, 11.0, 12.0, 13.0])
    job = LearningJob("antagonism", 0.0, np.zeros(2), values, values + 1, values + 2)
    ordered = job.ordered(now)
    np.testing.assert_array_equal(ordered.lengths, [12.0, 11.0, 10.0, 13.0])
    np.testing.assert_array_equal(ordered.tensions, ordered.lengths + 2)
    assert ordered.ordered(now) is ordered
    back = now.finding(Miswiring(MUSCLES_SWAPPED, (0, 2)), 4)
    assert back.order == ()
    np.testing.assert_array_equal(step_between(now, back, 4), [2, 1, 0, 3])


def test_no_channel_jumps_when_muscles_are_exchanged() -> None:
    """The transition takes the difference, and ends at the map's lengths."""
    jmm, limits = map_of(3, 6, 1.0), np.column_stack([-np.ones(3), np.ones(3)])
    rate, rng = 0.1, np.random.default_rng(0)
    commander = Commander(jmm, np.array([0.4, -0.5, 0.3]), limits, rate)
    now = Assignment().finding(Miswiring(MUSCLES_SWAPPED, (1, 4)), 6)
    commander.start(np.array([0.4, -0.5, 0.3]), 0.0, commander.target_lengths)

    times = np.cumsum(rng.uniform(0.01, 0.03, 200)).tolist()

    def command() -> Floats:
        passed = commander.advance(times.pop(0))
        found = commander.command(jmm, None, commander.target_lengths, passed, None)
        commander.target_lengths = found
        return found

    channels = command()
    commander.reorder(step_between(Assignment(), now, 6))
    order = now.channels(6)
    for _ in range(100):
        before, channels = channels, np.empty(6)
        channels[order] = command()
        assert np.abs(channels - before).max() <= 0.03 * rate + 1e-9
    np.testing.assert_allclose(channels[order], jmm.lengths(commander.target), atol=1e-9)


@pytest.mark.parametrize(("taut", "kind"), [(True, MUSCLE_SNAPPED), (False, MUSCLE_ABSENT)])
def test_a_muscle_that_is_wound_up_without_tension_is_lost(taut: bool, kind: str) -> None:
    jmm = map_of(3, 6, 0.5)
    wiring = Wiring(jmm, np.column_stack([-np.ones(3), np.ones(3)]))
    rng, time, expected = np.random.default_rng(2), 0.0, jmm.lengths(np.zeros(3))
    lengths, tensions = expected.copy(), np.full(6, 60.0)
    for step in range(400):
        time += rng.uniform(0.005, 0.02)
        if step > 10 or not taut:
            tensions[2] = rng.normal(0.0, 1.0)
            lengths[2] -= 0.1 * 0.0125
        tensions[4] = 0.0  # a dead sensor
        in_use = ~wiring.left_out
        wiring.watch(SensorReadings(time, lengths, tensions), expected, MOTORS, in_use)
    assert wiring.apply(Assignment(), time) is not None
    assert [(fault.kind, fault.where) for fault in wiring.faults] == [(kind, "m2")]
    assert wiring.left_out.tolist() == [False, False, True, False, False, False]
    assert wiring.reason(2)[0] == kind


def test_a_tension_that_stays_at_its_limit_stops_the_motion_once_and_a_short_one_does_not() -> None:
    for limit in (500.0, 8.0):
        motors = MotorControl(limit=limit, bias=0.06 * limit)
        watch, rng, time = TensionWatch(("a", "b")), np.random.default_rng(1), 0.0
        stops = []
        for number in range(1500):
            passed = rng.uniform(0.005, 0.015)
            time += passed
            short = limit if number % 300 < 150 else 0.1 * limit
            tensions = np.array([short, limit if number > 400 else 0.2 * limit])
            readings = SensorReadings(time, np.zeros(2), tensions)
            if watch.update(readings, passed, motors):
                stops.append(time)
        assert len(stops) == 2
        assert stops[1] - stops[0] >= LASTING
        assert [(fault.kind, fault.where) for fault in watch.faults] == [(TENSION_LIMIT, "b")]


@pytest.mark.parametrize(("joints", "muscles", "size"), [(4, 10, 0.3), (6, 18, 2.0)])
def test_lengths_are_consistent_with_a_learned_map_and_not_with_one_that_is_wrong(
    joints: int, muscles: int, size: float
) -> None:
    world = SmallRobot(joints, muscles, size, seed=4)
    for _ in range(8):
        world.observe()
    pairs, prior = world.vision.pairs, world.learner.prior
    assert prior is not None

    def found(wrong: Floats) -> list[float]:
        """Values over the upper end, at further postures."""
        shares = []
        for q in world.postures(40):
            residual = world.lengths(q) + wrong - world.learner.map.lengths(q)
            std = np.hypot(prior.spread(pairs.postures, pairs.noise, q), prior.options.noise)
            jacobian = world.learner.map.jacobian(q[None])[0]
            one = consistency_of(residual, jacobian, CONTRADICTED * std, 0.95)
            assert one is not None
            assert one.consistent == (one.value <= one.high)
            shares.append(one.value / one.high)
        return shares

    assert np.mean(np.array(found(np.zeros(muscles))) <= 1.0) >= 0.9
    wrong = np.zeros(muscles)
    wrong[3] = 0.015 * size
    assert np.mean(np.array(found(wrong)) > 1.0) >= 0.9


def test_contradictions_are_those_that_no_movement_of_the_joints_explains() -> None:
    rng = np.random.default_rng(0)
    jacobian, std = rng.normal(size=(9, 3)), rng.uniform(0.5, 2.0, 9)
    std[4] = np.inf
    moved = consistency_of(jacobian @ rng.normal(size=3), jacobian, std, 0.95)
    assert moved is not None
    assert moved.value < 1e-18
    shares = [
        consistency_of(rng.normal(0.0, np.minimum(std, 1e9)), jacobian, std, 0.95)
        for _ in range(2000)
    ]
    assert abs(np.mean([one.consistent for one in shares if one]) - 0.95) < 0.015
    assert consistency_of(np.ones(3), jacobian[:3], std[:3], 0.95) is None


def test_a_muscle_that_was_lost_and_repaired_is_lost_no_more() -> None:
    jmm = map_of(3, 6, 0.5)
    wiring = Wiring(jmm, np.column_stack([-np.ones(3), np.ones(3)]))
    time, expected = 0.0, jmm.lengths(np.zeros(3))
    lengths, tensions = expected.copy(), np.full(6, 60.0)
    for _ in range(400):
        time += 0.01
        tensions[2], lengths[2] = 0.0, lengths[2] - 0.00125
        in_use = ~wiring.left_out
        wiring.watch(SensorReadings(time, lengths, tensions), expected, MOTORS, in_use)
    assert wiring.apply(Assignment(), time) is not None
    learned = wiring.assignment
    wiring.mended(2)
    assert wiring.apply(learned.mended(2), time) is not None
    assert not wiring.left_out.any()
    assert wiring.faults == []
    assert wiring.apply(learned.mended(2), time) is None
