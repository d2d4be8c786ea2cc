"""Pixels that have the colour of a can: their hue and saturation, in bright and in dim light."""

from __future__ import annotations

import cv2
import numpy as np

from jmm_agent.vision.can_shape import CanShape

BLUR_PX = 1.2
"""Width of the filter over a frame with little noise [px]."""
BLUR_NOISE_PX = 1.6
"""The same over a frame with much noise [px]."""
MUCH_NOISE = 5.0
"""Noise that counts as much [grey levels]."""
DIMMEST = 4.0
"""A pixel whose brightest channel is below this has no colour [grey levels]."""
CLEAR = 4.0
"""Least brightness of a pixel that has a colour [standard deviations of the noise]."""


def smoothed(frame_rgb: np.ndarray) -> tuple[np.ndarray, float]:
    """The frame with less noise (H, W, 3) float32, and the noise that is left [grey levels].

    Args:
        frame_rgb: (H, W, 3) uint8.
    """
    frame = frame_rgb.astype(np.float32)
    noise = _noise(frame)
    blur = BLUR_NOISE_PX if noise > MUCH_NOISE else BLUR_PX
    # The filter leaves 1 / (2 sqrt(pi) blur) of the noise, if neighbours err independently.
    left = noise / (2 * float(np.sqrt(np.pi)) * blur)
    return cv2.GaussianBlur(frame, (0, 0), blur), left


def _noise(frame: np.ndarray) -> float:
    """Standard deviation of the noise of a pixel [grey levels], by second differences."""
    green = frame[::2, :, 1]
    second = np.abs(green[:, 2:] - 2 * green[:, 1:-1] + green[:, :-2])
    return float(np.median(second) / 0.6745 / np.sqrt(6.0))


def painted(frame: np.ndarray, noise: float, shape: CanShape) -> np.ndarray:
    """Which pixels have the can's colour (H, W), as float32 of 0 or 1.

    Args:
        frame: smoothed (H, W, 3) float32 [grey levels].
        noise: of its pixels [grey levels].
        shape: the can.
    """
    hsv = cv2.cvtColor(np.asarray(frame, np.float32), cv2.COLOR_RGB2HSV)
    away = np.abs((hsv[..., 0] - shape.hue + 180.0) % 360.0 - 180.0)
    bright = hsv[..., 2] > max(DIMMEST, CLEAR * noise)
    found = (away <= shape.hue_width) & (hsv[..., 1] >= shape.saturation) & bright
    cleaned = cv2.medianBlur(found.astype(np.uint8), 3)
    return np.asarray(cleaned, np.float32)
