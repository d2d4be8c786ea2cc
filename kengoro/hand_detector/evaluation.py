"""Errors of a hand detector in labelled frames."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from jmm_agent.vision.hand_detection import HandDetection
from kengoro_env.types import Floats


class PoseDeviation(NamedTuple):
    """How far a detected pose is from the true one.

    Attributes:
        error: of the position [m] and of the rotation, as a rotation vector [rad] (6,).
        covariance: that the detection claims (6, 6).
    """

    error: Floats
    covariance: Floats

    @property
    def position(self) -> float:
        """Distance of the hand's origin [m]."""
        return float(np.linalg.norm(self.error[:3]))

    @property
    def rotation(self) -> float:
        """Angle between them [rad]."""
        return float(np.linalg.norm(self.error[3:]))

    def distance(self, part: slice, factors: Floats) -> float:
        """Squared distance in units of the claimed covariance.

        Args:
            part: which of the six numbers of the error.
            factors: by which the standard deviations are multiplied (6,) [1].
        """
        error = (self.error / factors)[part]
        return float(error @ np.linalg.solve(self.covariance[part, part], error))


def pose_deviation(found: HandDetection, pose: Floats) -> PoseDeviation:
    """Error of a detection.

    Args:
        found: the detection.
        pose: true pose_hand_in_camera (4, 4).
    """
    away = found.pose_hand_in_camera[:3, 3] - pose[:3, 3]
    turn = cv2.Rodrigues(found.pose_hand_in_camera[:3, :3] @ pose[:3, :3].T)[0].ravel()
    return PoseDeviation(np.concatenate([away, turn]), found.covariance)
