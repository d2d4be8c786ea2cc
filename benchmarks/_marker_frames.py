"""Frames of a marker plate before photograph-like backgrounds, by ray casting through any lens."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from jmm_agent.vision.camera import Camera
from jmm_agent.vision.marker_view import towards

Floats = NDArray[np.float64]
BLACK, WHITE, SKIN = 0.06, 0.85, 0.45
"""Reflectances of ink, paper and a finger."""
SENSOR_BLUR = 0.5
"""Standard deviation of the lens's and the sensor's own blur [px]."""
RAYS = 5
"""Rays along each side of a pixel of the marker."""
SIDE = 0.05
"""Side of the black square [m]."""


class Frame(NamedTuple):
    """A rendered frame (H, W, 3) uint8, and the true pose_marker_in_camera (4, 4)."""

    image: NDArray[np.uint8]
    pose: Floats


@dataclass(frozen=True)
class Condition:
    """What a marker looks like in a frame.

    Attributes:
        name: of the condition.
        camera: that takes the frame.
        size: smallest and largest side of the marker [px].
        dictionary: of the marker.
        border: width of the black border [cells].
        tilt: largest angle from the line of sight [rad].
        motion: length of a linear motion blur [px].
        defocus: radius of a disc of defocus [px].
        light: share of the normal light.
        noise: standard deviation of the noise of each pixel [grey levels].
        hidden: radius of a finger over a corner, as a share of the side.
        gloss: whether a highlight lies over a part of the marker.
    """

    name: str
    camera: Camera
    size: tuple[float, float] = (60.0, 140.0)
    dictionary: str = "DICT_4X4_50"
    border: int = 1
    tilt: float = float(np.deg2rad(60.0))
    motion: float = 0.0
    defocus: float = 0.0
    light: float = 1.0
    noise: float = 2.0
    hidden: float = 0.0
    gloss: bool = False


def render(
    condition: Condition, marker: int, rng: np.random.Generator, photographs: list[Path] | None
) -> Frame:
    """Render a frame.

    Args:
        condition: what the marker looks like.
        marker: its id.
        rng: of the pose, the background and the noise.
        photographs: backgrounds; made by code if None.
    """
    camera = condition.camera
    reflectance = _cells(condition, marker)
    pose, box = _random_pose(condition, len(reflectance), rng)
    radiance = _background(camera, rng, photographs) * rng.uniform(0.5, 1.0)
    _paint(radiance, camera, pose, box, reflectance, condition.border)
    if condition.hidden:
        _hide(radiance, camera, pose, condition.hidden, rng)
    radiance *= _illumination(camera, rng)
    if condition.gloss:
        _shine(radiance, camera, pose, rng)
    radiance = np.asarray(cv2.GaussianBlur(radiance, (0, 0), SENSOR_BLUR), np.float32)
    for kernel in _kernels(condition, rng):
        radiance = np.asarray(cv2.filter2D(radiance, -1, kernel), np.float32)
    grey = 255.0 * condition.light * radiance
    grey = grey + condition.noise * rng.standard_normal(grey.shape, dtype=np.float32)
    image = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
    return Frame(np.dstack([image] * 3), pose)


def _cells(condition: Condition, marker: int) -> Floats:
    """Reflectance of the black square's cells, with the border (n, n)."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, condition.dictionary))
    cells = dictionary.markerSize + 2 * condition.border
    image = cv2.aruco.generateImageMarker(dictionary, marker, cells, borderBits=condition.border)
    return np.where(image > 0, WHITE, BLACK)


