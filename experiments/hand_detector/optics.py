"""What a camera does to a picture: exposure, white balance, blur, noise and compression.

Images are (height, width, 3); floats are brightness from 0 to 1, uint8 are frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from jmm_agent.types import Floats

Image = NDArray[np.uint8]
FAULTS = ("none", "noise", "motion blur", "defocus", "JPEG", "colour cast")
"""What is most wrong with a frame's camera."""
SHARES = (0.30, 0.14, 0.14, 0.14, 0.14, 0.14)
"""How often each is."""


@dataclass(frozen=True)
class Optics:
    """Faults of the camera in a frame.

    Attributes:
        fault: one of `FAULTS`, the strongest.
        mean: brightness to which the exposure is set [1], as the mean of the frame.
        balance: factors of red, green and blue [1].
        shading: darkening of the corners [1].
        motion: length and direction of the motion blur [px, rad].
        defocus: radius of the defocus [px].
        noise: standard deviation of the noise at black and at white [1].
        quality: of the JPEG compression [%]; None: it is not compressed.
        seed: of the noise.
    """

    fault: str
    mean: float
    balance: tuple[float, float, float]
    shading: float
    motion: tuple[float, float]
    defocus: float
    noise: tuple[float, float]
    quality: int | None
    seed: int


def sample_optics(rng: np.random.Generator, mean: float) -> Optics:
    """Sample the faults of a frame, exposed to a mean brightness [1]."""
    fault = str(rng.choice(FAULTS, p=SHARES))
    strong = {name: name == fault for name in FAULTS}
    cast = rng.uniform(0.72, 1.28, 3) if strong["colour cast"] else rng.uniform(0.94, 1.06, 3)
    length = rng.uniform(4.0, 12.0) if strong["motion blur"] else rng.uniform(0.0, 1.5)
    radius = rng.uniform(1.2, 3.5) if strong["defocus"] else rng.uniform(0.3, 0.8)
    read = rng.uniform(0.015, 0.05) if strong["noise"] else rng.uniform(0.002, 0.01)
    quality = int(rng.integers(12, 45)) if strong["JPEG"] else int(rng.integers(75, 96))
    compressed = strong["JPEG"] or rng.uniform() < 0.5
    return Optics(
        fault,
        mean,
        (float(cast[0]), float(cast[1]), float(cast[2])),
        float(rng.uniform(0.0, 0.35)),
        (float(length), float(rng.uniform(0.0, np.pi))),
        float(radius),
        (float(read), float(read * rng.uniform(1.0, 2.0))),
        quality if compressed else None,
        int(rng.integers(2**31)),
    )


def expose(picture: Image, optics: Optics) -> Image:
    """The frame of a picture that an ideal camera would take."""
    light = (picture / 255.0) ** 2.2
    gain = np.clip((255.0 * optics.mean / max(float(picture.mean()), 1.0)) ** 2.2, 0.02, 20.0)
    light = light * gain * np.array(optics.balance) ** 2.2
    light *= _shading(picture.shape[:2], optics.shading)[:, :, None]
    light = move_blur(light, *optics.motion)
    light = defocus_blur(light, optics.defocus)
    values = np.clip(light, 0.0, 1.0) ** (1 / 2.2)
    rng = np.random.default_rng([optics.seed, 3806])
    low, high = optics.noise
    values += (low + (high - low) * values) * rng.standard_normal(values.shape)
    frame = np.rint(255.0 * np.clip(values, 0.0, 1.0)).astype(np.uint8)
    return frame if optics.quality is None else compress(frame, optics.quality)


def _shading(shape: tuple[int, ...], amount: float) -> Floats:
    rows, columns = (np.linspace(-1.0, 1.0, side) for side in shape)
    return np.asarray(1.0 - amount * (rows[:, None] ** 2 + columns[None, :] ** 2) / 2.0)


def move_blur(image: Floats, length: float, direction: float) -> Floats:
    """Blur along a line of a length [px] and a direction [rad], centred."""
    if length < 1.0:
        return image
    half = int(np.ceil(length / 2.0)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    for along in np.linspace(-length / 2.0, length / 2.0, 8 * half):
        x, y = half + along * np.cos(direction), half + along * np.sin(direction)
        column, row = int(x), int(y)
        for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
            share = abs(1 - dx - (x - column)) * abs(1 - dy - (y - row))
            kernel[row + dy, column + dx] += share
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()))


def defocus_blur(image: Floats, radius: float) -> Floats:
    """Blur by a disk of a radius [px]."""
    if radius < 0.5:
        return image
    half = int(np.ceil(radius))
    rows, columns = np.mgrid[-half : half + 1, -half : half + 1]
    kernel = np.clip(radius + 0.5 - np.hypot(rows, columns), 0.0, 1.0)
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()))


def compress(frame: Image, quality: int) -> Image:
    """A frame after JPEG compression of a quality [%]."""
    _, code = cv2.imencode(".jpg", frame[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    frame = np.asarray(cv2.imdecode(code, cv2.IMREAD_COLOR), dtype=np.uint8)
    return np.ascontiguousarray(frame[:, :, ::-1])
