"""Quaternions: normalises measured quaternions and makes them continuous in time."""

from __future__ import annotations

import numpy as np

from reality_gap.errors import StudyError
from reality_gap.study.data import Reading

NORM_TOLERANCE = 0.05
"""Largest deviation of a quaternion's norm from 1."""


def continuous(sensor: str, parts: list[Reading]) -> list[Reading]:
    """Normalise the quaternions of a sensor and choose their signs.

    q and -q are the same orientation. The first quaternion gets w >= 0, and each following one
    the sign that is nearer to its predecessor.

    Args:
        sensor: name of the sensor, for messages.
        parts: readings of the components w, x, y, z.

    Returns:
        Readings of the four components.

    Raises:
        StudyError: a row has only a part of a quaternion, or its norm is not 1.
    """
    time = parts[0].time
    if any(not np.array_equal(part.time, time) for part in parts):
        raise StudyError(
            f"sensor {sensor} measures quaternions, but some rows have only a part of one; fill "
            "all four cells of a row or none"
        )
    if not len(time):
        return parts
    value = np.stack([part.value for part in parts], axis=1)
    norm = np.linalg.norm(value, axis=1)
    wrong = np.flatnonzero(np.abs(norm - 1.0) > NORM_TOLERANCE)
    if len(wrong):
        raise StudyError(
            f"sensor {sensor} measures quaternions, but {time[wrong[0]]:.6g} s after the first "
            f"command the norm is {norm[wrong[0]]:.3g}; it must be 1, in the order w, x, y, z"
        )
    value /= norm[:, None]
    turned = np.where(np.sum(value[1:] * value[:-1], axis=1) < 0.0, -1.0, 1.0)
    begin = -1.0 if value[0, 0] < 0.0 else 1.0
    value *= (begin * np.concatenate([[1.0], np.cumprod(turned)]))[:, None]
    return [Reading(time, value[:, i].copy()) for i in range(4)]
