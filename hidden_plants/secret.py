"""Records of what is hidden in a machine, and the ids of all effects."""

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
"""Effects that the diagnosis knows by name."""

OUTSIDE = (
    "cogging_torque",
    "cogging_motor",
    "tension_crosstalk",
    "length_crosstalk",
    "hard_stop",
    "catching_tendon",
    "cover_stiffness",
)
"""Effects outside of the diagnosis's catalogue."""


@dataclass(frozen=True)
class Effect:
    """One hidden effect.

    Attributes:
        id: of `CATALOGUE` or `OUTSIDE`.
        elements: names of tendons, joints, sites, bodies or sensors, as in the model.
        parameters: in SI units; the module of the mechanism documents names and meaning.
        amplitude: size of the effect in the unit of its mechanism; 0 has no effect.
    """

    id: str
    elements: tuple[str, ...]
    parameters: Mapping[str, float]
    amplitude: float


@dataclass(frozen=True)
class Secret:
    """All effects hidden in one machine.

    Attributes:
        effects: none, one or two.
        motion: index of the motion in the library that the machine performs.
        kind: "single", "pair", "null" or "outside".
        resampled: number of effects that were sampled and rejected, because no physical amplitude
            is detectable in this motion.
    """

    effects: tuple[Effect, ...] = ()
    motion: int = 0
    kind: str = "null"
    resampled: int = 0
