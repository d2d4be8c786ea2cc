"""Transition from one map to the next."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.map_transition import MapTransition
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.options import AgentOptions
from tests.jmm_agent.test_agent import START, Trial

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


def test_an_episode_begins_without_a_transition(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    """A map that entered since the last command does not move the first one away from the arm."""
    trial = Trial(nominal_map, arm, detector=None, learn_antagonism=False, learn_vision=False)
    trial.rest(START, 5)
    agent = trial.agent
    layers = {g.name: (g.W2, g.b2 + 20.0) for g in nominal_map.groups}
    longer = nominal_map.with_output_layers(layers)
    for moving in (False, True):
        agent.learner.map = longer
        agent._map_changed()
        if moving:
            trial.step()
        agent.begin_episode()
        command = trial.step()
        assert np.abs(command - longer.lengths(agent.joint_angles)).max() < 0.002
        trial.rest(START, 60)
        agent.learner.map = nominal_map
        agent._map_changed()
        trial.rest(START, 60)


@pytest.mark.parametrize("rate", [0.0, -0.03, np.nan])
def test_a_rate_that_is_not_positive_is_refused(rate: float) -> None:
    with pytest.raises(AgentError, match=r"map_rate is .* must be positive"):
        AgentOptions(map_rate=rate)
