"""True moment arms of an actual robot, which no agent knows."""

from __future__ import annotations

import mujoco
import numpy as np

from jmm_agent.types import Floats
from kengoro_env.robot.robot import Robot


class RobotArms:
    """Derivatives of the tendon lengths of a robot.

    Args:
        robot: is not moved.

    Attributes:
        muscles: names of its muscles.
    """

    def __init__(self, robot: Robot) -> None:
        self.muscles = robot.muscles
        self._model, self._data = robot.model, mujoco.MjData(robot.model)
        joints = [robot.model.joint(joint) for joint in robot.joints]
        self._position = np.array([joint.qposadr[0] for joint in joints])
        self._velocity = np.array([joint.dofadr[0] for joint in joints])
        self._tendons = np.array([robot.model.tendon(muscle).id for muscle in robot.muscles])

    def jacobian(self, q: Floats) -> Floats:
        """dl/dq, shape (m, n) [m/rad], at joint angles, shape (n,) [rad]."""
        model, data = self._model, self._data
        data.qpos[self._position] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        dense = np.zeros((model.ntendon, model.nv))
        mujoco.mju_sparse2dense(
            dense, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
        )
        return dense[np.ix_(self._tendons, self._velocity)]
