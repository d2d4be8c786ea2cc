"""The paper's rule: its steps against textbook Adam with finite-difference gradients."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from jmm_agent.mapping.group_map import GroupMap
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.learner import Pairs
from jmm_agent.mapping.minibatch import MinibatchRule
from tests.jmm_agent.small_map import make_map, postures

NOTHING = Pairs.none(4, 5)
LAYERS = ("W1", "b1", "W2", "b2")


def batch(start: JointMuscleMap, count: int = 10) -> Pairs:
    q = postures(count, 3)
    lengths = start.lengths(q) + 0.01 * np.random.default_rng(0).normal(size=(count, 5))
    return Pairs(q, lengths, np.full(count, 1e-3))


def loss(group: GroupMap, pairs: Pairs) -> float:
    """Mean squared error [mm^2] of one group."""
    wanted = pairs.lengths[:, group.muscle_index]
    return float(np.mean(1e6 * (group.lengths(pairs.postures) - wanted) ** 2))


def gradient(group: GroupMap, layer: str, pairs: Pairs) -> np.ndarray:
    """Finite differences of the loss by one layer."""
    array = getattr(group, layer)
    slope = np.empty(array.shape)
    for index in np.ndindex(array.shape):
        ends = []
        for sign in (1, -1):
            moved = array.copy()
            moved[index] += sign * 1e-4
            ends.append(loss(replace(group, **{layer: moved}), pairs))
        slope[index] = (ends[0] - ends[1]) / 2e-4
    return slope


def adam(group: GroupMap, layers: tuple[str, ...], pairs: Pairs, steps: int, rate: float):
    """Kingma and Ba, algorithm 1, with the defaults of the paper."""
    mean = dict.fromkeys(layers, 0.0)
    square = dict.fromkeys(layers, 0.0)
    for t in range(1, steps + 1):
        slopes = {layer: gradient(group, layer, pairs) for layer in layers}
        for layer, slope in slopes.items():
            mean[layer] = 0.9 * mean[layer] + 0.1 * slope
            square[layer] = 0.999 * square[layer] + 0.001 * slope**2
            root = np.sqrt(square[layer] / (1 - 0.999**t)) + 1e-8
            moved = getattr(group, layer) - rate * mean[layer] / (1 - 0.9**t) / root
            group = replace(group, **{layer: moved})
    return group


@pytest.mark.parametrize("all_layers", [True, False])
def test_steps_are_adams_down_the_finite_difference_gradient(all_layers: bool) -> None:
    start = make_map(0)
    pairs = batch(start)
    moved = MinibatchRule(steps=4, rate=3e-3, all_layers=all_layers).move(start, NOTHING, pairs)
    for group, ours in zip(start.groups, moved.groups, strict=True):
        theirs = adam(group, LAYERS if all_layers else LAYERS[2:], pairs, 4, 3e-3)
        for layer in LAYERS:
            np.testing.assert_allclose(
                getattr(ours, layer), getattr(theirs, layer), rtol=0, atol=1e-6
            )


def test_the_batch_is_fitted_better_and_the_start_is_left_alone() -> None:
    start = make_map(0)
    pairs = batch(start)
    before = [loss(group, pairs) for group in start.groups]
    moved = MinibatchRule(steps=200, rate=1e-2).move(start, NOTHING, pairs)
    for group, error in zip(moved.groups, before, strict=True):
        assert loss(group, pairs) < 0.7 * error
    assert [loss(group, pairs) for group in start.groups] == before
