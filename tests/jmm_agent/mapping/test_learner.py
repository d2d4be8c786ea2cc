"""The update batch, and the ridge rule's correction against its closed form."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import BatchOptions, Learner, Pairs, RidgeRule
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from tests.jmm_agent.small_map import LIMITS, make_map, postures


class Recorder:
    """A rule that records its arguments and returns a fixed map, or the current one."""

    def __init__(self, result: JointMuscleMap | None = None) -> None:
        self.calls: list[tuple[JointMuscleMap, Pairs, Pairs]] = []
        self.result = result

    def move(self, current: JointMuscleMap, remembered: Pairs, batch: Pairs) -> JointMuscleMap:
        self.calls.append((current, remembered, batch))
        return current if self.result is None else self.result


def pair(seed: int, count: int = 1, noise: float = 0.001) -> Pairs:
    rng = np.random.default_rng(seed)
    return Pairs(postures(count, seed), 0.05 * rng.normal(size=(count, 5)), np.full(count, noise))


def learner(rule: Recorder, start: JointMuscleMap, **options: object) -> Learner:
    choice = BatchOptions(**options)  # type: ignore[arg-type]
    return Learner(start, LIMITS, rule, choice, np.random.default_rng(0))


def test_a_batch_is_the_new_pair_the_zero_pair_and_eight_of_the_current_map() -> None:
    first, later = make_map(0), make_map(1)
    rule = Recorder()
    subject = learner(rule, first)
    subject.map = later
    new = pair(5)
    subject.learn(new, Pairs.none(4, 5))
    _, _, batch = rule.calls[0]
    assert [len(part) for part in batch] == [10, 10, 10]
    np.testing.assert_array_equal(batch.postures[0], new.postures[0])
    np.testing.assert_array_equal(batch.lengths[0], new.lengths[0])
    np.testing.assert_array_equal(batch.postures[1], np.zeros(4))
    np.testing.assert_array_equal(batch.lengths[1], np.zeros(5))
    random = batch.postures[2:]
    assert np.all((random >= LIMITS[:, 0]) & (random <= LIMITS[:, 1]))
    assert np.all(np.ptp(random, axis=0) > 0.2 * np.ptp(LIMITS, axis=1))
    np.testing.assert_allclose(batch.lengths[2:], later.lengths(random), atol=1e-15)
    assert np.abs(batch.lengths[2:] - first.lengths(random)).max() > 1e-3


def test_each_batch_rehearses_other_postures_of_the_map_as_it_is_then() -> None:
    moved = make_map(1)
    rule = Recorder(moved)
    subject = learner(rule, make_map(0))
    subject.learn(pair(5), Pairs.none(4, 5))
    subject.learn(pair(6), Pairs.none(4, 5))
    (_, _, one), (current, _, two) = rule.calls
    assert current is moved
    assert subject.map is moved
    assert not np.any(np.isin(one.postures[2:], two.postures[2:]))
    np.testing.assert_allclose(two.lengths[2:], moved.lengths(two.postures[2:]), atol=1e-15)


def test_each_part_of_the_batch_has_its_own_noise() -> None:
    rule = Recorder()
    subject = learner(rule, make_map(0), rehearsal=3, rehearsal_noise=0.03, zero_noise=0.05)
    subject.learn(pair(5, noise=0.002), Pairs.none(4, 5))
    np.testing.assert_allclose(rule.calls[0][2].noise, [0.002, 0.05, 0.03, 0.03, 0.03])


def test_pairs_join_in_order_and_the_newest_are_last() -> None:
    both = pair(1, 3).joined(pair(2, 2))
    np.testing.assert_array_equal(both.postures[3:], pair(2, 2).postures)
    for part, newest in zip(both, both.last(2), strict=True):
        np.testing.assert_array_equal(newest, part[3:])
    assert [len(part) for part in both.last(9)] == [5, 5, 5]
    assert [part.shape for part in both.last(0)] == [(0, 4), (0, 5), (0,)]


def test_the_ridge_rule_explains_what_is_remembered_and_what_is_new() -> None:
    start = make_map(0)
    prior = MapPrior(start, postures(50, 9), PriorOptions())
    subject = Learner(start, LIMITS, RidgeRule(prior), BatchOptions(), np.random.default_rng(0))
    asked = postures(2, 21)
    other = start.lengths(asked) + np.array([[0.02], [0.03]])
    exact = np.full(1, 1e-5)
    old, new = (Pairs(asked[[k]], other[[k]], exact) for k in (0, 1))
    subject.learn(new, old)
    np.testing.assert_allclose(subject.map.lengths(asked), other, atol=2e-4)
    assert np.abs(start.lengths(asked) - other).max() > 0.01


def test_the_ridge_rule_moves_output_layers_only() -> None:
    start = make_map(0)
    prior = MapPrior(start, postures(50, 9), PriorOptions())
    moved = RidgeRule(prior).move(start, Pairs.none(4, 5), pair(3))
    for before, after in zip(start.groups, moved.groups, strict=True):
        np.testing.assert_array_equal(before.W1, after.W1)
        np.testing.assert_array_equal(before.b1, after.b1)
        assert np.abs(before.W2 - after.W2).max() > 0


def test_the_same_generator_makes_the_same_bits() -> None:
    start = make_map(0)
    prior = MapPrior(start, postures(50, 9), PriorOptions())
    layers = []
    for _ in range(2):
        subject = Learner(start, LIMITS, RidgeRule(prior), BatchOptions(), np.random.default_rng(7))
        subject.learn(pair(3), pair(4))
        layers.append(subject.map.groups[0].W2)
    np.testing.assert_array_equal(*layers)


@pytest.mark.parametrize("count", [0, 4])
def test_the_number_of_rehearsed_pairs_is_an_option(count: int) -> None:
    rule = Recorder()
    learner(rule, make_map(0), rehearsal=count).learn(pair(1), Pairs.none(4, 5))
    assert len(rule.calls[0][2].postures) == 2 + count


def test_the_pair_of_zeros_can_be_left_out() -> None:
    rule = Recorder()
    start, new = make_map(0), pair(1)
    learner(rule, start, zero=False, rehearsal=3).learn(new, Pairs.none(4, 5))
    _, _, batch = rule.calls[0]
    assert [len(part) for part in batch] == [4, 4, 4]
    np.testing.assert_array_equal(batch.postures[0], new.postures[0])
    assert np.abs(batch.postures).max(axis=1).min() > 0
    np.testing.assert_allclose(batch.lengths[1:], start.lengths(batch.postures[1:]), atol=1e-15)


def test_a_batch_may_be_the_new_pair_alone() -> None:
    rule = Recorder()
    new = pair(1)
    learner(rule, make_map(0), zero=False, rehearsal=0).learn(new, Pairs.none(4, 5))
    for part, given in zip(rule.calls[0][2], new, strict=True):
        np.testing.assert_array_equal(part, given)
