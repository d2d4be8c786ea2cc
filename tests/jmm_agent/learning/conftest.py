"""Map, arm and agents of these tests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.learning.options import LearningOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.options import AgentOptions
from tests.jmm_agent.learning.resting import (
    START,
    Detector,
    Make,
)
from tests.jmm_agent.nominal_arm import ARM, JOINTS, posture_set, trained_map


@pytest.fixture(scope="module")
def nominal_map(request: pytest.FixtureRequest) -> JointMuscleMap:
    return trained_map(request)


@pytest.fixture(scope="module")
def arm() -> ArmKinematics:
    return ArmKinematics(ARM, JOINTS)


@pytest.fixture
def make(nominal_map: JointMuscleMap, arm: ArmKinematics) -> Iterator[Make]:
    """Makes agents, and ends what they run beside."""
    agents = []

    def made(
        where: Any = "step", enters_after: int = 0, timeout: float = 300.0, **more: Any
    ) -> Agent:
        options = AgentOptions(learning=LearningOptions(where, enters_after, timeout))
        rng = np.random.default_rng(3)
        detector = Detector(arm)
        agent = Agent(nominal_map, arm, detector, posture_set(), START, rng, options, **more)
        agent.begin_episode()
        agents.append(agent)
        return agent

    yield made
    for agent in agents:
        agent.close()
