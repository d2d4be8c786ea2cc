"""Crops of a frame as a virtual camera without distortion sees them, which looks at one point.

A network that is trained on such crops need not know the camera: focal length, lens and position
of the hand in the frame are removed by the virtual camera, whose axes are turned from those of the
real one.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera

COARSER = 1.3
"""A frame with more pixels than a crop by this factor is made smaller first, without aliasing."""

MARGIN = 1.35
"""Half the width of the view of a hand, as a multiple of the hand's radius [1]."""


class CropView(NamedTuple):
    """A virtual pinhole camera with a square image.

    Attributes:
        rotation: axes of the virtual camera in those of the real one (3, 3), as columns.
        slope: of the ray through the middle of a border of the image [1].
        size: width and height of the image [px].
    """

    rotation: Floats
    slope: float
    size: int

    @property
    def focal(self) -> float:
        """Focal length [px]."""
        return self.size / 2.0 / self.slope

    def slopes(self, pixels: Floats) -> Floats:
        """Slopes x/z and y/z (..., 2) of rays through pixels (..., 2) of the crop."""
        return np.asarray((pixels - (self.size - 1) / 2.0) / self.focal)

    def project(self, points: Floats) -> Floats:
        """Pixels (..., 2) of points (..., 3) in the real camera's axes [m], which are before it."""
        turned = points @ self.rotation
        return np.asarray(turned[..., :2] / turned[..., 2:] * self.focal + (self.size - 1) / 2.0)

    def cut(self, frame: np.ndarray, camera: Camera) -> np.ndarray:
        """The crop (size, size, 3) of a frame (H, W, 3); black where the frame shows nothing.

        Args:
            frame: uint8.
            camera: that took it.
        """
        size = self.size
        x, y = np.meshgrid(np.arange(size, dtype=float), np.arange(size, dtype=float))
        slopes = self.slopes(np.stack([x, y], axis=-1))
        rays = np.concatenate([slopes, np.ones((size, size, 1))], axis=-1) @ self.rotation.T
        pixels = camera.project(rays)
        factor = camera.fx / self.focal
        if factor > COARSER:
            sides = [max(round(side / factor), 1) for side in frame.shape[1::-1]]
            pixels = (pixels + 0.5) * (np.array(sides) / frame.shape[1::-1]) - 0.5
            frame = cv2.resize(frame, sides, interpolation=cv2.INTER_AREA)
        maps = np.nan_to_num(pixels, nan=-10.0).astype(np.float32)
        return cv2.remap(frame, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR)


def roll_of(rotation: Floats) -> float:
    """Turn about the line of sight that is nearest to a rotation (3, 3) in a view [rad]."""
    return float(np.arctan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1]))


def hand_view(
    pose: Floats, centre: Floats, radius: float, size: int, level: bool = False
) -> CropView:
    """The view of a hand at a pose.

    Args:
        pose: pose_hand_in_camera (4, 4), before the camera.
        centre: middle of the hand in its axes (3,) [m].
        radius: of the hand [m].
        size: of the crop [px].
        level: whether the view is turned with the hand.
    """
    middle = pose[:3, :3] @ centre + pose[:3, 3]
    slope = MARGIN * radius / float(np.linalg.norm(middle))
    view = looking_at(middle, slope, size)
    if level:
        view = looking_at(middle, slope, size, roll_of(view.rotation.T @ pose[:3, :3]))
    return view


def looking_at(point: Floats, slope: float, size: int, roll: float = 0.0) -> CropView:
    """A view whose middle shows a point.

    Args:
        point: in the real camera's axes (3,), before it.
        slope: of the ray through the middle of a border [1].
        size: of the crop [px].
        roll: turn of the view about its axis [rad].
    """
    axis = np.asarray(point, dtype=float) / np.linalg.norm(point)
    turn = np.array([-axis[1], axis[0], 0.0])  # z x axis
    sine = np.linalg.norm(turn)
    vector = turn / sine * np.arctan2(sine, axis[2]) if sine > 1e-12 else turn
    turned = cv2.Rodrigues(vector)[0] @ cv2.Rodrigues(np.array([0.0, 0.0, roll]))[0]
    return CropView(np.asarray(turned, dtype=float), slope, size)
