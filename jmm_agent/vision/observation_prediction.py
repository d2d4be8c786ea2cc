"""Prediction of a look at the hand before it is learned, and how far the look is from it.

At a rest the lengths and tensions are known before the hand's pose is. The fit of all rests
(`jmm_agent.vision.rest_fit`) with the pose of the newest one hidden gives its joint angles theta
and, by the inverse of its Gauss-Newton matrix, their covariance S. It holds what the prior and all
earlier rests tell of the map, the zero posture, and the measured lengths. With the residual r of
the pose at theta, its Jacobian J and the covariance N of a measured pose,

    d^2 = r' (J S J' + N)^-1 r

has a chi-squared distribution with as many degrees of freedom as numbers were measured, if all of
this is right. How commands follow a changed map does not matter: what is predicted is the hand at
the lengths that were measured.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, f

from jmm_agent.types import Floats
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    ObservationWeights,
    PoseResidual,
    residual_of,
)
from jmm_agent.vision.observation_fit import ObservationFitOptions
from jmm_agent.vision.pose_covariance import UNKNOWN

REGION = 0.95
"""Probability of the region in which a look is expected [1]."""


class ObservationPrediction(NamedTuple):
    """What was expected of a look at the hand, and how far it was from that.

    Attributes:
        angles: expected joint angles (n,) [rad].
        std: standard deviations of these (n,) [rad].
        position_error: distance of the hand from where it was expected [m]; NaN if its position was
            not measured.
        position_std: root mean square of that distance, as expected [m].
        rotation_error: angle of the hand from where it was expected [rad]; NaN if not measured.
        rotation_std: root mean square of that angle, as expected [rad].
        distance: d^2, the squared Mahalanobis distance of pose and prediction [1].
        measured: how many numbers of the pose were measured.
        freedom: number of degrees of freedom by which the factor of the covariances is known, see
            `jmm_agent.prediction_record`; infinite where they were not scaled.
    """

    angles: Floats
    std: Floats
    position_error: float
    position_std: float
    rotation_error: float
    rotation_std: float
    distance: float
    measured: int
    freedom: float = np.inf

    @property
    def inside(self) -> bool:
        """Whether the look is in the region of `REGION`."""
        if np.isinf(self.freedom):
            return bool(self.distance <= chi2.ppf(REGION, self.measured))
        return bool(self.distance <= self.measured * f.ppf(REGION, self.measured, self.freedom))

    def scaled(self, factor: float, freedom: float) -> ObservationPrediction:
        """The prediction with larger or smaller covariances.

        Args:
            factor: of the covariances [1].
            freedom: number of degrees of freedom by which it is known.
        """
        root = float(np.sqrt(factor))
        return self._replace(
            std=root * self.std,
            position_std=root * self.position_std,
            rotation_std=root * self.rotation_std,
            distance=self.distance / factor,
            freedom=freedom,
        )

    @property
    def sentence(self) -> str:
        """Error and expected error, in a sentence without a full stop."""
        parts = []
        if np.isfinite(self.position_error):
            parts.append(f"{1e3 * self.position_error:.3g} mm ({1e3 * self.position_std:.3g} mm)")
        if np.isfinite(self.rotation_error):
            error, std = np.degrees([self.rotation_error, self.rotation_std])
            parts.append(f"{error:.2g} deg ({std:.2g} deg)")
        where = "inside" if self.inside else "outside"
        return (
            f"the hand is {' and '.join(parts)} from where it was expected, the expected error in "
            f"parentheses; {where} of the region of {REGION:.0%}"
        )


def hidden(observation: MarkerObservation) -> MarkerObservation:
    """A look whose pose was not measured, so that a fit predicts it.

    Args:
        observation: the look.
    """
    return observation._replace(covariance=UNKNOWN * np.eye(6))


def compared(
    observation: MarkerObservation,
    marker_residual: PoseResidual,
    options: ObservationFitOptions,
    angles: Floats,
    covariance: Floats,
) -> ObservationPrediction:
    """How far a look is from its prediction.

    Args:
        observation: the look.
        marker_residual: residual of the marker's pose at a posture.
        options: noise of poses.
        angles: expected joint angles (n,) [rad].
        covariance: of these (n, n) [rad^2].
    """
    residual, slope = residual_of(observation, marker_residual, angles)
    pose = observation._replace(joint_angles=None)
    weights = ObservationWeights(
        [pose], options.position_noise, options.rotation_noise, options.joint_noise
    )
    white, turned = weights.whitened(0, angles, residual, slope)
    whole = np.eye(len(white)) + turned @ covariance @ turned.T
    distance = float(white @ np.linalg.solve(whole, white))
    known = np.ones(6, dtype=bool)
    if observation.covariance is not None:
        known = np.diag(observation.covariance) < UNKNOWN
    noise = np.linalg.pinv(weights.normal_equations(0, angles, np.zeros(6), np.eye(6))[0])
    spread = slope @ covariance @ slope.T + noise
    (away, expected), (turned_away, turn) = (
        (np.linalg.norm(residual[rows]), np.sqrt(np.trace(spread[rows, rows])))
        if known[rows].all()
        else (np.nan, np.nan)
        for rows in (slice(0, 3), slice(3, 6))
    )
    return ObservationPrediction(
        angles=angles,
        std=np.sqrt(np.diag(covariance)),
        position_error=float(away),
        position_std=float(expected),
        rotation_error=float(turned_away),
        rotation_std=float(turn),
        distance=distance,
        measured=int(known.sum()),
    )
