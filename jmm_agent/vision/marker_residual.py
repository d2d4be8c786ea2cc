"""Residual of a posture against a measured pose of the marker (paper, sec. III-C)."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.types import Floats
from jmm_agent.vision.marker_observation import Frames


class MarkerResidual:
    """Error of the marker's pose in the camera frame, or of another pose, with its Jacobian.

    Args:
        kinematics: of all joints between camera and marker.
        camera: the camera's frame; None: world, where no camera is used.
        marker_site: the site that carries the marker.

    Attributes:
        camera: as given.

    Raises:
        KinematicsError: there is no such frame.
    """

    def __init__(self, kinematics: ArmKinematics, camera: str | None, marker_site: str) -> None:
        self._kinematics, self._frames, self.camera = kinematics, (marker_site, camera), camera
        kinematics.pose(marker_site, np.zeros(len(kinematics.joints)), relative_to=camera)

    def __call__(
        self, q: Floats, pose: Floats, frames: Frames | None = None
    ) -> tuple[Floats, Floats]:
        """Error of a posture against a measured pose.

        Args:
            q: joint angles (n,) [rad].
            pose: measured pose_marker_in_camera (4, 4), or pose of ``frames``.
            frames: whose pose was measured, and in which frame (None: world); the marker's in the
                camera if left out.

        Returns:
            Error (6,) and its Jacobian by q (6, n). Rows 0 to 2 are the marker's offset [m], rows 3
            to 5 its rotation vector [rad], both in the axes of the measured marker.
        """
        frame, reference = frames or self._frames
        expected = self._kinematics.pose(frame, q, relative_to=reference)
        slope = self._kinematics.frame_jacobian(frame, q, relative_to=reference)
        rotation = pose[:3, :3].T @ expected[:3, :3]
        offset = pose[:3, :3].T @ (expected[:3, 3] - pose[:3, 3])
        error = np.concatenate([offset, pin.log3(rotation)])
        jacobian = np.vstack([rotation @ slope[:3], pin.Jlog3(rotation) @ slope[3:]])
        return error, jacobian

    def misplaced(self, q: Floats, frames: Frames | None = None) -> Floats:
        """Movements (6, n, 6) of the marker by errors of the joints; `ArmKinematics.misplaced`.

        Args:
            q: joint angles (n,) [rad].
            frames: as above.
        """
        frame, reference = frames or self._frames
        return self._kinematics.misplaced(frame, q, relative_to=reference)
