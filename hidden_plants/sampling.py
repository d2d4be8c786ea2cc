"""Random choice of the hidden effects and their amplitudes."""

from __future__ import annotations

import numpy as np

from hidden_plants.detection_limits import Row, rows
from hidden_plants.mechanisms import mechanism_of
from hidden_plants.motion import MOTIONS
from hidden_plants.secret import CATALOGUE, OUTSIDE, Effect, Secret

KINDS = ("single", "pair", "null", "outside")
ONLY_ON_ARM = (
    "payload",
    "centre_of_mass",
    "gravity_direction",
    "marker_offset",
    "camera_mounting",
    "camera_focal",
)
"""Effects that the elbow does not show, or that equal another effect there.

They are sampled for the elbow only if the family is their id.
"""
FAMILIES: dict[str, tuple[str, ...]] = {
    "friction": (
        "coulomb_friction",
        "viscous_friction",
        "load_dependent_friction",
        "direction_dependent_friction",
    ),
    "tendon": ("tendon_elasticity", "wire_elongation", "backlash", "slack"),
    "drive": ("actuator_lag", "delay", "force_scale", "force_offset"),
    "path": ("attachment_shift", "missing_wrapping"),
    "sensing": ("length_offset", "length_scale", "tension_offset", "tension_scale", "joint_offset"),
    "load": ("link_mass", "centre_of_mass", "payload", "gravity_direction"),
    "joint": ("joint_stiffness", "external_force"),
    "camera": ("marker_offset", "camera_mounting", "camera_focal"),
    "outside": OUTSIDE,
}
LOWEST, HIGHEST = 2.0, 8.0
"""Bounds of the sampled amplitudes, as multiples of the detection limit."""


def sample_secret(
    rng: np.random.Generator, kind: str, machine: str = "elbow", family: str | None = None
) -> Secret:
    """Sample hidden effects and the motion that the machine performs.

    The id is uniform, then the elements and shape are, then the amplitude is log-uniform between 2
    and 8 times the detection limit and at most the largest physical amplitude. An effect is
    rejected and sampled again if twice its detection limit is not physical in this motion.

    Args:
        rng: random numbers.
        kind: "single", "pair" (two different ids), "null" or "outside".
        machine: "elbow" or "arm".
        family: an id, or a name of `FAMILIES`, that the first effect is sampled from.

    Raises:
        ValueError: the kind or family is unknown, or the machine shows no effect of the family.
    """
    if kind not in KINDS:
        raise ValueError(f"unknown kind {kind!r}; valid are: {', '.join(KINDS)}")
    motion = int(rng.integers(MOTIONS[machine]))
    if kind == "null":
        return Secret((), motion, kind)
    first, rejected = _effect(rng, machine, motion, _ids(kind, machine, family))
    if kind != "pair":
        return Secret((first,), motion, kind, rejected)
    others = tuple(id for id in _ids(kind, machine, None) if id != first.id)
    second, rejected_too = _effect(rng, machine, motion, others)
    return Secret((first, second), motion, kind, rejected + rejected_too)


def _ids(kind: str, machine: str, family: str | None) -> tuple[str, ...]:
    if family is not None and family in (*CATALOGUE, *OUTSIDE):
        return (family,)
    if family is not None and family not in FAMILIES:
        raise ValueError(
            f"unknown family {family!r}; valid are: {', '.join(FAMILIES)}, and every id"
        )
    ids: tuple[str, ...] = OUTSIDE if kind == "outside" else CATALOGUE
    if family is not None:
        ids = FAMILIES[family]
    return tuple(id for id in ids if machine == "arm" or id not in ONLY_ON_ARM)


def _effect(
    rng: np.random.Generator, machine: str, motion: int, ids: tuple[str, ...]
) -> tuple[Effect, int]:
    """An effect of one of the ids, and how many were rejected before it."""
    table = rows(machine)
    known = [id for id in ids if any(row.structure.id == id for row in table)]
    for rejected in range(200 if known else 0):
        id = str(rng.choice(known))
        choices = [row for row in table if row.structure.id == id]
        effect = _sized(rng, choices[int(rng.integers(len(choices)))], motion)
        if effect is not None:
            return effect, rejected
    raise ValueError(
        f"the {machine} cannot show {', '.join(ids)} in motion {motion}; "
        "a new effect needs `python -m hidden_plants detection-limits`"
    )


def _sized(rng: np.random.Generator, row: Row, motion: int) -> Effect | None:
    """The structure at a random amplitude; none if no amplitude is detectable and physical."""
    mechanism, limit = mechanism_of(row.structure), row.detection_limits[motion]
    shape = row.structure.shape
    low = max(LOWEST * limit, shape.get("least", 0.0))
    high = max(HIGHEST * limit, 1.5 * shape.get("least", 0.0))
    high = min(high, mechanism.bound, shape.get("most", np.inf))
    if not low <= high:
        return None
    amplitude = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return mechanism.effect(row.structure, amplitude)
