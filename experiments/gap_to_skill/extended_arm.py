"""The arm as a diagnosis extended it, asked for commands; and the map that an agent makes of them.

The drawing's map holds lengths of wires. What moves a robot to a posture are the lengths that are
commanded there: wires that pull are commanded shorter than they are, the more the softer they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
from scipy.optimize import nnls

from experiments.harness.errors import ExperimentError
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.network_fit import Recipe
from jmm_agent.mapping.prior import MapPrior, PriorOptions
from jmm_agent.mapping.training import train
from jmm_agent.types import Floats
from kengoro.trained_maps import MAP_SEED, nominal_model
from kengoro_env.names import JOINTS

BALANCE = 1e4
"""How much more a torque of 1 N m that is missing weighs than a tension of 1 N."""

SHIFT = PriorOptions(offset=0.1, shape=0.02)
"""How far commands may be from the extended model's paths [m]: wires were zeroed elsewhere."""

EXACT = 2e-4
"""How far the map may miss a command [m]."""


class ExtendedArm:
    """An extended model of the arm.

    Args:
        mjcf: the model, with an affine actuator on the tendon of each wire.
        muscles: names of actuators and tendons, in the order of (m,) arrays.
        zero: lengths (m,) [m] of the drawing's wires where the robot calls them zero.

    Raises:
        ExperimentError: the model does not compile, or has not these wires.
    """

    def __init__(self, mjcf: str, muscles: tuple[str, ...], zero: Floats) -> None:
        try:
            self._model = model = mujoco.MjModel.from_xml_string(mjcf)
            self._data = mujoco.MjData(model)
            joints = [model.joint(joint) for joint in JOINTS]
            self._tendons = np.array([model.actuator(muscle).id for muscle in muscles])
            self._tendons = np.array([model.tendon(muscle).id for muscle in muscles])
        except (ValueError, KeyError) as error:
            reason = " ".join(str(error).split())
            raise ExperimentError(f"The extended model cannot be used: {reason}.") from error
        self._position = np.array([joint.qposadr[0] for joint in joints])
        self._velocity = np.array([joint.dofadr[0] for joint in joints])
        self._offset = zero
        self._least = -model.actuator_forcerange[self._tendons, 1]
        self._zero = self._location(np.zeros(len(JOINTS)))

    def _location(self, posture: Floats) -> Floats:
        data = self._data
        mujoco.mj_resetData(self._model, data)
        data.qpos[self._position] = posture
        mujoco.mj_fwdPosition(self._model, data)
        mujoco.mj_fwdVelocity(self._model, data)
        return data.ten_length[self._tendons].copy()

    def paths(self, postures: Floats) -> Floats:
        """Lengths (B, m) [m] of the wires' paths, from those in the zero posture, at postures
        (B, n) [rad]."""
        return (
            np.array([self._location(posture) for posture in np.atleast_2d(postures)]) - self._zero
        )

    def commands(self, postures: Floats) -> Floats:
        """Commands (B, m) [m] under which the model settles at postures (B, n) [rad], as the
        robot's encoders call them."""
        return np.array([self._command(posture) for posture in np.atleast_2d(postures)])

    def _command(self, posture: Floats) -> Floats:
        """Each wire pulls with its least tension, or as much more as the arm's weight needs."""
        model, data, tendons = self._model, self._data, self._tendons
        self._location(posture)
        weight = (data.qfrc_passive - data.qfrc_bias)[self._velocity]
        pull = least_pull(self._arms(), weight, self._least)
        gain, bias = model.actuator_gainprm[tendons, 0], model.actuator_biasprm[tendons]
        length = data.actuator_length[tendons]
        return (-pull - bias[:, 0] - bias[:, 1] * length) / gain - self._offset

    def _arms(self) -> Floats:
        """Change of length with the joints, (m, n) [m/rad]."""
        model, data = self._model, self._data
        arms = np.zeros((model.nactuator, model.nv))
        mujoco.mju_sparse2dense(
            arms,
            data.actuator_moment,
            data.moment_rownnz,
            data.moment_rowadr,
            data.moment_colind,
        )
        return arms[np.ix_(self._tendons, self._velocity)]


def least_pull(arms: Floats, weight: Floats, least: Floats) -> Floats:
    """Tensions (m,) [N] that hold an arm, as little above the least ones as they can be.

    Where no tensions hold it, they miss by as little as they can.

    Args:
        arms: change of each wire's length with the joints, (m, n) [m/rad].
        weight: torques (n,) [N m] of gravity and springs.
        least: (m,) [N].
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
    """The map of an extended arm: trained on its paths as the drawing's is on the drawing, then
    moved to the commands at some postures (N, n) [rad] by the least change of its output layers."""
    drawing = replace(nominal_model(), lengths=arm.paths)
    drawn, _ = train(drawing, MAP_SEED, recipe, progress)
    prior = MapPrior(drawn, postures, SHIFT)
    return prior.corrected(postures, arm.commands(postures), np.full(len(postures), EXACT))
