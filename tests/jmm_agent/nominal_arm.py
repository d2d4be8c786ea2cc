"""Nominal model of Kengoro's arm, read from its MJCF file by MuJoCo alone."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.training import load_or_train
from jmm_agent.nominal_model import NominalModel

ASSETS = Path(__file__).parents[2] / "assets"
ARM = ASSETS / "mjcf/kengoro_arm/arm.xml"
GROUPS = {
    "neck": ("neck_yaw", "neck_pitch", "neck_roll"),
    "scapula": ("sc_roll", "sc_yaw", "ac_roll", "ac_pitch"),
    "shoulder": ("sh_pitch", "sh_roll", "sh_yaw", "elbow"),
    "forearm": ("radioulnar", "wrist_flex", "wrist_dev"),
}
JOINTS = tuple(joint for joints in GROUPS.values() for joint in joints)


class Tendons:
    """Lengths and moment arms of tendons by MuJoCo: those of a map without error.

    Args:
        joints: names of the n joints; all others stay at zero.
        muscles: names of the m tendons; all of the model if left out.
    """

    def __init__(
        self, joints: tuple[str, ...] = JOINTS, muscles: tuple[str, ...] | None = None
    ) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(ARM))
        self.data = mujoco.MjData(self.model)
        self.joints = joints
        self.muscles = muscles or tuple(
            self.model.tendon(i).name for i in range(self.model.ntendon)
        )
        self._qpos = [int(self.model.joint(name).qposadr[0]) for name in joints]
        self._rows = [int(self.model.tendon(name).id) for name in self.muscles]
        self.limits = np.array([self.model.joint(name).range for name in joints])

    def lengths(self, q: np.ndarray) -> np.ndarray:
        """Lengths along the whole path at q (n,) [rad], shape (m,) [m]."""
        self.data.qpos[self._qpos] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_tendon(self.model, self.data)
        return self.data.ten_length[self._rows].copy()

    def relative_lengths(self, postures: np.ndarray) -> np.ndarray:
        """Lengths relative to the zero posture at postures (B, n) [rad], shape (B, m) [m]."""
        zero = self.lengths(np.zeros(len(self.joints)))
        return np.array([self.lengths(q) for q in np.atleast_2d(postures)]) - zero

    def lengths_and_jacobian(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lengths (m,) [m] and moment arms (m, n) [m/rad] at q (n,) [rad]."""
        lengths = self.lengths(q)
        dense = np.zeros((self.model.ntendon, self.model.nv))
        for row in range(self.model.ntendon):
            start, count = self.model.ten_J_rowadr[row], self.model.ten_J_rownnz[row]
            columns = self.model.ten_J_colind[start : start + count]
            dense[row, columns] = self.data.ten_J[start : start + count]
        return lengths, dense[np.ix_(self._rows, self._qpos)]

    def jacobian_quadratic(self, q: np.ndarray, step: float = np.deg2rad(10)) -> np.ndarray:
        """Moment arms (m, n) [m/rad] by the paper's quadratic through five points."""
        points = [
            sum(k * self.lengths(q + k * step * axis) for k in (-2, -1, 1, 2)) / (10 * step)
            for axis in np.eye(q.size)
        ]
        return np.array(points).T


def posture_set() -> np.ndarray:
    """Postures (N, 14) [rad] that the arm can hold, with the hand's marker in view."""
    table = np.loadtxt(ASSETS / "postures/kengoro_arm.csv", delimiter=",", skiprows=1)
    return np.radians(table)


def nominal_model() -> NominalModel:
    """The arm's nominal model for training."""
    arm = Tendons()
    low, high = arm.limits.T
    postures = np.random.default_rng(0).uniform(low, high, (8, len(JOINTS)))
    jacobians = [arm.lengths_and_jacobian(q)[1] for q in postures]
    crosses = np.any(np.abs(jacobians) > 1e-12, axis=0)
    return NominalModel(JOINTS, low, high, arm.muscles, crosses, arm.relative_lengths, GROUPS)


def trained_map(request: pytest.FixtureRequest) -> JointMuscleMap:
    """The arm's map, trained once and then read from pytest's cache."""
    return load_or_train(nominal_model(), 0, request.config.cache.mkdir("maps"))[0]
