"""Errors that all observed poses of the hand share, integrated out of the fit of rests.

The camera (`camera_unknowns`) and the joints of the drawing, which sit elsewhere and turn about
other axes, miss the poses of all observations by few unknown numbers v, each a unit normal
variable. Residuals of the poses at the right postures are, to first order,

    r_k = D_k (v - v0) + noise,

where v0 is what the poses are corrected by already. With the weights W of the poses the most
probable change v - v0 is

    u = A^-1 (D' W r - v0),    A = 1 + D' W D.

Kawaharazuka et al. 2018 assume bones and camera to be right; these unknowns are ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera_unknowns import UNKNOWNS, CameraPrior, camera_columns, is_shown
from jmm_agent.vision.marker_observation import Frames, MarkerObservation, ObservationWeights

SIZES = 0.0, 1.0 / 3.0, 1.0, 3.0
"""Errors of the joints that are compared, as multiples of the usual ones [1]."""


@dataclass(frozen=True)
class JointPrior:
    """How far the joints of the drawing are off, before anything was seen.

    They are right by default, as in the paper: a robot whose bones are right learns less well if
    they are not believed.

    Attributes:
        offset: standard deviation of a joint's place along each axis [m].
        turn: standard deviation of the direction of its axis about each axis [rad].

    Raises:
        AgentError: a number is negative or not finite.
    """

    offset: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("offset", self.offset), ("turn", self.turn)):
            if not 0.0 <= value < np.inf:
                raise AgentError(
                    f"JointPrior: {name} is {value}, but must be finite and at least 0."
                )

    @property
    def enabled(self) -> bool:
        """Whether joints may be off."""
        return bool(self.offset or self.turn)

    def times(self, factor: float) -> JointPrior:
        """Errors that are larger by a factor [1]."""
        return JointPrior(factor * self.offset, factor * self.turn)


@runtime_checkable
class MisplacedJoints(Protocol):
    """Knows how errors of the joints move the marker."""

    def misplaced(self, q: Floats, frames: Frames | None = None) -> Floats:
        """Movements (6, n, 6), see `ArmKinematics.misplaced`."""


def is_of_joints(residual: object) -> bool:
    """Whether a residual knows how errors of the joints move the marker.

    Args:
        residual: of the marker's pose.
    """
    return isinstance(residual, MisplacedJoints)


def joint_columns(
    observations: Sequence[MarkerObservation], angles: Floats, residual: object, prior: JointPrior
) -> Floats:
    """Changes (K, 6, 6 n) of the residuals of poses by errors of the joints, unit normal ones.

    Args:
        observations: K observations.
        angles: about their joint angles (K, n) [rad].
        residual: of the poses; the joints are right if it knows nothing of `MisplacedJoints`.
        prior: standard deviations of the errors.
    """
    widths = np.repeat([prior.offset, prior.turn], 3)
    if not (prior.enabled and isinstance(residual, MisplacedJoints)):
        return np.zeros((len(observations), 6, 0))
    pairs = zip(observations, angles, strict=False)
    moved = [-widths * residual.misplaced(q, found.frames) for found, q in pairs]
    return np.array(moved).reshape(len(observations), 6, -1)


class PoseErrors:
    """Common errors of the poses of K observations, linearised.

    Args:
        observations: K observations, as the camera showed them.
        prior: standard deviations of the camera's errors.
        camera: errors of the camera (8,) [m, rad, 1, 1] by which the poses are corrected.
        joints: see `joint_columns`.
        weights: of the observations.
        frame: the camera's frame, see `camera_of`.
    """

    def __init__(
        self,
        observations: Sequence[MarkerObservation],
        prior: CameraPrior,
        camera: Floats,
        joints: Floats,
        weights: ObservationWeights,
        frame: str | None = None,
    ) -> None:
        self._widths, self._camera = prior.widths, camera
        none = np.zeros((6, UNKNOWNS))
        seen = [
            camera_columns(found.pose, camera, found.frames is not None) * self._widths
            if is_shown(found, frame)
            else none
            for found in observations
        ]
        self._columns = np.concatenate([np.array(seen), joints], axis=2)
        pairs = enumerate(self._columns)
        self._weighted = np.array([weights.matrix(k) @ columns for k, columns in pairs])
        known = np.einsum("kip,kiq->pq", self._columns, self._weighted, optimize=True)
        self._factor = cho_factor(np.eye(len(known)) + known)
        scale = np.where(self._widths > 0.0, self._widths, 1.0)
        self._mean = np.append(camera / scale, np.zeros(joints.shape[2]))

    @property
    def log_det(self) -> float:
        """Logarithm of the determinant of A."""
        return 2.0 * float(np.log(np.diag(self._factor[0])).sum())

    def _likeliest(self, residuals: Floats) -> Floats:
        """Most probable change u (p,) of the errors for residuals (K, 6) [m, rad]."""
        pull = np.einsum("kip,ki->p", self._weighted, residuals)
        return np.asarray(cho_solve(self._factor, pull - self._mean))

    def camera(self, residuals: Floats) -> Floats:
        """Most probable errors of the camera (8,) [m, rad, 1, 1].

        Args:
            residuals: of the corrected poses (K, 6) [m, rad].
        """
        return self._camera + self._widths * self._likeliest(residuals)[:UNKNOWNS]

    def remaining(self, residuals: Floats) -> tuple[Floats, float]:
        """Residuals (K, 6) [m, rad] that the most probable errors leave, and the errors' cost.

        The cost of what remains and this one is that with the errors integrated out.

        Args:
            residuals: of the corrected poses (K, 6) [m, rad].
        """
        change = self._likeliest(residuals)
        return residuals - self._columns @ change, float(np.sum((self._mean + change) ** 2))

    def taken(self, slopes: Sequence[Floats]) -> Floats:
        """What the errors take from the Gauss-Newton matrix of all postures (K n, K n).

        Args:
            slopes: Jacobian of the residual (6, n) of each observation.
        """
        pairs = zip(slopes, self._weighted, strict=True)
        stacked = np.vstack([slope.T @ weighted for slope, weighted in pairs])
        return np.asarray(stacked @ cho_solve(self._factor, stacked.T))
