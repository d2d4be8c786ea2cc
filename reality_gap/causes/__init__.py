"""Catalogue of causes: one file for each mechanism.

To add a cause to this package, write a file whose name is the cause's id and which defines
``CAUSE``, and insert the id into `MODULES`. The module docstring of `reality_gap.causes.base` has
an example. To add a cause of your own without editing this package, call `register_cause` before
the diagnosis.
"""

from __future__ import annotations

from importlib import import_module

from reality_gap.causes.base import Cause
from reality_gap.errors import StudyError, UnknownNameError

MODULES = (
    "tendon_elasticity",
    "wire_elongation",
    "coulomb_friction",
    "viscous_friction",
    "load_dependent_friction",
    "direction_dependent_friction",
    "stribeck_friction",
    "gear_friction",
    "backlash",
    "slack",
    "motor_side_friction",
    "actuator_lag",
    "position_gain",
    "velocity_gain",
    "command_gain",
    "gear_ratio",
    "velocity_feedforward",
    "force_scale",
    "force_offset",
    "force_limit",
    "torque_speed_curve",
    "speed_limit",
    "dead_zone",
    "gravity_compensation",
    "attachment_shift",
    "missing_wrapping",
    "link_mass",
    "centre_of_mass",
    "payload",
    "armature",
    "joint_stiffness",
    "joint_elasticity",
    "coupling_ratio",
    "joint_coupling",
    "motor_coupling",
    "joint_offset",
    "encoder_scale",
    "gravity_direction",
    "external_force",
    "camera_mounting",
    "camera_focal",
    "marker_offset",
    "length_scale",
    "length_offset",
    "tension_scale",
    "tension_offset",
    "effort_scale",
    "effort_offset",
    "delay",
    "clock_drift",
)
"""Files of the catalogue, in the order in which causes are built into a machine: those that act on
readings only come last, and a delay after all others."""


def _load(module: str) -> Cause:
    found: Cause = import_module(f"{__name__}.{module}").CAUSE
    return found


CATALOGUE: dict[str, Cause] = {cause.id: cause for cause in map(_load, MODULES)}
"""All causes by id, in the order of `MODULES`; registered causes come last."""


def register_cause(cause: Cause) -> Cause:
    """Add a cause to the catalogue.

    Args:
        cause: the new cause; diagnoses of this process consider it from now on.

    Returns:
        ``cause``.

    Raises:
        StudyError: the catalogue already has a cause of this id.
    """
    if cause.id in CATALOGUE:
        raise StudyError(f"there is already a cause {cause.id!r}; choose another id")
    CATALOGUE[cause.id] = cause
    return cause


def find_cause(id: str) -> Cause:
    """Return the cause of an id.

    Args:
        id: for example "coulomb_friction".

    Raises:
        UnknownNameError: the catalogue has no such cause.
    """
    if id not in CATALOGUE:
        raise UnknownNameError("cause", id, CATALOGUE)
    return CATALOGUE[id]
