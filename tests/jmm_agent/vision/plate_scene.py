"""A marker plate on a grey ground, rendered through any lens by casting rays."""

from __future__ import annotations

import cv2
import numpy as np

from jmm_agent.vision.camera import Camera

SIDE = 0.05
"""Side of the black square [m]."""
BLACK, WHITE, GROUND = 20.0, 215.0, 120.0
RAYS = 3
"""Rays along each side of a pixel."""


def plate_pose(camera: Camera, rng: np.random.Generator, size_px: float) -> np.ndarray:
    """Pose (4, 4) of a marker of about this side [px] that lies wholly in the frame."""
    rim = np.array([(x, y, 0.0) for x in (-1, 1) for y in (-1, 1)]) * SIDE * 0.7
    while True:
        ray = camera.rays(rng.uniform(0, [camera.width - 1, camera.height - 1]))
        tilt = rng.uniform(0, 0.9) * np.array([*(s := rng.normal(size=2)) / np.hypot(*s), 0.0])
        turn = cv2.Rodrigues(tilt)[0] @ np.diag([1.0, -1.0, -1.0])
        pose = np.eye(4)
        pose[:3, :3] = turn @ cv2.Rodrigues(np.array([0, 0, rng.uniform(0, 6.28)]))[0]
        pose[:3, 3] = ray * camera.fx * SIDE / size_px
        pixels = camera.project(rim @ pose[:3, :3].T + pose[:3, 3])
        inside = (pixels > 3) & (pixels < [camera.width - 4, camera.height - 4])
        if inside.all() and -pose[:3, 2] @ ray > 0.5 * np.linalg.norm(ray):
            return pose


def paint(
    frame: np.ndarray,
    camera: Camera,
    pose: np.ndarray,
    marker: int = 0,
    dictionary: str = "DICT_4X4_50",
    border: int = 1,
) -> None:
    """Paint a plate into a grey frame (H, W) of floats, in place."""
    book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    cells = book.markerSize + 2 * border
    image = cv2.aruco.generateImageMarker(book, marker, cells, borderBits=border)
    colours = np.pad(np.where(image > 0, WHITE, BLACK), border, constant_values=WHITE)
    half = SIDE / 2 * len(colours) / cells
    span = np.linspace(-half, half, 7)
    rim = np.array([(x, y, 0.0) for x in span for y in span])
    pixels = camera.project(rim @ pose[:3, :3].T + pose[:3, 3])
    left, top = np.maximum(np.floor(pixels.min(axis=0)).astype(int) - 1, 0)
    right, bottom = np.ceil(pixels.max(axis=0)).astype(int) + 2
    box = frame[top:bottom, left:right]
    part = (np.arange(RAYS) + 0.5) / RAYS - 0.5
    y = (top + np.arange(box.shape[0])[:, None] + part).ravel()
    x = (left + np.arange(box.shape[1])[:, None] + part).ravel()
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1))
    points = rays * (pose[:3, 2] @ pose[:3, 3] / (rays @ pose[:3, 2]))[..., None] - pose[:3, 3]
    column = np.floor((points @ pose[:3, 0] + half) / (2 * half) * len(colours)).astype(int)
    row = np.floor((half - points @ pose[:3, 1]) / (2 * half) * len(colours)).astype(int)
    last = len(colours) - 1
    inside = (column >= 0) & (column <= last) & (row >= 0) & (row <= last)
    ground = np.repeat(np.repeat(box, RAYS, axis=0), RAYS, axis=1)
    fine = np.where(inside, colours[np.clip(row, 0, last), np.clip(column, 0, last)], ground)
    box[:] = fine.reshape(box.shape[0], RAYS, box.shape[1], RAYS).mean(axis=(1, 3))


def ground(camera: Camera) -> np.ndarray:
    """An empty grey frame (H, W)."""
    return np.full((camera.height, camera.width), GROUND)


def taken(
    frame: np.ndarray, rng: np.random.Generator, noise: float = 1.0, light: float = 1.0
) -> np.ndarray:
    """The frame (H, W, 3) uint8 that a camera takes of a grey one, with blur, light and noise."""
    blurred = cv2.GaussianBlur(frame, (0, 0), 0.5)
    seen = np.rint(light * blurred + rng.normal(0, noise, frame.shape))
    return np.dstack([np.clip(seen, 0, 255).astype(np.uint8)] * 3)
