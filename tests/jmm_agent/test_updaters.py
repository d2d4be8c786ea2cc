"""When the updaters fire, what they learn, and what they refuse, on a small map.

The look of these tests shows three joints as the marker's offset and the fourth as its rotation.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule
from jmm_agent.mapping.minibatch import MinibatchRule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.updaters import (
    AntagonismOptions,
    AntagonismUpdater,
    Seen,
    VisionOptions,
    VisionUpdater,
)
from jmm_agent.vision.observation_fit import ObservationFitOptions
from tests.jmm_agent.small_map import LIMITS, make_map, postures

MIDDLE = LIMITS.mean(axis=1)
CALM = np.full(5, 50.0)


def picture(q: np.ndarray) -> np.ndarray:
    """The pose that a look at the posture gives."""
    pose = np.eye(4)
    pose[:3, 3], pose[3, 0] = q[:3], q[3]
    return pose


def sight(q: np.ndarray, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    error = np.array([*(q[:3] - pose[:3, 3]), q[3] - pose[3, 0], 0.0, 0.0])
    return error, np.eye(6)[:, :4]


class Recorder:
    """The ridge rule, and what it was given."""

    def __init__(self, prior: MapPrior) -> None:
        self.rule = RidgeRule(prior)
        self.calls: list[tuple[Pairs, Pairs]] = []

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        self.calls.append((remembered, batch))
        return self.rule.move(current, remembered, batch)


class Bench:
    """Both updaters on one learner, and a robot whose lengths are off by a constant."""

    def __init__(self, rule: Any = None, **options: Any) -> None:
        self.start = make_map(0)
        prior = MapPrior(self.start, postures(100, 8), PriorOptions())
        self.rule = Recorder(prior)
        self.learner = Learner(
            self.start, LIMITS, rule or self.rule, BatchOptions(), np.random.default_rng(0)
        )
        self.vision = VisionUpdater(self.learner, prior, sight, LIMITS, VisionOptions(**options))

    def lengths(self, q: np.ndarray) -> np.ndarray:
        return self.start.lengths(q) + 0.01

    def look(self, q: np.ndarray, **more: Any) -> Seen:
        """A look at a robot that is at ``q``."""
        lengths = self.lengths(q)
        given = {
            "pose": picture(q),
            "estimate": q + 0.05,
            "lengths": lengths,
            "target": lengths,
            "tensions": CALM,
        }
        return self.vision.seen(**(given | more))

    @property
    def state(self) -> tuple[Any, ...]:
        vision = self.vision
        pairs = [part.tobytes() for part in vision.pairs]
        return (self.learner.map, vision.fired, dict(vision.dropped), *pairs)


def test_a_look_gives_the_joints_and_moves_the_map_towards_the_robot() -> None:
    bench = Bench()
    seen = bench.look(MIDDLE)
    assert seen.learned
    assert seen.reason == ""
    np.testing.assert_allclose(seen.angles, MIDDLE, atol=5e-3)
    np.testing.assert_allclose(seen.error, MIDDLE + 0.05 - seen.angles, atol=1e-12)
    np.testing.assert_allclose(bench.learner.map.lengths(MIDDLE), bench.lengths(MIDDLE), atol=1e-3)
    assert bench.vision.fired == 1


@pytest.mark.parametrize("kind", ["l", "l_target", "min"])
def test_the_pair_holds_the_lengths_that_were_asked_for(kind: str) -> None:
    bench = Bench(lengths=kind)
    lengths = bench.lengths(MIDDLE)
    target = lengths + np.array([0.005, -0.005, 0.003, -0.003, 0.0])
    bench.look(MIDDLE, target=target)
    wanted = {"l": lengths, "l_target": target, "min": np.minimum(lengths, target)}[kind]
    np.testing.assert_array_equal(bench.vision.pairs.lengths, wanted[None])
    _, batch = bench.rule.calls[0]
    np.testing.assert_array_equal(batch.lengths[0], wanted)
    np.testing.assert_allclose(batch.postures[0], MIDDLE, atol=5e-3)
    assert len(batch.postures) == 10


def test_it_fires_only_far_enough_from_its_last_update() -> None:
    bench = Bench(distance=0.15)
    assert bench.look(MIDDLE).learned
    after = bench.learner.map
    near = MIDDLE + np.array([0.06, 0.06, -0.06, 0.06])  # 0.12 rad
    seen = bench.look(near)
    assert (seen.learned, seen.reason) == (False, "too close to the last update")
    assert bench.learner.map is after
    far = MIDDLE + np.array([0.1, 0.1, -0.1, 0.1])  # 0.2 rad
    assert bench.look(far).learned
    # The distance is from the last update, not from the first.
    assert bench.look(MIDDLE).learned
    assert bench.vision.dropped == {"too close to the last update": 1}
    assert bench.vision.fired == 3


def test_a_look_far_from_the_estimate_is_dropped_and_counted() -> None:
    bench = Bench(threshold=0.5)
    for times in (1, 2):
        seen = bench.look(MIDDLE, estimate=MIDDLE + 0.3)  # 0.6 rad
        assert (seen.learned, seen.reason) == (False, "too far from the estimate")
        assert bench.vision.dropped == {"too far from the estimate": times}
        assert bench.learner.map is bench.start
    assert bench.look(MIDDLE, estimate=MIDDLE + 0.2).learned  # 0.4 rad


def test_a_pose_that_no_posture_gives_is_dropped_and_counted() -> None:
    bench = Bench()
    seen = bench.look(MIDDLE, pose=picture(LIMITS[:, 1] + 0.2), estimate=LIMITS[:, 1])
    assert (seen.learned, seen.reason) == (False, "inverse kinematics did not converge")
    assert bench.vision.dropped == {seen.reason: 1}
    assert bench.learner.map is bench.start


def test_bad_looks_leave_no_trace_in_what_good_ones_teach() -> None:
    clean, spoilt = Bench(threshold=0.5), Bench(threshold=0.5)
    for q in (MIDDLE, MIDDLE + 0.2, MIDDLE - 0.2):
        spoilt.look(MIDDLE, estimate=MIDDLE + 0.3, lengths=np.full(5, 0.3))
        spoilt.look(MIDDLE, pose=picture(LIMITS[:, 1] + 0.2))
        clean.look(q)
        spoilt.look(q)
    assert sum(spoilt.vision.dropped.values()) == 6
    for one, other in zip(clean.learner.map.groups, spoilt.learner.map.groups, strict=True):
        np.testing.assert_array_equal(one.W2, other.W2)
        np.testing.assert_array_equal(one.b2, other.b2)


def test_a_saturated_wire_gives_no_pair() -> None:
    bench = Bench(saturation=450.0)
    bench.look(MIDDLE, tensions=np.array([50.0, 50.0, 451.0, 50.0, 50.0]))
    assert len(bench.vision.pairs.postures) == 0
    for remembered, batch in bench.rule.calls:
        for part in (remembered, batch):
            assert not np.any(np.all(np.abs(part.postures - MIDDLE) < 0.01, axis=1))
    bench.look(MIDDLE + 0.2, tensions=np.full(5, 449.0))
    np.testing.assert_allclose(bench.vision.pairs.postures, [MIDDLE + 0.2], atol=5e-3)


@pytest.mark.parametrize("side", [0, 1])
def test_a_joint_at_its_stop_gives_no_pair(side: int) -> None:
    bench = Bench(stop_margin=0.02)
    held = MIDDLE.copy()
    held[2] = LIMITS[2, side]
    bench.look(held)
    assert len(bench.vision.pairs.postures) == 0
    bench.look(MIDDLE)
    np.testing.assert_allclose(bench.vision.pairs.postures, [MIDDLE], atol=5e-3)


def test_looking_without_learning_leaves_everything_as_it_was() -> None:
    learned, asked = Bench(), Bench()
    for bench in (learned, asked):
        bench.look(MIDDLE)
    before = asked.state
    for q in (MIDDLE, MIDDLE + 0.2):
        seen = asked.look(q, learn=False)
        assert not seen.learned
    asked.look(MIDDLE + 0.2, estimate=MIDDLE - 1.0, learn=False)
    assert asked.state[0] is before[0]
    assert asked.state[1:] == before[1:]
    np.testing.assert_array_equal(
        asked.look(MIDDLE + 0.2, learn=False).angles, learned.look(MIDDLE + 0.2).angles
    )
    assert asked.look(MIDDLE + 0.2).learned


def test_only_the_newest_looks_are_remembered() -> None:
    bench = Bench(observations=ObservationFitOptions(memory=2))
    asked = [MIDDLE, MIDDLE + 0.2, MIDDLE - 0.2]
    for q in asked:
        assert bench.look(q).learned
    np.testing.assert_allclose(bench.vision.pairs.postures, asked[1:], atol=5e-3)
    np.testing.assert_array_equal(bench.vision.pairs.lengths, [bench.lengths(q) for q in asked[1:]])


def test_earlier_pairs_and_the_other_updaters_are_remembered() -> None:
    bench = Bench()
    other = Pairs(postures(2, 5), np.full((2, 5), 0.01), np.full(2, 0.02))
    bench.look(MIDDLE)
    bench.look(MIDDLE + 0.2, antagonism=other)
    remembered, batch = bench.rule.calls[1]
    np.testing.assert_allclose(remembered.postures[0], MIDDLE, atol=5e-3)
    np.testing.assert_array_equal(remembered.postures[1:], other.postures)
    np.testing.assert_allclose(batch.postures[0], MIDDLE + 0.2, atol=5e-3)


def test_the_papers_rule_learns_too() -> None:
    bench = Bench(MinibatchRule(steps=300, rate=0.1), lengths="l_target")

    def missed() -> float:
        return float(np.abs(bench.learner.map.lengths(MIDDLE) - bench.lengths(MIDDLE)).mean())

    before = missed()
    assert bench.look(MIDDLE).learned
    assert missed() < 0.8 * before


# The Antagonism Updater


def antagonism(bench: Bench, **options: Any) -> AntagonismUpdater:
    return AntagonismUpdater(bench.learner, AntagonismOptions(**options))


def test_antagonism_learns_the_estimate_and_the_measured_lengths() -> None:
    bench = Bench()
    updater = antagonism(bench, noise=0.02)
    lengths = bench.lengths(MIDDLE)
    remembered = Pairs(postures(1, 5), np.full((1, 5), 0.01), np.full(1, 0.001))
    assert updater.settled(MIDDLE, lengths, remembered)
    given, batch = bench.rule.calls[0]
    np.testing.assert_array_equal(batch.postures[0], MIDDLE)
    np.testing.assert_array_equal(batch.lengths[0], lengths)
    assert (len(batch.noise), batch.noise[0]) == (10, 0.02)
    np.testing.assert_array_equal(given.postures, remembered.postures)
    assert bench.learner.map is not bench.start


def test_antagonism_fires_only_far_enough_from_its_last_update() -> None:
    bench = Bench()
    updater = antagonism(bench, distance=0.15)
    none = Pairs.none(4, 5)
    lengths = bench.lengths(MIDDLE)
    assert updater.settled(MIDDLE, lengths, none)
    after = bench.learner.map
    step = np.array([0.06, 0.06, -0.06, 0.06])  # 0.12 rad
    assert not updater.settled(MIDDLE + step, lengths, none)
    assert bench.learner.map is after
    assert updater.settled(MIDDLE + 2 * step, lengths, none)
    assert not updater.settled(MIDDLE + step, lengths, none)
    assert updater.settled(MIDDLE, lengths, none)
    assert updater.fired == 3


def test_antagonism_remembers_its_newest_pairs() -> None:
    bench = Bench()
    updater = antagonism(bench, memory=2)
    asked = [MIDDLE, MIDDLE + 0.2, MIDDLE - 0.2, MIDDLE]
    for q in asked:
        updater.settled(q, bench.lengths(q), Pairs.none(4, 5))
    np.testing.assert_array_equal(updater.pairs.postures, asked[2:])
    remembered, _ = bench.rule.calls[3]
    np.testing.assert_array_equal(remembered.postures, asked[1:3])


def test_an_estimate_that_is_changed_afterwards_does_not_change_the_memory() -> None:
    bench = Bench()
    updater = antagonism(bench)
    estimate, lengths = MIDDLE.copy(), bench.lengths(MIDDLE)
    updater.settled(estimate, lengths, Pairs.none(4, 5))
    estimate += 1.0
    lengths += 1.0
    assert not updater.settled(MIDDLE, bench.lengths(MIDDLE), Pairs.none(4, 5))
    np.testing.assert_array_equal(updater.pairs.postures, [MIDDLE])
    np.testing.assert_array_equal(updater.pairs.lengths, [bench.lengths(MIDDLE)])


def test_defaults_are_whole() -> None:
    options = VisionOptions()
    assert options.lengths == "min"
    assert replace(options, lengths="l_target").lengths == "l_target"


def test_looks_alone_are_learned_one_by_one() -> None:
    """The paper's way: a new look does not change what the earlier ones meant."""
    bench = Bench(fit="alone")
    first = bench.look(MIDDLE)
    kept = bench.vision.pairs.postures[0].copy()
    second = bench.look(MIDDLE + 0.2)
    assert first.learned
    assert second.learned
    np.testing.assert_array_equal(bench.vision.pairs.postures[0], kept)
    np.testing.assert_allclose(second.angles, MIDDLE + 0.2, atol=5e-3)
