"""What is hidden: effects, each with its elements, its parameters and one amplitude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

CATALOGUE = (
    "tendon_elasticity",
    "wire_elongation",
    "coulomb_friction",
    "viscous_friction",
    "load_dependent_friction",
    "direction_dependent_friction",
    "backlash",
    "slack",
    "actuator_lag",
    "delay",
    "force_scale",
    "attachment_shift",
    "missing_wrapping",
    "force_offset",
    "length_offset",
    "length_scale",
    "tension_offset",
    "tension_scale",
    "link_mass",
    "centre_of_mass",
    "payload",
    "joint_stiffness",
    "joint_offset",
    "gravity_direction",
    "external_force",
    "marker_offset",
    "camera_mounting",
    "camera_focal",
)
"""The causes that whoever diagnoses knows by name."""

OUTSIDE = (
    "cogging_torque",
    "cogging_motor",
    "tension_crosstalk",
    "length_crosstalk",
    "hard_stop",
    "catching_tendon",
    "cover_stiffness",
)
"""Effects that are in nobody's catalogue."""


@dataclass(frozen=True)
class Effect:
    """One hidden effect.

    Attributes:
        id: of `CATALOGUE` or `OUTSIDE`.
        elements: names of tendons, joints, sites, bodies or sensors, as in the model.
        parameters: in SI units; names and meaning stand with the mechanism of this id.
        amplitude: its size in the unit of its mechanism; 0 does nothing.
    """

    id: str
    elements: tuple[str, ...]
    parameters: Mapping[str, float]
    amplitude: float


@dataclass(frozen=True)
class Secret:
    """What is hidden in one machine.

    Attributes:
        effects: none, one or two.
        motion: which motion of the library the floors of its amplitudes belong to.
        kind: "single", "pair", "null" or "outside".
        redrawn: effects that were drawn first, but whose floor was too high to show them within
            what is physical.
    """

    effects: tuple[Effect, ...] = ()
    motion: int = 0
    kind: str = "null"
    redrawn: int = 0
