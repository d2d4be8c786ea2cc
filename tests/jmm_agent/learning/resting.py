"""Agents that rest at some postures and learn there, for these tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from jmm_agent.agent import Agent
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import Detections, MarkerPose
from tests.jmm_agent.nominal_arm import posture_set

START, FIRST, SECOND, THIRD = posture_set()[:4]
MISTAKE = np.radians([1, -1, 1, 4, -4, 3, 4, -8, 7, 8, -7, 3, -3, 2])
FRAME = np.full((480, 640, 3), 90, dtype=np.uint8)
CALM = np.full(36, 50.0)
RESTS = (FIRST, SECOND, THIRD)
STEPS = 36  # of each rest


Make = Callable[..., Agent]


class Detector:
    """Returns the exact pose of the marker of the posture that is written in the frame."""

    def __init__(self, arm: ArmKinematics) -> None:
        self._poses = [arm.pose("marker_hand", q, relative_to="eye") for q in posture_set()[:6]]

    def detect(self, frame: np.ndarray, expected: object = None) -> Detections:
        pose = self._poses[frame[0, 0, 0]]
        return Detections({0: MarkerPose(0, pose, np.zeros((4, 2)), 0.0, pose, 9.0)}, {}, ())


def readings(nominal_map: JointMuscleMap, step: int, posture: int) -> SensorReadings:
    """Of a robot whose lengths were zeroed at another posture, at rest."""
    lengths = nominal_map.lengths(posture_set()[posture]) - nominal_map.lengths(MISTAKE)
    frame = FRAME.copy()
    frame[0, 0, 0] = posture
    return SensorReadings(0.02 * step, lengths, CALM, frame, 0.2 * (step // 10))


def run(agent: Any, nominal_map: JointMuscleMap, rests: int = 2, begin: int = 0) -> list[Floats]:
    """Rest at some postures; the commands."""
    steps = range(begin, begin + rests * STEPS)
    return [agent.step(readings(nominal_map, k, 1 + k // STEPS % 5)) for k in steps]


def rest_until_pending(agent: Agent, nominal_map: JointMuscleMap) -> int:
    """Rest until there is a job; the number of the next step."""
    step = 0
    while not agent._schedule.pending:
        agent.step(readings(nominal_map, step, 1))
        step += 1
    return step


def learned(agent: Agent) -> list[bytes]:
    """All that was learned, as bytes."""
    layers = [layer for group in agent.map.groups for layer in group.layers]
    vision = agent.vision.memory
    return [part.tobytes() for part in (*layers, *vision.pairs, vision.angles)]
