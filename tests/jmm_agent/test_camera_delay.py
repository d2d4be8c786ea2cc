"""What an agent learns whose camera stamps its frames 120 ms late, when they arrive."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.vision.camera_clock import CameraClock
from tests.jmm_agent.moving_arm import MovingArm
from tests.jmm_agent.nominal_arm import JOINTS, posture_set

POSTURES = posture_set()[1:6]
LATE = 0.12


def learned(
    nominal_map: JointMuscleMap, arm: ArmKinematics, before: int = 0, **more: Any
) -> MovingArm:
    """An arm after movements to 5 postures; a frame each 0.5 s, stamped on arrival.

    Before that it moves slowly for some times, without learning.
    """
    trial = MovingArm(nominal_map, arm, interval=0.5, delay=LATE, **({"stamped_late": True} | more))
    trial.agent.learning = False
    trial.visit(*posture_set()[20 : 20 + before], move=2.2)
    trial.agent.learning = True
    trial.visit(*POSTURES, move=1.2)
    return trial


@pytest.fixture(scope="module")
def exact(nominal_map: JointMuscleMap, arm: ArmKinematics) -> MovingArm:
    return learned(nominal_map, arm, stamped_late=False)


def farthest_mm(trial: MovingArm) -> float:
    """Largest distance [mm] of a pose that was learned from the pose of its rest."""
    rests = [trial.kinematics.pose("marker_hand", q, "eye")[:3, 3] for q in POSTURES]
    poses = [found.pose[:3, 3] for found in trial.agent.vision.memory.observations]
    return 1e3 * max(min(np.linalg.norm(pose - rest) for rest in rests) for pose in poses)


def test_late_stamps_without_a_correction_show_a_moving_hand(
    nominal_map: JointMuscleMap, arm: ArmKinematics, exact: MovingArm
) -> None:
    unknown = learned(nominal_map, arm)
    assert farthest_mm(unknown) > 20.0
    assert unknown.error > 1.1 * exact.error


def test_a_given_delay_is_corrected(
    nominal_map: JointMuscleMap, arm: ArmKinematics, exact: MovingArm
) -> None:
    given = learned(nominal_map, arm, camera_clock=CameraClock(delay=LATE))
    assert given.agent.vision.fired == len(POSTURES)
    assert farthest_mm(given) < 6.0
    assert given.error < 1.05 * exact.error


def test_an_unknown_delay_is_estimated_and_corrected(
    nominal_map: JointMuscleMap, arm: ArmKinematics, exact: MovingArm
) -> None:
    estimated = learned(nominal_map, arm, before=3, camera_clock=CameraClock(delay=None))
    found = estimated.agent.camera_delay
    assert found.reason == ""
    assert abs(found.delay - LATE) < 0.01
    assert estimated.agent.vision.fired == len(POSTURES)
    assert farthest_mm(estimated) < 6.0
    assert estimated.error < 1.05 * exact.error


def test_a_hand_that_moves_during_a_long_exposure_is_not_learned_from(
    nominal_map: JointMuscleMap, arm: ArmKinematics
) -> None:
    """The lengths count as settled, but the marker drifts by 15 mm/s: 1.5 mm in 0.1 s."""
    trial = MovingArm(nominal_map, arm, camera_clock=CameraClock(exposure=0.1))
    direction = np.zeros(14)
    direction[JOINTS.index("sh_pitch")] = 1.0
    motion = arm.frame_jacobian("marker_hand", POSTURES[0], "eye") @ direction
    rate = 0.015 / np.linalg.norm(motion[:3])
    for step in range(100):
        trial.step(POSTURES[0] + 0.02 * step * rate * direction)
    assert np.isfinite(trial.agent._rests.settling.since)
    assert trial.agent.vision.fired == 0
    assert trial.agent.vision.dropped["the hand moved while the frame was exposed"] > 3
    for _ in range(60):
        trial.step(trial.q)
    assert trial.agent.vision.fired == 1
