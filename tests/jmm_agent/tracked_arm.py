"""A moving arm whose hand is measured by a tracker."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tests.jmm_agent.moving_arm import MovingArm

MOCAP = np.repeat([0.001, np.radians(0.5)], 3)
"""Noise of motion capture [m, rad]."""


class TrackedArm(MovingArm):
    """A moving arm whose hand is measured by a tracker after each step."""

    def __init__(
        self,
        *given: Any,
        tracked: str = "hand",
        relative_to: str | None = None,
        noise: np.ndarray = MOCAP,
        late: float = 0.1,
        disturb: Callable[[float, np.ndarray], np.ndarray] = lambda time, pose: pose,
        **options: Any,
    ) -> None:
        super().__init__(*given, **options)
        self._tracked, self._noise, self._late = (tracked, relative_to), noise, late
        self._disturb = disturb

    def pose(self, time: float) -> np.ndarray:
        """The tracker's pose of a time [s]."""
        tracked, relative_to = self._tracked
        reference = None if relative_to == "world" else relative_to
        pose = self.kinematics.pose(tracked, self.q_at(time), reference)
        noise = self.rng.normal(0, np.where(np.isfinite(self._noise), self._noise, 0.0))
        pose[:3, 3] += noise[:3]
        pose[:3, :3] = Rotation.from_rotvec(noise[3:]).as_matrix() @ pose[:3, :3]
        return self._disturb(time, pose)

    def step(self, q: np.ndarray, **more: Any) -> None:
        super().step(q, **more)
        time = self.time - self._late
        if time >= 0.0:
            self.agent.observe(self.pose(time), np.diag(self._noise**2), time, *self._tracked)
