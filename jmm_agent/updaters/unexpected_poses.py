"""Poses of the hand that are far from what is known of the robot: outliers of a detector.

A detector of a hand without a marker is far off now and then, with the covariance of a right pose.
Two distances tell of it, each squared, in standard deviations, and of a chi-squared distribution if
all is right. That of a new pose from its prediction is `ObservationPrediction.distance`. For a
remembered one, with the residual r, its Jacobian J and the covariance N of the pose, and the
covariance S of its joint angles by the fit of all,

    d^2 = r' (N - J S J')^-1 r

is its distance from what all others predict, because its own part is taken from S. Detectors may
claim too small covariances: if the median of all d^2 is larger than that of the distribution, they
are compared by their ratio to it.

A robot that has changed is far from its prediction, too. So a new pose that is far off is left out
only if the one before it was not: what two looks in a row show is learned.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from jmm_agent.types import Floats
from jmm_agent.vision.map_posterior import MapPosterior
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    ObservationWeights,
    PoseResidual,
    residual_of,
)
from jmm_agent.vision.observation_fit import ObservationFitOptions
from jmm_agent.vision.observation_prediction import ObservationPrediction
from jmm_agent.vision.pose_covariance import UNKNOWN

UNEXPECTED = "the pose is far from where the hand was expected, and the one before it was not"
"""Reason of a new pose that is not learned from."""
CONTRADICTED = "forgotten: the poses that came later contradict it"
"""Reason of a pose that was learned from, and is not any more."""
LEAST = 0.05
"""Least share of a pose's own variance that its residual has, however far it moved the fit [1]."""


def is_unexpected(predicted: ObservationPrediction | None, probability: float) -> bool:
    """Whether a pose is farther from its prediction than is believed.

    Args:
        predicted: the prediction; None if there is none.
        probability: of a right pose that is as far off [1]; 0: all are believed.
    """
    if predicted is None or not probability:
        return False
    return bool(predicted.distance > chi2.isf(probability, predicted.measured))


def contradicted(
    observations: Sequence[MarkerObservation],
    angles: Floats,
    posterior: MapPosterior,
    marker_residual: PoseResidual,
    options: ObservationFitOptions,
    probability: float,
) -> int | None:
    """Number of the pose that all others contradict most; None if they contradict none.

    Args:
        observations: K observations, as the camera is believed to show them.
        angles: their fitted joint angles (K, n) [rad].
        posterior: by the fit of all.
        marker_residual: residual of the marker's pose at a posture.
        options: noise of poses.
        probability: of a right pose that is as far off [1]; 0: all are believed.
    """
    if not probability:
        return None
    ratios = np.zeros(len(observations))
    limits = np.full(len(observations), np.inf)
    for k, (found, q) in enumerate(zip(observations, angles, strict=True)):
        if found.covariance is None:
            continue
        pose = found._replace(joint_angles=None)
        noise = options.position_noise, options.rotation_noise, options.joint_noise
        weights = ObservationWeights([pose], *noise)
        residual, slope = residual_of(pose, marker_residual, q)
        white, turned = weights.whitened(0, q, residual, slope)
        left = np.eye(len(white)) - turned @ posterior.covariance_of_rest(k) @ turned.T
        values, axes = np.linalg.eigh(left)
        distance = float(np.sum((axes.T @ white) ** 2 / np.maximum(values, LEAST)))
        measured = int(np.sum(np.diag(found.covariance) < UNKNOWN))
        usual = chi2.median(measured)
        ratios[k] = distance / usual
        limits[k] = chi2.isf(probability / len(observations), measured) / usual
    known = np.isfinite(limits)
    if not known.any():
        return None
    excess = ratios / limits / max(1.0, float(np.median(ratios[known])))
    worst = int(excess.argmax())
    return worst if excess[worst] > 1.0 else None