def _random_pose(
    condition: Condition, cells: int, rng: np.random.Generator
) -> tuple[Floats, tuple[int, int, int, int]]:
    """Random pose (4, 4) with the plate inside the frame; box of the plate in it [px]."""
    camera = condition.camera
    half = SIDE * (0.5 + condition.border / cells)
    span = np.linspace(-half, half, 9)
    rim = [(x, y, 0.0) for x in span for y in span]
    while True:
        size = np.exp(rng.uniform(*np.log(condition.size)))
        ray = camera.rays(rng.uniform(0, [camera.width - 1, camera.height - 1]))
        azimuth, roll = rng.uniform(0, 2 * np.pi, 2)
        tilt = rng.uniform(0, condition.tilt)
        if not np.isfinite(ray).all():
            continue
        ray = ray / np.linalg.norm(ray)
        axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        level = np.diag([1.0, -1.0, -1.0]) @ _turn(roll * np.array([0, 0, 1.0]))
        pose = np.eye(4)
        pose[:3, :3] = towards(ray) @ _turn(tilt * axis) @ level
        pose[:3, 3] = ray * SIDE
        here = camera.project(np.array([pose[:3, 3], pose[:3, 3] + 1e-4 * SIDE * np.eye(3)[0]]))
        pose[:3, 3] *= np.linalg.norm(here[1] - here[0]) * 1e4 / size
        pixels = camera.project(rim @ pose[:3, :3].T + pose[:3, 3])
        low, high = pixels.min(axis=0) - 3, pixels.max(axis=0) + 4
        if (low >= 0).all() and (high < [camera.width, camera.height]).all():
            return pose, (int(low[0]), int(low[1]), int(high[0]), int(high[1]))


def _turn(vector: Floats) -> Floats:
    return np.asarray(cv2.Rodrigues(np.asarray(vector, dtype=float))[0])


def _paint(
    radiance: NDArray[np.float32],
    camera: Camera,
    pose: Floats,
    box: tuple[int, int, int, int],
    reflectance: Floats,
    border: int,
) -> None:
    """Paint the plate into a frame, in place: mean over rays of each pixel."""
    left, top, right, bottom = box
    part = (np.arange(RAYS) + 0.5) / RAYS - 0.5
    cells = len(reflectance)
    normal, origin = pose[:3, 2], pose[:3, 3]
    for row in range(top, bottom):
        y, x = np.broadcast_arrays(
            (row + part)[:, None, None], (np.arange(left, right)[:, None] + part)[None]
        )
        rays = camera.rays(np.stack([x, y], axis=-1))
        points = rays * (normal @ origin / (rays @ normal))[..., None] - origin
        u = (points @ pose[:3, 0] / SIDE + 0.5) * cells
        v = (0.5 - points @ pose[:3, 1] / SIDE) * cells
        on_plate = (np.abs(u - cells / 2) < cells / 2 + border) & (
            np.abs(v - cells / 2) < cells / 2 + border
        )
        i, j = np.floor(v).astype(int), np.floor(u).astype(int)
        on_square = (i >= 0) & (j >= 0) & (i < cells) & (j < cells)
        value = np.where(
            on_square, reflectance[np.clip(i, 0, cells - 1), np.clip(j, 0, cells - 1)], WHITE
        )
        behind = radiance[row, left:right][None, :, None]
        radiance[row, left:right] = np.where(on_plate, value, behind).mean(axis=(0, 2))


def _hide(
    radiance: NDArray[np.float32],
    camera: Camera,
    pose: Floats,
    share: float,
    rng: np.random.Generator,
) -> None:
    """Put a fingertip over a random corner of the square, in place."""
    corner = SIDE / 2 * rng.choice([-1.0, 1.0], 2)
    circle = np.linspace(0, 2 * np.pi, 40)
    shift = 0.3 * share * np.sign(corner)
    rim = corner + SIDE * (shift + share * np.column_stack([np.cos(circle), np.sin(circle)]))
    points = np.column_stack([rim, np.zeros(len(rim))]) @ pose[:3, :3].T + pose[:3, 3]
    polygon = np.rint(16 * camera.project(points)).astype(np.int32)
    cv2.fillPoly(radiance, [polygon], SKIN * rng.uniform(0.4, 1.2), cv2.LINE_AA, 4)


