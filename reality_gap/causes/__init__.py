"""The catalogue of causes: one file a mechanism.

To add one's own, write a `Cause` and `register` it before diagnosing.
"""

from __future__ import annotations

from reality_gap.causes import (
    actuator_lag,
    attachment_shift,
    backlash,
    camera_focal,
    camera_mounting,
    centre_of_mass,
    coulomb_friction,
    delay,
    direction_dependent_friction,
    external_force,
    force_offset,
    force_scale,
    gravity_direction,
    joint_offset,
    joint_stiffness,
    length_offset,
    length_scale,
    link_mass,
    load_dependent_friction,
    marker_offset,
    missing_wrapping,
    payload,
    slack,
    tendon_elasticity,
    tension_offset,
    tension_scale,
    viscous_friction,
    wire_elongation,
)
from reality_gap.causes.base import Cause
from reality_gap.errors import StudyError, UnknownNameError

_MODULES = (
    tendon_elasticity,
    wire_elongation,
    coulomb_friction,
    viscous_friction,
    load_dependent_friction,
    direction_dependent_friction,
    backlash,
    slack,
    actuator_lag,
    force_scale,
    force_offset,
    attachment_shift,
    missing_wrapping,
    link_mass,
    centre_of_mass,
    payload,
    joint_stiffness,
    joint_offset,
    gravity_direction,
    external_force,
    camera_mounting,
    camera_focal,
    marker_offset,
    length_scale,
    length_offset,
    tension_scale,
    tension_offset,
    delay,
)

CATALOGUE: dict[str, Cause] = {module.CAUSE.id: module.CAUSE for module in _MODULES}
"""Every cause by its id. The order is that in which they are built into a machine: what changes
readings last, and a delay after all."""


def register(cause: Cause) -> Cause:
    """Add one's own cause to the catalogue; `StudyError` if its id is taken."""
    if cause.id in CATALOGUE:
        raise StudyError(f"there is a cause {cause.id!r} already; register yours by another id")
    CATALOGUE[cause.id] = cause
    return cause


def cause(id: str) -> Cause:
    """The cause of an id; `UnknownNameError` names the known ones."""
    if id not in CATALOGUE:
        raise UnknownNameError("cause", id, CATALOGUE)
    return CATALOGUE[id]
