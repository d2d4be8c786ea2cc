"""What is learned from rests in which the hand is not seen: by jobs, and by an agent."""

from __future__ import annotations

import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.job import LearningJob, MapLearning
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats
from jmm_agent.updaters import AntagonismOptions, AntagonismUpdater
from tests.jmm_agent.nominal_arm import posture_set
from tests.jmm_agent.small_map import postures
from tests.jmm_agent.test_agent import Trial
from tests.jmm_agent.vision.test_rest_fit import ZERO, lengths_at, tensions_at, updater


class SmallRobot:
    """Jobs of a robot of the small map, whose estimate is wrong before it is learned."""

    def __init__(self, joint: bool = True) -> None:
        vision = updater()
        options = AntagonismOptions(distance=0.0)
        antagonism = AntagonismUpdater(vision._learner, options)
        self.learning = MapLearning(vision._learner, antagonism, vision, joint)

    def rest(self, q: Floats, remember: bool = True) -> bool:
        """Learn from a rest at joint angles (4,) [rad]; whether the map was moved."""
        lengths = lengths_at(q)
        job = LearningJob("antagonism", 0.0, q - ZERO, lengths, lengths, tensions_at(q))
        result = self.learning.run(job._replace(remember=remember), self.learning.state)
        assert result.state is not None
        return result.moved


def test_pairs_of_a_wrong_estimate_are_forgotten_and_the_fitted_angles_are_learned() -> None:
    robot = SmallRobot()
    for q in postures(4, 4):
        assert robot.rest(q)
    antagonism = robot.learning.antagonism
    assert len(antagonism.pairs.noise) == 4
    last = postures(5, 4)[4]
    assert robot.rest(last)
    [angles] = antagonism.pairs.postures
    away, estimated = np.linalg.norm(angles - last), np.linalg.norm(ZERO)
    assert away < estimated
    assert robot.learning.vision.zero is not None


def test_the_antagonism_updater_goes_on_after_rests_were_learned() -> None:
    robot = SmallRobot()
    for q in postures(10, 4):
        robot.rest(q)
    assert robot.learning.antagonism.fired == 10


def test_rests_are_not_remembered_unless_the_vision_updater_learns() -> None:
    robot = SmallRobot()
    for q in postures(6, 4):
        robot.rest(q, remember=False)
    assert robot.learning.vision.memory.rests.rests == ()
    assert robot.learning.antagonism.fired == 6


def test_rests_are_remembered_without_the_antagonism_updater() -> None:
    robot = SmallRobot(joint=False)
    moved = [robot.rest(q) for q in postures(6, 4)]
    assert moved == [False] * 4 + [True] * 2
    assert robot.learning.antagonism.fired == 0


class NoLoads:
    """Loads of an arm without weight."""

    def gravity(self, posture: Floats) -> Floats:
        return np.zeros(len(posture))


@pytest.mark.parametrize("antagonism", [False, True])
def test_an_agent_without_a_camera_learns_from_its_rests(
    nominal_map: JointMuscleMap, arm: ArmKinematics, antagonism: bool
) -> None:
    trial = Trial(
        nominal_map, arm, detector=None, loads=NoLoads(), camera="", learn_antagonism=antagonism
    )
    trial.visit(*posture_set()[:6])
    agent = trial.agent
    assert len(agent.vision.memory.rests.rests) == 6
    assert agent.vision.zero is not None
    assert agent.map is not nominal_map
    agent.zeroed()
    assert agent.vision.zero is None
    assert agent.estimator._map is agent.map
    q = posture_set()[0]
    np.testing.assert_array_equal(agent.map.lengths(q), nominal_map.lengths(q))
