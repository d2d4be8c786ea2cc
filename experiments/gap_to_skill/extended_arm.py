"""Commands of an extended model of the arm, and the map that is trained on them.

A map of the nominal model holds muscle lengths. A robot is moved to a posture by commanded lengths:
a pulling muscle is commanded shorter than its length, by its tension over its stiffness.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
from scipy.optimize import nnls

from experiments.harness.errors import ExperimentError
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.mapping.recipe import Recipe
from jmm_agent.mapping.training import train
from jmm_agent.types import Floats
from kengoro.trained_maps import MAP_SEED, nominal_model
from kengoro_env.names import JOINTS

BALANCE = 1e4
"""Weight of a torque error of 1 N m relative to a tension of 1 N."""

SHIFT = PriorOptions(offset=0.1, shape=0.02)
"""Prior of the difference of commands and tendon lengths [m], which have different zeros."""

EXACT = 2e-4
"""Tolerance of the map for a command [m]."""


class ExtendedArm:
    """An extended model of the arm.

    Args:
        mjcf: the model, with an affine actuator on the tendon of each muscle.
        muscles: names of actuators and tendons, in the order of all arrays.
        zero: nominal tendon lengths at the zero of the robot's encoders, shape (m,) [m].

    Raises:
        ExperimentError: the model does not compile, or lacks one of the muscles.
    """

    def __init__(self, mjcf: str, muscles: tuple[str, ...], zero: Floats) -> None:
        try:
            self._model = model = mujoco.MjModel.from_xml_string(mjcf)
            self._data = mujoco.MjData(model)
            joints = [model.joint(joint) for joint in JOINTS]
            self._actuators = np.array([model.actuator(muscle).id for muscle in muscles])
            self._tendons = np.array([model.tendon(muscle).id for muscle in muscles])
        except (ValueError, KeyError) as error:
            reason = " ".join(str(error).split())
            raise ExperimentError(f"The extended model cannot be used: {reason}.") from error
        self._position = np.array([joint.qposadr[0] for joint in joints])
        self._velocity = np.array([joint.dofadr[0] for joint in joints])
        self._offset = zero
        self._least = -model.actuator_forcerange[self._actuators, 1]
        self._zero = self._location(np.zeros(len(JOINTS)))

    def _location(self, posture: Floats) -> Floats:
        data = self._data
        mujoco.mj_resetData(self._model, data)
        data.qpos[self._position] = posture
        mujoco.mj_fwdPosition(self._model, data)
        mujoco.mj_fwdVelocity(self._model, data)
        return data.ten_length[self._tendons].copy()

    def paths(self, postures: Floats) -> Floats:
        """Tendon lengths relative to the zero posture, shape (B, m) [m], at postures (B, n)."""
        return (
            np.array([self._location(posture) for posture in np.atleast_2d(postures)]) - self._zero
        )

    def commands(self, postures: Floats) -> Floats:
        """Commands with which the model settles at postures.

        Args:
            postures: joint angles, shape (B, n) [rad].

        Returns:
            Lengths as read by the robot's encoders, shape (B, m) [m].
        """
        return np.array([self._command(posture) for posture in np.atleast_2d(postures)])

    def _command(self, posture: Floats) -> Floats:
        """Command at a posture: least tensions that balance the weight of the arm."""
        model, data, actuators = self._model, self._data, self._actuators
        self._location(posture)
        weight = (data.qfrc_passive - data.qfrc_bias)[self._velocity]
        pull = least_pull(self._arms(), weight, self._least)
        gain, bias = model.actuator_gainprm[actuators, 0], model.actuator_biasprm[actuators]
        length = data.actuator_length[actuators]
        return (-pull - bias[:, 0] - bias[:, 1] * length) / gain - self._offset

    def _arms(self) -> Floats:
        """Moment arms, shape (m, n) [m/rad]."""
        model, data = self._model, self._data
        arms = np.zeros((model.nactuator, model.nv))
        mujoco.mju_sparse2dense(
            arms,
            data.actuator_moment,
            data.moment_rownnz,
            data.moment_rowadr,
            data.moment_colind,
        )
        return arms[np.ix_(self._actuators, self._velocity)]


def least_pull(arms: Floats, weight: Floats, least: Floats) -> Floats:
    """Least-squares tensions that balance an arm, as small as possible above a lower bound.

    Args:
        arms: moment arms, shape (m, n) [m/rad].
        weight: torques of gravity and springs, shape (n,) [N m].
        least: lower bound, shape (m,) [N].

    Returns:
        Tensions, shape (m,) [N]; with the least error of torques if none balances the arm.
    """
    tendons = len(arms)
    missing = weight - arms.T @ least
    above, _ = nnls(
        np.vstack([np.eye(tendons), BALANCE * arms.T]),
        np.concatenate([np.zeros(tendons), BALANCE * missing]),
    )
    return least + above


def extended_map(
    arm: ExtendedArm,
    postures: Floats,
    recipe: Recipe | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> JointMuscleMap:
    """Train the map of an extended arm.

    It is trained on the tendon lengths like the map of the nominal model, then corrected to the
    commands at some postures by the least change of its output layers.

    Args:
        arm: the extended arm.
        postures: joint angles, shape (N, n) [rad].
        recipe: of the training; the default if left out.
        progress: called with the name of a group and the share done, 0 to 1.
    """
    extended = replace(nominal_model(), lengths=arm.paths)
    trained, _ = train(extended, MAP_SEED, recipe, progress)
    prior = MapPrior(trained, postures, SHIFT)
    return prior.corrected(postures, arm.commands(postures), np.full(len(postures), EXACT))
