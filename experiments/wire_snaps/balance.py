"""Which postures muscles can hold without one of them: by a map, and by the actual robot."""

from __future__ import annotations

from typing import Protocol, cast

import numpy as np

from jmm_agent.guard.faults import MotorControl
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.tension_distribution import TensionDistribution, TensionOptions
from jmm_agent.types import Floats
from kengoro.robots import arm_scene
from kengoro_env.robot.nominal_model import NominalArm


class Arms(Protocol):
    """What has moment arms."""

    @property
    def muscles(self) -> tuple[str, ...]: ...

    def jacobian(self, q: Floats) -> Floats: ...


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
