"""What the nominal map predicts of a pull: how all lengths and tensions respond.

Muscle stiffness control holds all muscles like springs of the same stiffness K. If the command of
muscle i is shortened by a stroke, the arm moves until the torques balance again, and the paths
shorten by

    h_i = G (G' G)^-1 G' e_i,    the column i of the hat matrix H of the Jacobian G,

as shares of the stroke, whatever K is. Tendons that stretch in series with the motors take a part:
encoders read a = (H + rho) / (1 + rho), where rho, the ratio of the motors' stiffness to the
tendons', is the same for all. Tensions change by K times the change of the length that the motor
sees, less that of its command, b = a - 1.

The posture is known roughly only, and moment arms are not those of the model. So H is taken at
sampled postures with sampled moment arms; mean and standard deviation are the prediction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Bools, Floats

SAMPLES = 64
"""Number of sampled postures."""
RIDGE = 1e-4
"""Stiffness of the joints themselves beside that of the muscles, as a share of its mean [1]."""


class Responses(NamedTuple):
    """Predicted responses of the paths; row k is muscle k while muscle i, the column, is pulled.

    Attributes:
        mean: as a share of the stroke (m, m) [1].
        spread: standard deviation (m, m) [1].
    """

    mean: Floats
    spread: Floats


class Prediction:
    """Responses of a robot near a posture, by its nominal map.

    Args:
        jmm: the map.
        joint_limits: lowest and highest angle of each joint (n, 2) [rad].
        posture: joint angles (n,) [rad], about.
        options: uncertainty of posture and moment arms.
        samples: number of sampled postures.
    """

    def __init__(
        self,
        jmm: JointMuscleMap,
        joint_limits: Floats,
        posture: Floats,
        options: CommissionOptions,
        samples: int = SAMPLES,
    ) -> None:
        rng, (low, high) = np.random.default_rng(0), np.asarray(joint_limits, dtype=float).T
        noise = rng.standard_normal((samples, len(low)))
        postures = np.clip(posture + options.posture * (high - low) * noise, low, high)
        arms = jmm.jacobian(postures)
        self._arms = arms * (1.0 + options.arms * rng.standard_normal(arms.shape))

    def without(self, absent: Bools, at_bias: Bools) -> Responses:
        """Responses of a robot without some muscles, whose rows and columns are zero.

        Args:
            absent: muscles that hold nothing (m,).
            at_bias: which muscles pull with T_bias only during each pull (m, m), a column for each;
                their lengths follow the arm, but they do not hold it.
        """
        count = len(absent)
        mean, spread = np.zeros((2, count, count))
        loose, kind = np.unique(at_bias | absent[:, None], axis=1, return_inverse=True)
        kind = kind.reshape(-1)
        arms = self._arms * ~absent[:, None]
        for number, without in enumerate(loose.T):
            columns = np.flatnonzero(kind == number)
            holding = self._arms * ~without[:, None]
            hat = arms @ _inverse(holding) @ np.swapaxes(holding, 1, 2)[:, :, columns]
            mean[:, columns], spread[:, columns] = hat.mean(axis=0), hat.std(axis=0)
        return Responses(mean, spread)


def _inverse(arms: Floats) -> Floats:
    """(G' G + ridge)^-1 of sampled moment arms (K, m, n)."""
    squares = np.swapaxes(arms, 1, 2) @ arms
    joints = squares.shape[-1]
    mean = np.trace(squares, axis1=1, axis2=2)[:, None, None] / joints
    return np.asarray(np.linalg.inv(squares + RIDGE * np.maximum(mean, 1e-12) * np.eye(joints)))
