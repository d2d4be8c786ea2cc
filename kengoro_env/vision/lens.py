"""Lens: bends the picture of an ideal camera as a real lens does."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import mujoco
import numpy as np

from kengoro_env.departures.camera import EYE
from kengoro_env.errors import ArgumentError
from kengoro_env.types import Floats
from kengoro_env.vision.rendering import HEIGHT, QUALITY, WIDTH, Image, Painter

WIDEST = 2.5
"""Widest ideal picture from which the distorted one is taken [sizes of the frame]."""

STEPS, RESIDUAL = 60, 1e-9
"""Newton steps of the inversion, and the distance at which it has found a ray [focal lengths]."""


class Lens:
    """Makes a distorted picture of a wider one of an ideal camera.

    Pixels, rays and coefficients are those of `cv2.projectPoints` with (k1, k2, p1, p2, k3), the
    principal point in the middle of the frame.

    Args:
        coefficients: k1, k2, p1, p2, k3 [1].
        fovy: vertical field of view of the camera without distortion [deg].
        width: of the frame [px].
        height: of the frame [px].

    Attributes:
        size: width and height of the wider picture [px], at the frame's scale.
        fovy: vertical field of view of the wider picture [deg].

    Raises:
        ArgumentError: pixels of the frame have no ray, or rays too far outside of the frame.
    """

    def __init__(
        self, coefficients: tuple[float, ...], fovy: float, width: int, height: int
    ) -> None:
        focal = 0.5 * height / np.tan(np.radians(fovy) / 2)
        rows, columns = np.mgrid[:height, :width]
        middle = 0.5 * (np.array([width, height]) - 1)
        seen = (np.stack([columns, rows], axis=-1).reshape(-1, 2) - middle) / focal
        rays = undistorted(seen, coefficients)
        times = np.abs(rays).max(axis=0) * focal / (middle + 0.5)
        if not np.all(times < WIDEST):
            raise ArgumentError(
                f"LensDistortion{coefficients}: the frame's corners have no ray within "
                f"{WIDEST} times the frame; valid are weaker coefficients"
            )
        larger = np.ceil(np.array([width, height]) * np.maximum(times, 1.0) / 2).astype(int) + 1
        self.size = (int(2 * larger[0]), int(2 * larger[1]))
        self.fovy = float(np.degrees(2 * np.arctan(0.5 * self.size[1] / focal)))
        self._shape = (height, width, 3)
        point = rays * focal + 0.5 * (np.array(self.size) - 1)
        corner = np.floor(point).astype(int)
        corner = np.clip(corner, 0, np.array(self.size) - 2)
        self._share = (point - corner).astype(np.float32)[:, :, None]
        self._index = corner[:, 1] * self.size[0] + corner[:, 0]

    def bend(self, picture: Image) -> Image:
        """The distorted frame (height, width, 3) of a wider picture, by linear interpolation."""
        pixels, index, width = picture.reshape(-1, 3), self._index, self.size[0]
        x, y = self._share[:, 0], self._share[:, 1]
        upper = (1 - x) * pixels[index] + x * pixels[index + 1]
        lower = (1 - x) * pixels[index + width] + x * pixels[index + width + 1]
        bent = (1 - y) * upper + y * lower
        return np.rint(bent).astype(np.uint8).reshape(self._shape)


class LensPainter(Painter):
    """Renders the frames of one camera through a lens.

    Args:
        model: the model.
        coefficients: k1, k2, p1, p2, k3 of the lens [1].
        camera: name of the camera.
        quality: `QUALITY` or `COARSE`.

    Raises:
        ArgumentError: pixels of the frame have no ray.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        coefficients: tuple[float, ...],
        camera: str,
        quality: Mapping[str, int] = QUALITY,
    ) -> None:
        self._fovy = model.cam_fovy[model.camera(camera).id :][:1]
        self._lens = Lens(coefficients, float(self._fovy[0]), WIDTH, HEIGHT)
        super().__init__(model, *self._lens.size, quality)

    def draw(
        self,
        data: mujoco.MjData,
        camera: str,
        decorate: Callable[[mujoco.MjvScene], None] | None = None,
        visible: mujoco.MjvOption | None = None,
    ) -> Image:
        """Frame of the camera (height, width, 3) uint8, RGB; a new array."""
        fovy = float(self._fovy[0])
        self._fovy[0] = self._lens.fovy
        try:
            return self._lens.bend(super().draw(data, camera, decorate, visible))
        finally:
            self._fovy[0] = fovy


def camera_painter(
    model: mujoco.MjModel,
    lens: tuple[float, ...] | None,
    quality: Mapping[str, int] = QUALITY,
    camera: str = EYE,
) -> Painter:
    """A painter of a camera's frames, with its lens if it has one.

    Args:
        model: the model.
        lens: distortion k1, k2, p1, p2, k3 [1]; None if there is none.
        quality: `QUALITY` or `COARSE`.
        camera: name of the camera.
    """
    if lens is None:
        return Painter(model, quality=quality)
    return LensPainter(model, lens, camera, quality)


def undistorted(seen: Floats, coefficients: tuple[float, ...]) -> Floats:
    """Rays (n, 2) that a lens sees at given points; NaN where there is none.

    Args:
        seen: places in the frame (n, 2) [focal lengths].
        coefficients: k1, k2, p1, p2, k3 [1].
    """
    rays = seen.copy()
    for _ in range(STEPS):
        point, slope = distorted(rays, coefficients)
        error = point - seen
        if np.abs(error).max() < RESIDUAL:
            return rays
        with np.errstate(all="ignore"):
            determinant = slope[:, 0, 0] * slope[:, 1, 1] - slope[:, 0, 1] * slope[:, 1, 0]
            step = np.column_stack(
                [
                    slope[:, 1, 1] * error[:, 0] - slope[:, 0, 1] * error[:, 1],
                    slope[:, 0, 0] * error[:, 1] - slope[:, 1, 0] * error[:, 0],
                ]
            )
            rays = rays - np.clip(step / determinant[:, None], -0.2, 0.2)
    lost = np.abs(distorted(rays, coefficients)[0] - seen).max(axis=1) > 1e3 * RESIDUAL
    rays[lost] = np.nan
    return rays


def distorted(rays: Floats, coefficients: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Points (n, 2) at which a lens shows rays (n, 2), and their slopes (n, 2, 2)."""
    k1, k2, p1, p2, k3 = coefficients
    x, y = rays.T
    square = x**2 + y**2
    radial = 1 + square * (k1 + square * (k2 + square * k3))
    slope = k1 + square * (2 * k2 + 3 * square * k3)
    point = np.column_stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (square + 2 * x**2),
            y * radial + p1 * (square + 2 * y**2) + 2 * p2 * x * y,
        ]
    )
    mixed = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y
    rows = [
        [radial + 2 * x**2 * slope + 2 * p1 * y + 6 * p2 * x, mixed],
        [mixed, radial + 2 * y**2 * slope + 6 * p1 * y + 2 * p2 * x],
    ]
    return point, np.moveaxis(np.array(rows), -1, 0)
