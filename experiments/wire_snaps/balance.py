"""Which postures muscles can hold without one of them: by a map, and by the actual robot."""

from __future__ import annotations

from typing import Protocol, cast

import numpy as np

from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.tension_distribution import TensionDistribution, TensionOptions
from jmm_agent.types import Floats
from kengoro.robots import arm_scene
from kengoro.trained_maps import ARM
from kengoro_env.assets import asset_path
from kengoro_env.departures import actual
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.robot.robot import Robot

STEP = 1e-3
"""Step of a joint by which the moment arms of the actual robot are taken [rad]."""


class Arms(Protocol):
    """What has moment arms."""

    @property
    def muscles(self) -> tuple[str, ...]: ...

    def jacobian(self, q: Floats) -> Floats: ...


class ActualArms:
    """Moment arms of an actual robot, which no agent knows.

    Args:
        seed: of the robot.
    """

    def __init__(self, seed: int) -> None:
        self._robot, self._rng = Robot(asset_path(ARM), actual(seed)), np.random.default_rng(0)
        self.muscles = self._robot.muscles

    def jacobian(self, q: Floats) -> Floats:
        """Muscle Jacobian (m, n) [m/rad] at joint angles (n,) [rad], by differences."""
        robot, rows = self._robot, []
        for step in STEP * np.eye(len(q)):
            ends = [np.clip(q + side * step, robot.lower, robot.upper) for side in (1.0, -1.0)]
            lengths = []
            for end in ends:
                robot.reset(end, self._rng)
                lengths.append(robot.motors.paths())
            apart = max(float((ends[0] - ends[1]).sum()), 1e-9)
            rows.append((lengths[0] - lengths[1]) / apart)
        return np.array(rows).T


class Balances:
    """Balance of gravity and tensions without a muscle.

    Args:
        motors: gains and limit.
        limits: lowest and highest angle of each joint (n, 2) [rad].
    """

    def __init__(self, motors: MotorControl, limits: Floats) -> None:
        self._motors = motors
        self._distribution = TensionDistribution(NominalArm(arm_scene()), TensionOptions())
        self._distribution.limits = limits

    def lacking(self, arms: Arms, without: str, posture: Floats) -> int | None:
        """Number of the joint that lacks most torque at a posture; None if it can be held.

        Args:
            arms: has the moment arms.
            without: the muscle that has snapped.
            posture: joint angles (n,) [rad].
        """
        jmm = cast(JointMuscleMap, arms)
        self._distribution.in_use = np.array([name != without for name in arms.muscles])
        return self._distribution.at(jmm, self._motors, posture).lacking(self._motors)

    def lost(self, arms: Arms, without: str, postures: Floats) -> float:
        """Share of postures (K, n) [rad] that cannot be held without a muscle [1]."""
        found = [self.lacking(arms, without, posture) is not None for posture in postures]
        return float(np.mean(found))
