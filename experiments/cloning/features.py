"""What a cloned policy is given: a row for each period of the camera.

Without a history a row holds what is read now, the time, and where the can stands. A history adds
earlier readings, those of the start first: there every robot stands in the same posture, so that
its readings say how it departs from the drawing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from jmm_agent.types import Floats
from kengoro.demonstrations.episode import Episode, frame_stride
from kengoro_env.robot.control_period import CONTROL_PERIOD

STRIDE = frame_stride(CONTROL_PERIOD)
"""Control steps of a row."""
LAGS = (1, 2, 4, 8)
"""Earlier rows of the history, counted from the present one."""


def features(readings: Sequence[Floats], can: Floats, history: bool) -> Floats:
    """Input of a policy in the last of some rows, shape (D,).

    Args:
        readings: lengths [m] and tensions [N] of each row, shape (2 m,) each.
        can: horizontal position of the can's axis, shape (2,) [m].
        history: whether earlier readings are part of it.
    """
    now = len(readings) - 1
    parts = [readings[now], np.array([float(now)]), can]
    if history:
        parts += [readings[0], *(readings[max(0, now - lag)] for lag in LAGS)]
    return np.concatenate(parts)


def examples(episode: Episode, history: bool) -> tuple[Floats, NDArray[np.float32]]:
    """Inputs (K, D) and commands at the end of each row (K, m + 1) of a demonstration."""
    first = np.arange(0, len(episode), STRIDE)
    readings = list(np.hstack([episode.lengths, episode.tensions])[first])
    can = episode.can_pose[0, :2, 3]
    rows = [features(readings[: row + 1], can, history) for row in range(len(first))]
    after = np.append(first[1:], len(episode))
    return np.array(rows), episode.actions[after - 1]
