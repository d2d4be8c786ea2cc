"""Estimates of the external force in control steps: their cost, and when there are none."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.guard.arm_state import ArmState
from jmm_agent.guard.guard import FAR, Guard
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from tests.jmm_agent.nominal_arm import ARM, JOINTS, posture_set

START, TARGET = posture_set()[:2]
CAMERA = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)


class Forces:
    """A guard of the nominal arm, and the postures at which it estimates a force."""

    def __init__(self, nominal_map: JointMuscleMap) -> None:
        self.arm, self.at = ArmKinematics(ARM, JOINTS), list[Floats]()
        self.guard = Guard(nominal_map.muscles, self.arm, CAMERA, self.gravity)

    def gravity(self, q: Floats) -> Floats:
        self.at.append(q)
        return np.zeros(len(q))


def test_a_step_evaluates_the_map_once_to_estimate_and_once_to_command(
    nominal_map: JointMuscleMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    forces = Forces(nominal_map)
    agent = Agent(
        nominal_map, forces.arm, None, posture_set(), START, np.random.default_rng(0),
        guard=forces.guard,
    )  # fmt: skip
    calls: Counter[str] = Counter()
    for name in ("lengths", "lengths_and_jacobian"):
        method = getattr(JointMuscleMap, name)

        def counted(jmm: JointMuscleMap, q: Floats, name: str = name, method=method) -> object:
            calls[name] += 1
            return method(jmm, q)

        monkeypatch.setattr(JointMuscleMap, name, counted)
    agent.learning = False
    lengths = nominal_map.lengths(START)
    agent.step(SensorReadings(0.0, lengths, np.full(36, 40.0)))
    agent.go(TARGET, 2.0)
    for step in range(1, 51):
        calls.clear()
        agent.step(SensorReadings(0.02 * step, lengths, np.full(36, 40.0)))
        assert calls == {"lengths": 1, "lengths_and_jacobian": 1}
    assert len(forces.at) > 20


@pytest.mark.parametrize(("correction", "estimates"), [(0.9 * FAR, 25), (1.1 * FAR, 0)])
def test_moment_arms_from_before_a_far_correction_give_no_force(
    correction: float, estimates: int, nominal_map: JointMuscleMap
) -> None:
    forces, jacobian = Forces(nominal_map), nominal_map.jacobian(START)
    lengths, tensions = nominal_map.lengths(START), np.full(36, 40.0)
    before = START.copy()
    before[3] -= correction
    for step in range(50):
        readings = SensorReadings(0.02 * step, lengths, tensions)
        forces.guard.filter(readings, 0.02 * (step - 1), lengths, lengths)
        forces.guard.watch(readings, ArmState(START, jacobian, before, 9, True, None))
    assert len(forces.at) == estimates