def _shine(
    radiance: NDArray[np.float32], camera: Camera, pose: Floats, rng: np.random.Generator
) -> None:
    """Add a highlight over a part of the square, in place."""
    centre = camera.project(pose[:3, 3] + pose[:3, :2] @ (SIDE * rng.uniform(-0.5, 0.5, 2)))
    ends = camera.project(pose[:3, 3] + SIDE / 2 * np.array([pose[:3, 0], -pose[:3, 0]]))
    size = float(np.linalg.norm(ends[0] - ends[1]))
    y, x = np.mgrid[: camera.height, : camera.width].astype(np.float32)
    far = ((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / (0.1 * size) ** 2
    radiance += (1.0 * np.exp(-far / 2)).astype(np.float32)


def _illumination(camera: Camera, rng: np.random.Generator) -> NDArray[np.float32]:
    """A smooth light over the frame, from 0.75 to 1."""
    slope = cv2.resize(
        rng.uniform(0.75, 1.0, (2, 2)).astype(np.float32), (camera.width, camera.height)
    )
    return np.asarray(slope)


def _kernels(condition: Condition, rng: np.random.Generator) -> list[NDArray[np.float32]]:
    """Kernels of motion and defocus."""
    kernels = []
    for length, is_disc in ((condition.motion, False), (2 * condition.defocus, True)):
        if length:
            scale, half = 8, int(np.ceil(length / 2)) + 1
            fine = np.zeros(((2 * half + 1) * scale,) * 2, np.float32)
            middle = np.array(fine.shape) / 2 - 0.5
            angle = rng.uniform(0, np.pi)
            reach = scale * length / 2 * np.array([np.cos(angle), np.sin(angle)])
            if is_disc:
                cv2.circle(fine, (int(middle[0]), int(middle[1])), int(scale * length / 2), 1.0, -1)
            else:
                ends = [np.rint(middle + s * reach).astype(int).tolist() for s in (-1, 1)]
                cv2.line(fine, ends[0], ends[1], 1.0, scale)
            coarse = cv2.resize(
                fine, None, fx=1 / scale, fy=1 / scale, interpolation=cv2.INTER_AREA
            )
            # Exactly symmetric, so that the blur shifts nothing.
            coarse = coarse + coarse[::-1, ::-1]
            kernels.append(coarse / coarse.sum())
    return kernels


def _background(
    camera: Camera, rng: np.random.Generator, photographs: list[Path] | None
) -> NDArray[np.float32]:
    """Reflectances behind the marker (H, W): texture of all scales, and objects on it."""
    size = (camera.width, camera.height)
    if photographs:
        image = cv2.imread(
            str(rng.choice(np.array(photographs, dtype=object))), cv2.IMREAD_GRAYSCALE
        )
        if image is not None:
            photograph = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
            return np.asarray(photograph, np.float32) / np.float32(255)
    scene = np.full((480, 640), rng.uniform(0.3, 0.6), np.float32)
    for octave in range(1, 7):
        patch = rng.normal(0, 0.12 * 0.75**octave, (3 * 2**octave, 4 * 2**octave))
        scene += cv2.resize(patch.astype(np.float32), (640, 480), interpolation=cv2.INTER_CUBIC)
    for _ in range(25):
        box = cv2.boxPoints(
            (
                rng.uniform(0, [640, 480]).tolist(),
                rng.uniform(5, 160, 2).tolist(),
                float(rng.uniform(0, 90)),
            )
        )
        shade = float(rng.uniform(0.03, 0.95))
        thickness = int(rng.integers(1, 6)) if rng.uniform() < 0.4 else -1
        if thickness < 0:
            cv2.fillPoly(scene, [np.rint(box).astype(np.int32)], shade, cv2.LINE_AA)
        else:
            cv2.polylines(
                scene, [np.rint(box).astype(np.int32)], True, shade, thickness, cv2.LINE_AA
            )
    for _ in range(8):
        origin, text = rng.uniform(0, [600, 480]).astype(int).tolist(), str(rng.integers(1, 10**6))
        ink = np.zeros((480, 640), np.uint8)
        cv2.putText(ink, text, origin, 0, rng.uniform(0.4, 1.5), 255, 2)
        scene += ink.astype(np.float32) / 255 * (float(rng.uniform(0, 0.9)) - scene)
    scene += rng.normal(0, 0.02, scene.shape).astype(np.float32)
    return np.asarray(np.clip(cv2.resize(scene, size, interpolation=cv2.INTER_CUBIC), 0, 1))
