"""An agent names joint encoders that contradict the muscle lengths, with or without a guard."""

from __future__ import annotations

from typing import Any

import numpy as np

from jmm_agent.guard.faults import JOINT_CONTRADICTED, Fault
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from tests.jmm_agent.moving_arm import MovingArm
from tests.jmm_agent.nominal_arm import JOINTS, posture_set

ELBOW = JOINTS.index("elbow")
BENT = np.where(np.arange(14) == ELBOW, 0.9, posture_set()[1])


class EncodedElbow(MovingArm):
    """A moving arm with an encoder on its elbow, which reads a multiple of the angle."""

    sign = 1.0

    def readings(self, **more: Any) -> Any:
        angles = np.full(14, np.nan)
        angles[ELBOW] = self.sign * self.q[ELBOW] + self.rng.normal(0, 1e-3)
        return super().readings(joint_angles=angles, **more)


def contradicted(agent: Any) -> list[Fault]:
    return [fault for fault in agent.faults if fault.kind == JOINT_CONTRADICTED]


def test_an_encoder_of_the_wrong_sign_is_named_before_anything_is_learned(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = EncodedElbow(nominal_map, arm)
    trial.sign = -1.0
    trial.visit(BENT, BENT)
    [fault] = contradicted(trial.agent)
    assert fault.where == "elbow"
    assert "its sign or zero" in fault.detail
    trial.sign = 1.0
    trial.visit(BENT, BENT)
    assert contradicted(trial.agent) == []


def test_a_right_encoder_is_not_named_while_the_map_is_wrong_by_some_degrees(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    trial = EncodedElbow(nominal_map, arm)
    trial.visit(BENT, posture_set()[2])
    assert contradicted(trial.agent) == []
