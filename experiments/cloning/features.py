"""What a cloned policy is given and what it commands: a row for each period of the camera.

Without a history a row holds what is read now, the time, and where the can stands. A history adds
the readings of the start, where every robot stands in the same posture: present lengths and
commanded ones then count from those of the start. This takes away what departs from the drawing in
the zero of each muscle's length, which is most of what separates robots.

The time is given by sines and cosines, too: from the time alone a network learns no fast changes.
It then takes its commands from the lengths, which follow those commands, and the arm is lost.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jmm_agent.types import Floats
from kengoro.demonstrations.episode import Episode, frame_stride
from kengoro_env.robot.control_period import CONTROL_PERIOD
from kengoro_env.spaces import length_bounds
from kengoro_env.tasks.can_grasp import CanGrasp

STRIDE = frame_stride(CONTROL_PERIOD)
"""Control steps of a row."""
DURATION = 70.0
"""Rows in half a period of the slowest sine; a grasp takes 65 to 67."""
HARMONICS = np.arange(1, 9)
"""Frequencies of sines and cosines, as multiples of the slowest."""
EXACT = 3 + 2 * len(HARMONICS)
"""Number of inputs at the end that are no readings: time and can."""


def features(readings: Sequence[Floats], can: Floats, history: bool) -> Floats:
    """Input of a policy in the last of some rows, shape (D,).

    Args:
        readings: lengths [m] and tensions [N] of each row, shape (2 m,) each.
        can: horizontal position of the can's axis, shape (2,) [m].
        history: whether the readings of the start are part of it.
    """
    now = len(readings) - 1
    angles = np.pi * now / DURATION * HARMONICS
    exact = [np.array([float(now)]), can, np.sin(angles), np.cos(angles)]
    read = [readings[-1] - readings[0], readings[0]] if history else [readings[-1]]
    return np.concatenate([*read, *exact])


def origin(lengths: Floats, history: bool) -> Floats:
    """Command (m + 1,) from which those of a policy count.

    Args:
        lengths: readings at the start, shape (m,) [m].
        history: whether they are part of the input; without it commands count from zero.
    """
    if not history:
        return np.zeros(len(lengths) + 1)
    action = length_bounds(CanGrasp.scene).to_action(lengths)
    return np.append(action, 0.0).astype(float)


def examples(episode: Episode, history: bool, can: Floats | None = None) -> tuple[Floats, Floats]:
    """Inputs (K, D) and commands at the end of each row (K, m + 1) of a demonstration.

    Commands count from `origin`.

    Args:
        episode: the demonstration.
        history: whether inputs hold the readings of the start.
        can: horizontal position of the can, shape (2,) [m]; None: the true one.
    """
    first = np.arange(0, len(episode), STRIDE)
    readings = list(np.hstack([episode.lengths, episode.tensions])[first])
    can = episode.can_pose[0, :2, 3] if can is None else can
    rows = [features(readings[: row + 1], can, history) for row in range(len(first))]
    after = np.append(first[1:], len(episode))
    return np.array(rows), episode.actions[after - 1] - origin(episode.lengths[0], history)
