"""The robot: an arm with three joints and six tendons, whose model has one point 9 mm off."""

from __future__ import annotations

import numpy as np

from experiments.harness.common import ROOT
from experiments.lab_faults.pose_frames import frame_of
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats
from kengoro_env.robot.draft import Draft
from kengoro_env.robot.robot import Robot

SCENE = ROOT / "examples/arm3.xml"
STEP = 0.08
"""Time between commands on the robot's clock [s]; on the wall it may be shorter."""
MOVED = (0.0, 0.0, 0.009)
"""How far the tendon's point is from where the nominal model has it [m]."""


class MovedPoint:
    """What the robot has and the nominal model lacks."""

    def edit(self, draft: Draft) -> None:
        """Move the point."""
        site = draft.spec.site("lift_1")
        site.pos = np.add(site.pos, MOVED)


class LabRobot:
    """Driver beside the motors: a `jmm_agent.Driver`. When stopped, it holds the last command."""

    def __init__(self) -> None:
        self._robot = Robot(SCENE, [MovedPoint()], control_period=STEP)
        self._robot.reset(np.zeros(len(self._robot.joints)), np.random.default_rng(1))
        self._kinematics = ArmKinematics(SCENE, self._robot.joints)
        self._command, self._steps = self._robot.target, 0

    @property
    def muscles(self) -> int:
        """Number of muscles, m."""
        return len(self._robot.muscles)

    def read(self) -> SensorReadings:
        """Run one control period."""
        robot = self._robot
        robot.step(self._command)
        self._steps += 1
        pose = self._kinematics.pose("marker_hand", robot.joint_angles, relative_to="eye")
        time = self._steps * STEP
        lengths, tensions = robot.measured_lengths(), robot.measured_tensions()
        return SensorReadings(time, lengths, tensions, frame_of(pose), time)

    def write(self, target_lengths: Floats) -> None:
        """Command target muscle lengths (m,) [m]."""
        self._command = target_lengths

    def stop(self) -> None:
        """Hold the last command."""
