"""Camera model of the agent: intrinsics and lens distortion as OpenCV and ROS define them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera_file import camera_info, read_camera_file
from jmm_agent.vision.plain_numbers import real, reals, whole

COEFFICIENTS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (0, 8, 12), "fisheye": (0, 4)}
"""Valid numbers of distortion coefficients of each model."""
UNDISTORT = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
"""Iterations and tolerance of the inversion of the distortion."""
INVERTED_PX = 0.01
"""A pixel whose ray is projected farther from it than this [px] has no ray."""
STEEPEST = np.tan(np.deg2rad(89.0))
"""Slope of the steepest ray that is considered [1]."""
FARTHEST = 10.0
"""Farthest pixel from the principal point [focal lengths]; at 84 deg for an ideal lens."""
GRID, LEAST_SHARE = 15, 0.5
"""Tested pixels along each side of the frame; least share of them that must have a ray."""


@dataclass(frozen=True)
class Camera:
    """Camera with axes x right, y down and z forward; the centres of pixels are at integers.

    The distortion is that of `cv2.projectPoints` for ``plumb_bob`` (k1, k2, p1, p2[, k3]) and
    ``rational_polynomial`` (k1, k2, p1, p2, k3, k4, k5, k6[, s1, s2, s3, s4]), and that of
    `cv2.fisheye.projectPoints` for ``fisheye`` (k1, k2, k3, k4; ROS calls it equidistant).

    Attributes:
        width: of the frame [px].
        height: of the frame [px].
        fx: focal length along x [px].
        fy: focal length along y [px].
        cx: x of the principal point [px].
        cy: y of the principal point [px].
        distortion: coefficients of the lens model [1]; none for an ideal lens.
        model: ``plumb_bob``, ``rational_polynomial`` or ``fisheye``.

    Raises:
        AgentError: a value is no number, a size is below 1 px, a focal length is not positive and
            finite, the principal point is not finite, a pixel is more than `FARTHEST` focal lengths
            from it, the distortion is not that of the model, or it leaves more than half of the
            frame without rays (but for ``fisheye``, whose image may be a circle in the frame).
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    model: str = "plumb_bob"

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            object.__setattr__(self, name, whole(getattr(self, name), f"The camera's {name}"))
        for name in ("fx", "fy", "cx", "cy"):
            object.__setattr__(self, name, real(getattr(self, name), f"The camera's {name}"))
        if self.width < 1 or self.height < 1:
            raise AgentError(
                f"A camera of {self.width} x {self.height} px has no pixels; sizes start at 1."
            )
        for name in ("fx", "fy"):
            focal = getattr(self, name)
            if not (np.isfinite(focal) and focal > 0):
                raise AgentError(
                    f"The camera's focal length {name} is {focal} px; it must be positive and "
                    "finite."
                )
        if not np.isfinite([self.cx, self.cy]).all():
            raise AgentError(
                f"The camera's principal point is ({self.cx}, {self.cy}) px; it must be finite."
            )
        farthest = max(
            max(abs(centre), abs(size - 1 - centre)) / focal
            for centre, size, focal in (
                (self.cx, self.width, self.fx),
                (self.cy, self.height, self.fy),
            )
        )
        if farthest > FARTHEST:
            raise AgentError(
                f"The camera has pixels {farthest:.3g} focal lengths from its principal point, and "
                f"no lens images more than {FARTHEST:g}; fx, fy, cx and cy must be in pixels of a "
                f"frame of {self.width} x {self.height} px."
            )
        self._check_lens()

    def _check_lens(self) -> None:
        """Refuse a distortion that is not that of the model, or that folds within the frame."""
        if self.model not in COEFFICIENTS:
            raise AgentError(
                f"There is no camera model {self.model!r}; there are: {', '.join(COEFFICIENTS)}."
            )
        distortion = reals(self.distortion, "The camera's distortion")
        object.__setattr__(self, "distortion", distortion)
        counts = COEFFICIENTS[self.model]
        if len(self.distortion) not in counts or not np.isfinite(self.distortion).all():
            valid = " or ".join(str(count) for count in counts)
            raise AgentError(
                f"The camera's distortion is {self.distortion}; the model {self.model} takes "
                f"{valid} finite coefficients."
            )
        if self.distorts and not self._is_fisheye:
            columns = np.linspace(0, self.width - 1, GRID)
            rows = np.linspace(0, self.height - 1, GRID)
            rays = self.rays(np.stack(np.meshgrid(columns, rows), axis=-1))
            share = float(np.isfinite(rays[..., 0]).mean())
            if share < LEAST_SHARE:
                raise AgentError(
                    f"The camera's distortion {self.distortion} folds the image: only {share:.0%} "
                    "of the frame has rays. The coefficients or the focal length are wrong."
                )

    @classmethod
    def from_fovy(cls, width: int, height: int, fovy_rad: float) -> Camera:
        """Camera with square pixels, a centred principal point and an ideal lens.

        Args:
            width: of the frame [px].
            height: of the frame [px].
            fovy_rad: angle between the upper and the lower border of the frame [rad].

        Raises:
            AgentError: the angle is not between 0 and pi, or a size is below 1 px.
        """
        if not 0 < real(fovy_rad, "The camera's vertical view") < np.pi:
            raise AgentError(
                f"The camera's vertical view is {fovy_rad} rad; it must lie between 0 and pi."
            )
        focal = float(height / 2 / np.tan(fovy_rad / 2))
        return cls(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)

    @classmethod
    def from_file(cls, path: str | os.PathLike[str]) -> Camera:
        """Camera of a calibration file of OpenCV (YAML, XML) or of ROS (YAML).

        Args:
            path: file that OpenCV's FileStorage or ROS's ``camera_calibration`` has written.

        Raises:
            AgentError: the file cannot be read, or a value is missing or wrong.
        """
        if not isinstance(path, str | os.PathLike):
            raise AgentError(f"The path of a camera file is {path!r}; it must be a path.")
        return cls(*read_camera_file(Path(path)))

    @classmethod
    def from_camera_info(cls, message: Mapping[str, Any] | object) -> Camera:
        """Camera of a ``sensor_msgs/CameraInfo`` message, with its binning and region of interest.

        Args:
            message: message of ROS 1 or ROS 2, or a mapping with its fields.

        Raises:
            AgentError: a field is missing or wrong.
        """
        info, binning, roi = camera_info(message)
        camera = cls(*info)
        return (camera.cropped(*roi) if roi else camera).binned(*binning)

    @property
    def matrix(self) -> Floats:
        """Intrinsic matrix (3, 3) [px]."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def distorts(self) -> bool:
        """Whether the lens bends straight lines."""
        return self.model == "fisheye" or any(self.distortion)

    def binned(self, x: int, y: int) -> Camera:
        """The camera whose driver joins x columns and y rows to one pixel.

        Args:
            x: columns of a joined pixel; a rest at the right border is dropped.
            y: rows of a joined pixel; a rest at the lower border is dropped.

        Raises:
            AgentError: a number is below 1 or larger than the frame.
        """
        x, y = whole(x, "The binning of columns"), whole(y, "The binning of rows")
        if not (1 <= x <= self.width and 1 <= y <= self.height):
            raise AgentError(
                f"Binning by {x} x {y} does not fit a frame of {self.width} x {self.height} px; "
                "numbers start at 1."
            )
        return replace(
            self,
            width=self.width // x,
            height=self.height // y,
            fx=self.fx / x,
            fy=self.fy / y,
            cx=(self.cx + 0.5) / x - 0.5,
            cy=(self.cy + 0.5) / y - 0.5,
        )

    def cropped(self, left: int, top: int, width: int, height: int) -> Camera:
        """The camera whose driver sends only a region of interest.

        Args:
            left: first column of the region.
            top: first row of the region.
            width: of the region [px].
            height: of the region [px].

        Raises:
            AgentError: the region is not inside the frame.
        """
        left, top = whole(left, "The region's left column"), whole(top, "The region's top row")
        width, height = whole(width, "The region's width"), whole(height, "The region's height")
        inside = 0 <= left < left + width <= self.width and 0 <= top < top + height <= self.height
        if not inside:
            raise AgentError(
                f"The region of {width} x {height} px at ({left}, {top}) is not inside the frame "
                f"of {self.width} x {self.height} px."
            )
        return replace(self, width=width, height=height, cx=self.cx - left, cy=self.cy - top)

    def project(self, points: Floats) -> Floats:
        """Pixels of points in the camera's frame.

        Args:
            points: (..., 3) [m].

        Returns:
            Pixels (..., 2); NaN for a point behind the camera or beyond the view of its lens.
        """
        points = np.asarray(points, dtype=float)
        front = points[..., 2] > 0
        depth = np.where(front, points[..., 2], 1.0)
        slopes = points[..., :2] / depth[..., None]
        front &= np.hypot(slopes[..., 0], slopes[..., 1]) <= self._steepest
        pixels = slopes * (self.fx, self.fy) + (self.cx, self.cy)
        if self.distorts:
            pixels = self._distorted(np.where(front[..., None], slopes, 0.0))
        return np.where(front[..., None], pixels, np.nan)

    def rays(self, pixels: Floats) -> Floats:
        """Rays through pixels: points at the depth 1 in the camera's frame.

        Args:
            pixels: (..., 2) [px].

        Returns:
            Points (..., 3), with z = 1; NaN for a pixel that no ray reaches.
        """
        pixels = np.asarray(pixels, dtype=float)
        if not self.distorts:
            slopes = (pixels - (self.cx, self.cy)) / (self.fx, self.fy)
            return np.concatenate([slopes, np.ones_like(slopes[..., :1])], axis=-1)
        flat = np.ascontiguousarray(pixels.reshape(-1, 1, 2))
        undistort = cv2.fisheye.undistortPoints if self._is_fisheye else cv2.undistortPoints
        straight = undistort(flat, self.matrix, self._coefficients, criteria=UNDISTORT)
        rays = np.concatenate([straight.reshape(pixels.shape), np.ones_like(pixels[..., :1])], -1)
        missed = np.linalg.norm(self.project(rays) - pixels, axis=-1, keepdims=True)
        return np.where(missed < INVERTED_PX, rays, np.nan)

    @property
    def _is_fisheye(self) -> bool:
        return self.model == "fisheye"

    @cached_property
    def _coefficients(self) -> Floats:
        """Coefficients as OpenCV takes them."""
        return np.array(self.distortion if self.distortion else (0.0,) * 4)

    @cached_property
    def _steepest(self) -> float:
        """Slope of a ray [1] up to which the lens images steeper rays farther from its axis."""
        if not self.distorts:
            return float(np.inf)
        slopes = np.linspace(0.0, 1.0, 2000) ** 2 * STEEPEST
        images = self._distorted(np.stack([slopes, np.zeros_like(slopes)], axis=-1))[:, 0]
        folds = np.flatnonzero(np.diff(images) <= 0.0)
        return float(slopes[folds[0]] if len(folds) else STEEPEST)

    def _distorted(self, slopes: Floats) -> Floats:
        """Pixels (..., 2) of rays with slopes (..., 2) [1], through the lens."""
        points = np.concatenate([slopes, np.ones_like(slopes[..., :1])], axis=-1)
        flat, none = np.ascontiguousarray(points.reshape(-1, 1, 3)), np.zeros((3, 1))
        project = cv2.fisheye.projectPoints if self._is_fisheye else cv2.projectPoints
        pixels = project(flat, none, none, self.matrix, self._coefficients)[0]
        return np.asarray(pixels, dtype=float).reshape(slopes.shape)
