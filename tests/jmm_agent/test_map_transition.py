"""Transition from one map to the next."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.map_transition import MapTransition

CHANGE = np.array([0.03, -0.015, 0.0])


@pytest.mark.parametrize("period", [0.005, 0.02, 0.1])
def test_no_command_moves_faster_than_the_rate_and_all_arrive_together(period: float) -> None:
    transition = MapTransition(3, 0.03)
    transition.begin(CHANGE)
    left = [-CHANGE]
    for _ in range(round(1.0 / period) + 1):
        left.append(transition.advance(period))
    speed = np.abs(np.diff(left, axis=0)).max() / period
    assert speed == pytest.approx(0.03, rel=1e-6)
    ratio = np.array(left)[:-2, 1] / np.array(left)[:-2, 0]
    np.testing.assert_allclose(ratio, -0.5)
    np.testing.assert_array_equal(left[-1], np.zeros(3))


def test_a_second_change_begins_where_the_first_has_come_to() -> None:
    transition = MapTransition(3, 0.03)
    transition.begin(CHANGE)
    before = transition.advance(0.5)
    transition.begin(-CHANGE)
    np.testing.assert_allclose(transition.advance(0.0), before + CHANGE)


def test_an_infinite_rate_jumps() -> None:
    transition = MapTransition(3, np.inf)
    transition.begin(CHANGE)
    np.testing.assert_array_equal(transition.advance(0.02), np.zeros(3))
