"""Camera in the head: it exposes at its own rate, and its frames arrive with a delay."""

from __future__ import annotations

from collections import deque

import mujoco
import numpy as np

from kengoro_env.departures.camera import EYE
from kengoro_env.robot.body import INSTANT
from kengoro_env.robot.draft import FrameTimes
from kengoro_env.vision.rendering import Image, Painter

PERIOD = 0.2
"""Time between two exposures [s]."""

NO_ERRORS = FrameTimes()
"""Time stamps are the times of exposure."""


class HeadCamera:
    """Takes a frame every `PERIOD`, which is available ``delay`` later.

    The frame of a reset is available at once, because the robot stood still before.

    Sites are not rendered, because a robot has none: they would hide the marker. Tendons are drawn
    as straight lines through bodies, and so are left out unless asked for.

    Args:
        painter: renders the frames.
        delay: age of a frame when it becomes available [s].
        camera: name of the camera in the model.
        tendons: whether tendons are rendered.
        times: errors of the frames' time stamps.
    """

    def __init__(
        self,
        painter: Painter,
        delay: float,
        camera: str = EYE,
        tendons: bool = False,
        times: FrameTimes = NO_ERRORS,
    ) -> None:
        self._painter, self._delay, self._times = painter, delay, times
        self._name, self._tendons = camera, tendons
        self._coming: deque[tuple[float, float, Image]] = deque()
        self._newest: tuple[float, Image]
        self._exposures = 0

    def reset(self, data: mujoco.MjData) -> None:
        """Start the clock, and take the first frame."""
        self._coming.clear()
        self._random = np.random.default_rng(self._times.seed)
        now = float(data.time)
        self._newest = (self._stamp(now), self._draw(data))
        self._exposures = 1

    def update(self, data: mujoco.MjData) -> None:
        """Advance the clock to the simulated time; take a frame if it is due."""
        now = float(data.time)
        if now + INSTANT >= self._exposures * PERIOD:
            self._coming.append((now, self._stamp(now), self._draw(data)))
            self._exposures += 1
        while self._coming and now + INSTANT >= self._coming[0][0] + self._delay:
            self._newest = self._coming.popleft()[1:]

    def _stamp(self, now: float) -> float:
        """Time stamp of a frame that is exposed now [s]; never negative."""
        errors = self._times
        jitter = errors.jitter * float(np.clip(self._random.standard_normal(), -2.0, 2.0))
        return max((1.0 + errors.drift) * now + errors.offset + jitter, 0.0)

    def _draw(self, data: mujoco.MjData) -> Image:
        visible = mujoco.MjvOption()
        visible.sitegroup[:] = 0
        visible.flags[mujoco.mjtVisFlag.mjVIS_TENDON] = self._tendons
        return self._painter.draw(data, self._name, visible=visible)

    def close(self) -> None:
        """Free the GL context; the next frame opens another."""
        self._painter.close()

    def newest(self) -> tuple[float, Image]:
        """Time stamp [s] and a copy of the newest available frame (480, 640, 3)."""
        time, image = self._newest
        return time, image.copy()
