"""Residual of a posture against a measured pose of the marker (paper, sec. III-C)."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats


class MarkerResidual:
    """Error of the marker's pose in the camera frame, with its Jacobian.

    Args:
        kinematics: of all joints between camera and marker.
        camera: the camera's frame.
        marker_site: the site that carries the marker.

    Raises:
        KinematicsError: there is no such frame.
    """

    def __init__(self, kinematics: ArmKinematics, camera: str, marker_site: str) -> None:
        self._kinematics, self._camera, self._marker = kinematics, camera, marker_site
        kinematics.pose(marker_site, np.zeros(len(kinematics.joints)), relative_to=camera)

    def __call__(self, q: Floats, pose: Floats) -> tuple[Floats, Floats]:
        """Error of a posture against a measured pose.

        Args:
            q: joint angles (n,) [rad].
            pose: measured pose_marker_in_camera (4, 4).

        Returns:
            Error (6,) and its Jacobian by q (6, n). Rows 0 to 2 are the marker's offset [m], rows 3
            to 5 its rotation vector [rad], both in the axes of the measured marker.
        """
        expected = self._kinematics.pose(self._marker, q, relative_to=self._camera)
        slope = self._kinematics.frame_jacobian(self._marker, q, relative_to=self._camera)
        rotation = pose[:3, :3].T @ expected[:3, :3]
        offset = pose[:3, :3].T @ (expected[:3, 3] - pose[:3, 3])
        error = np.concatenate([offset, pin.log3(rotation)])
        jacobian = np.vstack([rotation @ slope[:3], pin.Jlog3(rotation) @ slope[3:]])
        return error, jacobian
