"""Servos: feedback of a wrong position reading, written into a model."""

from __future__ import annotations

import mujoco


def add_reading_error(
    spec: mujoco.MjSpec,
    actuator: str,
    offset: float,
    scale: float = 0.0,
    about: float = 0.0,
    speed: bool = True,
) -> None:
    """Let an affine actuator feed back ``position + offset + scale (position - about)``.

    Args:
        spec: edited in place.
        actuator: name of the actuator.
        offset, about: of the actuator's tendon or joint, before the gear [m or rad].
        scale: relative error.
        speed: whether the scale applies to the velocity as well, because the motor measures it with
            the same encoder.
    """
    element = spec.actuator(actuator)
    slope = element.biasprm[1]
    element.biasprm[0] += slope * element.gear[0] * (offset - scale * about)
    element.biasprm[1] += slope * scale
    if speed:
        element.biasprm[2] += element.biasprm[2] * scale
