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
        position: distance of the hand's origin [m].
        rotation: angle between them [rad].
        position_share: squared distance in units of the claimed covariance, 3 degrees of freedom.
        rotation_share: the same of the rotation.
    """

    position: float
    rotation: float
    position_share: float
    rotation_share: float


def pose_deviation(found: HandDetection, pose: Floats) -> PoseDeviation:
    """Error of a detection.

    Args:
        found: the detection.
        pose: true pose_hand_in_camera (4, 4).
    """
    away = found.pose_hand_in_camera[:3, 3] - pose[:3, 3]
    turn = cv2.Rodrigues(found.pose_hand_in_camera[:3, :3] @ pose[:3, :3].T)[0].ravel()
    covariance = found.covariance
    return PoseDeviation(
        float(np.linalg.norm(away)),
        float(np.linalg.norm(turn)),
        float(away @ np.linalg.solve(covariance[:3, :3], away)),
        float(turn @ np.linalg.solve(covariance[3:, 3:], turn)),
    )
