"""A can on a table, with balls and boxes about it, drawn through any lens by casting rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from jmm_agent.types import Floats, Ints
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.can_shape import CanShape

RED, TIN = (190.0, 32.0, 29.0), (190.0, 193.0, 196.0)
WOOD, WALL = (176.0, 142.0, 103.0), (205.0, 214.0, 224.0)
RAYS = 2
"""Rays along each side of a pixel."""
LAMP = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])


@dataclass(frozen=True)
class StandingCan:
    """A standing can: middle of its lower end (3,) [m]."""

    foot: tuple[float, float, float]
    shape: CanShape = field(default_factory=CanShape)
    colour: tuple[float, float, float] = RED


@dataclass(frozen=True)
class Ball:
    """A ball: middle (3,) and radius [m]."""

    middle: tuple[float, float, float]
    radius: float
    colour: tuple[float, float, float] = RED


@dataclass(frozen=True)
class Box:
    """A box along the axes of the world: its lowest and its highest corner (3,) [m]."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    colour: tuple[float, float, float] = RED


Item = StandingCan | Ball | Box


def view_from(eye: Sequence[float], point: Sequence[float], roll: float = 0.0) -> Floats:
    """Pose (4, 4) of a camera in the world that looks at a point, z of the world upwards."""
    forward = np.subtract(point, eye)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    pose = np.eye(4)
    turned = np.cos(roll) * right + np.sin(roll) * down
    pose[:3, :3] = np.column_stack([turned, np.cross(forward, turned), forward])
    pose[:3, 3] = eye
    return pose


def picture(camera: Camera, pose: Floats, items: Sequence[Item]) -> Floats:
    """Frame (H, W, 3) of a table at the height 0 with items on it, in floats [grey levels].

    Args:
        camera: that takes it.
        pose: of the camera in the world (4, 4).
        items: on the table.
    """
    part = (np.arange(RAYS) + 0.5) / RAYS - 0.5
    y = (np.arange(camera.height)[:, None] + part).ravel()
    x = (np.arange(camera.width)[:, None] + part).ravel()
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1)).reshape(-1, 3) @ pose[:3, :3].T
    eye, sizes = pose[:3, 3], np.linalg.norm(rays, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(rays[:, 2] < 0, -eye[2] / rays[:, 2], np.inf)
        colour = np.where(np.isfinite(distance)[:, None], WOOD, WALL)
        for item in items:
            cast = {StandingCan: _can, Ball: _ball, Box: _box}[type(item)]
            near = _near(item, eye, rays, sizes)
            there, shown = cast(item, eye, rays[near])  # type: ignore[operator]
            nearer = there < distance[near]
            colour[near[nearer]], distance[near[nearer]] = shown[nearer], there[nearer]
    shape = (camera.height, RAYS, camera.width, RAYS, 3)
    return np.asarray(colour.reshape(shape).mean(axis=(1, 3)))


def _near(item: Item, eye: Floats, rays: Floats, sizes: Floats) -> Ints:
    """Indices of the rays (k, 3) of some sizes (k,) that meet a sphere around an item."""
    if isinstance(item, Ball):
        middle, radius = np.array(item.middle), item.radius
    elif isinstance(item, Box):
        low, high = np.array(item.low), np.array(item.high)
        middle, radius = (low + high) / 2, float(np.linalg.norm(high - low) / 2)
    else:
        middle = np.add(item.foot, (0.0, 0.0, item.shape.height / 2))
        radius = float(np.hypot(item.shape.radius, item.shape.height / 2))
    away = middle - eye
    squared = away @ away - (1.001 * radius) ** 2
    if squared <= 0.0:
        return np.arange(len(rays))
    return np.flatnonzero(rays @ away > sizes * np.sqrt(squared))


def _can(item: StandingCan, eye: Floats, rays: Floats) -> tuple[Floats, Floats]:
    shape = item.shape
    start = eye - np.array(item.foot)
    a = (rays[..., :2] ** 2).sum(axis=-1)
    b = rays[..., :2] @ start[:2]
    c = start[:2] @ start[:2] - shape.radius**2
    side = (-b - np.sqrt(b**2 - a * c)) / a
    z = start[2] + side * rays[..., 2]
    hit = (z >= 0) & (z <= shape.height) & (side > 0)
    top = (shape.height - start[2]) / rays[..., 2]
    across = start[:2] + top[..., None] * rays[..., :2]
    on_top = (top > 0) & ((across**2).sum(axis=-1) <= shape.radius**2) & ~hit
    normal = (start[:2] + side[..., None] * rays[..., :2]) / shape.radius
    light = 0.45 + 0.55 * np.clip(normal @ LAMP[:2], 0, None)
    painted = (z >= shape.rim) & (z <= shape.height - shape.rim)
    colour = np.where(painted[..., None], item.colour, TIN) * light[..., None]
    colour = np.where(on_top[..., None], TIN, colour)
    return np.where(hit, side, np.where(on_top, top, np.inf)), colour


def _ball(item: Ball, eye: Floats, rays: Floats) -> tuple[Floats, Floats]:
    start = eye - np.array(item.middle)
    a = (rays**2).sum(axis=-1)
    b = rays @ start
    there = (-b - np.sqrt(b**2 - a * (start @ start - item.radius**2))) / a
    there = np.where(there > 0, there, np.inf)
    there = np.where(np.isfinite(there), there, np.inf)
    normal = (start + np.where(np.isfinite(there), there, 0.0)[..., None] * rays) / item.radius
    light = 0.45 + 0.55 * np.clip(normal @ LAMP, 0, None)
    return there, np.array(item.colour) * light[..., None]


def _box(item: Box, eye: Floats, rays: Floats) -> tuple[Floats, Floats]:
    ends = np.stack([(np.array(end) - eye) / rays for end in (item.low, item.high)])
    enter, leave = ends.min(axis=0), ends.max(axis=0).min(axis=-1)
    there = enter.max(axis=-1)
    light = np.array([0.65, 0.8, 1.0])[enter.argmax(axis=-1)]
    hit = (there <= leave) & (there > 0)
    return np.where(hit, there, np.inf), np.array(item.colour) * light[..., None]


def taken(frame: Floats, seed: int = 0, noise: float = 1.0, light: float = 1.0) -> np.ndarray:
    """The frame (H, W, 3) uint8 that a camera takes, with light and noise [grey levels]."""
    rng = np.random.default_rng(seed)
    seen = np.rint(light * frame + rng.normal(0, noise, frame.shape))
    return np.clip(seen, 0, 255).astype(np.uint8)
