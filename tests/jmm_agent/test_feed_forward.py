"""Feed-forward: stretches follow the trajectory from posture to posture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from jmm_agent.feed_forward import FeedForward
from jmm_agent.trajectory import Trajectory
from jmm_agent.types import Floats

TRAJECTORY = Trajectory(np.array([[0.0], [1.0], [2.0]]), 5.0, 2.0)


class Held(NamedTuple):
    """A posture that two muscles hold."""

    stretch: Floats
    reachable: bool = True
    tension: float = 1.0
    reason: str = ""


def along(target: float = 2.0) -> FeedForward:
    """Stretches of 0, 1 and 3 mm of the first muscle, and 2, 0 and 0 mm of the second."""
    holds = [Held(np.array([0.001, 0.0])), Held(np.array([0.003, 0.0]))]
    return FeedForward.along(np.array([0.0, 0.002]), holds, np.array([target]))


@pytest.mark.parametrize("time", [4.0, 5.0, 5.3, 6.0, 6.6, 7.0, 9.0])
def test_stretches_are_interpolated_between_the_postures_of_a_trajectory(time: float) -> None:
    [angle] = TRAJECTORY.at(time)
    expected = [
        np.interp(angle, [0.0, 1.0, 2.0], [0.0, 0.001, 0.003]),
        np.interp(angle, [0.0, 1.0, 2.0], [0.002, 0.0, 0.0]),
    ]
    np.testing.assert_allclose(along().at(TRAJECTORY, time), expected, atol=1e-12)


def test_commands_to_another_target_are_not_stretched() -> None:
    np.testing.assert_array_equal(along(target=1.5).at(TRAJECTORY, 6.0), [0.0, 0.0])
    none = FeedForward.none(2, np.array([2.0]))
    np.testing.assert_array_equal(none.at(TRAJECTORY, 6.0), [0.0, 0.0])
