"""Expected error of the hand over a set of postures, of a map and of what is known of the robot.

Where a map M commands the lengths M(q) and the robot has F(q), joints come to rest off by

    A(q) (M(q) - F(q)),    A = (G' G / s^2 + 1 / w^2)^-1 G' / s^2,    G = df/dq,

by least squares with noise s of the lengths, in which no joint is expected to be off by more than
some w. The hand is off by its Jacobian times that. With F known by its posterior
(`jmm_agent.vision.map_posterior`) the mean square of the hand's error is the sum of two parts: of
the most probable F, in which maps differ, and of its covariance, which no map can avoid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats
from jmm_agent.vision.map_posterior import MapPosterior

POSTURES = 24
"""Number of postures at which the hand's error is expected."""

SAME = 0.05
"""Rise of the expected error that shows no wrong update, as a share of it [1]."""


class HandErrors(NamedTuple):
    """Expected errors of the hand by what is known after an update: root mean squares [m].

    Attributes:
        before: of the map before the update.
        after: of the map after it.
    """

    before: float
    after: float

    @property
    def falls(self) -> bool:
        """Whether the update lowers it."""
        return self.after < self.before

    @property
    def rises(self) -> bool:
        """Whether the update raises it by more than `SAME`."""
        return self.after > (1.0 + SAME) * self.before

    @property
    def sentence(self) -> str:
        """Both errors, in a sentence without a full stop."""
        return (
            f"the expected error of the hand goes from {1e3 * self.before:.3g} mm to "
            f"{1e3 * self.after:.3g} mm with the new map"
        )


class HandPostures(NamedTuple):
    """Postures at which the hand's error is expected.

    Attributes:
        postures: joint angles (P, n) [rad].
        jacobians: how the hand moves in the world at each (P, 3, n) [m/rad].
        widest: by how much a joint may be off, standard deviation [rad].
    """

    postures: Floats
    jacobians: Floats
    widest: float

    @classmethod
    def among(
        cls, postures: Floats, kinematics: ArmKinematics, hand: str, widest: float
    ) -> HandPostures:
        """Some postures of many, evenly spaced in their order.

        Args:
            postures: (N, n) [rad].
            kinematics: of the same joints.
            hand: frame of the hand.
            widest: by how much a joint may be off, standard deviation [rad].
        """
        chosen = np.unique(np.linspace(0, len(postures) - 1, POSTURES).round().astype(int))
        some = np.array(postures[chosen])
        moves = np.array([_in_world(kinematics, hand, q) for q in some])
        return cls(some, moves, widest)

    def rows(self, jmm: JointMuscleMap, noise: float) -> Floats:
        """How the hand is off by errors of the lengths, at each posture (P, 3, m) [1].

        Args:
            jmm: the nominal map.
            noise: of the lengths, standard deviation [m].
        """
        return self.jacobians @ followed(jmm, self.postures, noise, self.widest)

    def expected(self, posterior: MapPosterior, rows: Floats, *maps: JointMuscleMap) -> Floats:
        """Root mean square of the hand's error that each map is expected to make [m].

        Args:
            posterior: of the robot's lengths.
            rows: as `rows` returns them.
            maps: the maps.
        """
        spread = posterior.own_covariance(posterior.project(self.postures, rows))
        unknown = float(np.mean(np.trace(spread, axis1=1, axis2=2)))
        likeliest, found = posterior.lengths(self.postures), []
        for jmm in maps:
            off = np.einsum("pam,pm->pa", rows, jmm.lengths(self.postures) - likeliest)
            found.append(np.sqrt(unknown + np.mean(np.sum(off**2, axis=1))))
        return np.array(found)


def followed(jmm: JointMuscleMap, postures: Floats, noise: float, widest: float) -> Floats:
    """How joint angles follow lengths: A of the module docstring (P, n, m) [rad/m].

    Args:
        jmm: the map.
        postures: joint angles (P, n) [rad].
        noise: of the lengths, standard deviation [m].
        widest: by how much a joint may be off, standard deviation [rad].
    """
    if not (noise > 0.0 and widest > 0.0):
        raise AgentError(
            f"Expected error of the hand: the noise of the lengths is {noise} m and the width of "
            f"a joint angle {widest} rad, but both must be positive."
        )
    arms = jmm.jacobian(postures)
    turned = np.swapaxes(arms, 1, 2)
    joints = arms.shape[2]
    matrix = turned @ arms + (noise / widest) ** 2 * np.eye(joints)
    return np.asarray(np.linalg.solve(matrix, turned))


def _in_world(kinematics: ArmKinematics, hand: str, q: Floats) -> Floats:
    """How the hand's position moves in the world (3, n) [m/rad]."""
    moves = kinematics.pose(hand, q)[:3, :3] @ kinematics.frame_jacobian(hand, q)[:3]
    return np.asarray(moves)
