"""Servos that feed back a position that is read wrongly."""

from __future__ import annotations

import mujoco


def misread(
    spec: mujoco.MjSpec, actuator: str, offset: float, scale: float = 0.0, about: float = 0.0
) -> None:
    """Let an affine actuator see ``position + offset + scale (position - about)``.

    Args:
        spec: edited in place.
        actuator: name.
        offset, about: of what the actuator acts on [m or rad], before its gear.
        scale: also of the velocity, which a motor takes from the same encoder.
    """
    element = spec.actuator(actuator)
    slope = element.biasprm[1]
    element.biasprm[0] += slope * element.gear[0] * (offset - scale * about)
    element.biasprm[1] += slope * scale
    element.biasprm[2] += element.biasprm[2] * scale
