"""Readings of a driver that were lost on their way, or arrived broken."""

from __future__ import annotations

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.observation import SensorReadings
from jmm_agent.types import Floats


def why_lost(readings: object, gaps: bool) -> str:
    """Why readings count as lost; empty if they can be used.

    Args:
        readings: what `Driver.read` has returned.
        gaps: whether lengths and tensions may be not finite, but for one length.

    Raises:
        AgentError: the driver has returned something else than readings, or no numbers.
    """
    if readings is None:
        return "no readings came"
    if not isinstance(readings, SensorReadings):
        raise AgentError(
            f"Driver.read returned an object of type {type(readings).__name__}; it must return "
            "SensorReadings, or None if no readings came."
        )
    time = np.asarray(readings.time)
    if time.ndim or time.dtype.kind not in "iuf":
        raise AgentError(
            f"Driver.read returned readings with the time {readings.time!r}; it must be a number "
            "in seconds."
        )
    if not np.isfinite(time):
        return "their time is not finite"
    finite = np.isfinite(_floats("lengths", readings.lengths))
    if not finite.any():
        return "no length is finite"
    tensions = _floats("tensions", readings.tensions)
    if gaps:
        return ""
    if not finite.all():
        return "a length is not finite (without a guard all must be)"
    if not np.isfinite(tensions).all():
        return "a tension is not finite (without a guard all must be)"
    return ""


def _floats(name: str, values: object) -> Floats:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise AgentError(
            f"Driver.read returned readings with {name} that are no numbers ({error})."
        ) from error
