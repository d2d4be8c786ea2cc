"""Straight view of a marker: an ideal camera in which the marker's edges are straight lines.

Through an ideal lens it is the camera itself. Through a lens that distorts it is an ideal camera at
the same place that looks at the marker with the same number of pixels per angle; so a marker at the
rim of a fisheye's frame is measured as one in the middle.
"""

from __future__ import annotations

import cv2
import numpy as np

from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera


class MarkerView:
    """Ideal camera that looks at a marker.

    Args:
        camera: that takes the frames.
        corners: rough corners of the marker in the frame (4, 2) [px].

    Attributes:
        matrix: intrinsic matrix of the view (3, 3) [px].
        rotation: axes of the view in the camera's frame (3, 3), as columns.
    """

    def __init__(self, camera: Camera, corners: Floats) -> None:
        self._camera = camera
        self.matrix, self.rotation = camera.matrix, np.eye(3)
        self.straight = not camera.distorts
        if self.straight:
            return
        rays = camera.rays(corners)
        rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        middle = rays.mean(axis=0)
        self.rotation = towards(middle / np.linalg.norm(middle))
        slopes = rays @ self.rotation
        slopes = slopes[:, :2] / slopes[:, 2:]
        focal = np.sqrt(_area(corners) / _area(slopes)) if np.isfinite(rays).all() else np.nan
        self.matrix = np.diag([focal, focal, 1.0])

    def view_px(self, pixels: Floats) -> Floats:
        """Points of the view [px] that the frame shows at pixels (..., 2); NaN if there is none."""
        if self.straight:
            return np.asarray(pixels, dtype=float)
        rays = self._camera.rays(pixels) @ self.rotation
        depth = np.where(rays[..., 2:] > 0, rays[..., 2:], np.nan)
        return self.matrix[0, 0] * rays[..., :2] / depth

    def frame_px(self, points: Floats) -> Floats:
        """Pixels of the frame that show points of the view (..., 2) [px]; NaN if there is none."""
        if self.straight:
            return points
        focal = self.matrix[0, 0]
        rays = np.concatenate([points, np.full_like(points[..., :1], focal)], axis=-1)
        return self._camera.project(rays @ self.rotation.T)

    def in_camera(self, pose: Floats) -> Floats:
        """A pose (4, 4) in the view's axes, in the camera's."""
        if self.straight:
            return pose
        turned = pose.copy()
        turned[:3] = self.rotation @ pose[:3]
        return turned

    def covariance_in_camera(self, covariance: Floats) -> Floats:
        """A covariance of a pose (6, 6) in the view's axes, in the camera's."""
        turn = np.kron(np.eye(2), self.rotation)
        return np.asarray(turn @ covariance @ turn.T)

    def in_view(self, pose: Floats) -> Floats:
        """A pose (4, 4) in the camera's axes, in the view's."""
        if self.straight:
            return pose
        turned = np.array(pose, dtype=float)
        turned[:3] = self.rotation.T @ turned[:3]
        return turned


def towards(ray: Floats) -> Floats:
    """Smallest rotation (3, 3) that turns the optical axis into a direction.

    Args:
        ray: the direction (3,), of unit length.
    """
    axis = np.cross([0.0, 0.0, 1.0], ray)
    sine = float(np.linalg.norm(axis))
    if not sine > 0.0:
        return np.eye(3)
    return np.asarray(cv2.Rodrigues(axis / sine * np.arctan2(sine, ray[2]))[0])


def _area(corners: Floats) -> float:
    """Area of a quadrangle (4, 2), by the shoelace formula."""
    x, y = corners.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
