"""Nominal model of the arm: names, joint limits, muscle lengths and moment arms."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from kengoro_env.robot.model_file import load_spec
from kengoro_env.robot.tendons import actuated_joints
from kengoro_env.types import Floats


class NominalArm:
    """Geometric model of the arm with straight muscles through their points (paper, sec. II-A).

    Args:
        scene: MJCF file with the arm.

    Attributes:
        joints: names of the joints, in the order of (n,) arrays.
        muscles: names of the muscles, in the order of (m,) arrays.
        lower: lower joint limits (n,) [rad].
        upper: upper joint limits (n,) [rad].
        crosses: which muscle crosses which joint (m, n).
    """

    def __init__(self, scene: Path | str) -> None:
        self._model = model = load_spec(scene).compile()
        self._data = mujoco.MjData(model)
        self.joints = actuated_joints(model)
        self.muscles = tuple(model.tendon(i).name for i in range(model.ntendon))
        addresses = [model.joint(joint) for joint in self.joints]
        self._position = np.array([joint.qposadr[0] for joint in addresses])
        self._velocity = np.array([joint.dofadr[0] for joint in addresses])
        self.lower, self.upper = model.jnt_range[[joint.id for joint in addresses]].T.copy()
        self._zero = self._paths(np.zeros(len(self.joints)))
        self.crosses = self._crossings()

    def _paths(self, posture: Floats) -> Floats:
        self._data.qpos[self._position] = posture
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_tendon(self._model, self._data)
        return self._data.ten_length.copy()

    def _crossings(self) -> NDArray[np.bool_]:
        """Which muscle crosses which joint: its length depends on the joint's angle."""
        rng = np.random.default_rng(0)
        postures = rng.uniform(self.lower, self.upper, (8, len(self.joints)))
        return np.any([np.abs(self.moment_arms(q)) > 1e-12 for q in postures], axis=0)

    def lengths(self, postures: Floats) -> Floats:
        """Muscle lengths (B, m) [m] relative to the zero posture, for postures (B, n) [rad]."""
        return np.array([self._paths(posture) for posture in np.atleast_2d(postures)]) - self._zero

    def moment_arms(self, posture: Floats) -> Floats:
        """Moment arms dl/dq (m, n) [m/rad] at a posture (n,) [rad]."""
        self._paths(posture)
        model, dense = self._model, np.zeros((self._model.ntendon, self._model.nv))
        mujoco.mju_sparse2dense(
            dense, self._data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
        )
        return dense[:, self._velocity]

    def gravity(self, posture: Floats) -> Floats:
        """Torques of gravity on the joints (n,) [N m] at a posture (n,) [rad]."""
        self._data.qpos[self._position] = posture
        self._data.qvel[:] = 0.0
        mujoco.mj_forward(self._model, self._data)
        return -self._data.qfrc_bias[self._velocity]
