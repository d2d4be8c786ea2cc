"""Draws what is hidden."""

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
"""What an elbow does not show, or cannot tell from another cause; drawn there only by name."""
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
"""Amplitudes are drawn between these multiples of the detection floor."""


def draw(
    rng: np.random.Generator, kind: str, machine: str = "elbow", family: str | None = None
) -> Secret:
    """Draw a secret and the motion it is hidden in.

    The id is uniform, then the place and shape, then the amplitude, log-uniform between 2 and 8
    times the detection floor and no larger than is physical. An effect whose doubled floor is not
    physical in this motion is drawn anew, and counted.

    Args:
        rng: random numbers.
        kind: "single", "pair" (two different ids), "null" or "outside".
        machine: "elbow" or "arm".
        family: an id or a name of `FAMILIES` that the (first) effect is drawn from.
    """
    if kind not in KINDS:
        raise ValueError(f"no kind {kind!r}; there are: {', '.join(KINDS)}")
    motion = int(rng.integers(MOTIONS[machine]))
    if kind == "null":
        return Secret((), motion, kind)
    first, redrawn = _effect(rng, machine, motion, _ids(kind, machine, family))
    if kind != "pair":
        return Secret((first,), motion, kind, redrawn)
    others = tuple(id for id in _ids(kind, machine, None) if id != first.id)
    second, again = _effect(rng, machine, motion, others)
    return Secret((first, second), motion, kind, redrawn + again)


def _ids(kind: str, machine: str, family: str | None) -> tuple[str, ...]:
    if family is not None and family in (*CATALOGUE, *OUTSIDE):
        return (family,)
    if family is not None and family not in FAMILIES:
        raise ValueError(f"no family {family!r}; there are: {', '.join(FAMILIES)}, and every id")
    ids: tuple[str, ...] = OUTSIDE if kind == "outside" else CATALOGUE
    if family is not None:
        ids = FAMILIES[family]
    return tuple(id for id in ids if machine == "arm" or id not in ONLY_ON_ARM)


def _effect(
    rng: np.random.Generator, machine: str, motion: int, ids: tuple[str, ...]
) -> tuple[Effect, int]:
    table = rows(machine)
    known = [id for id in ids if any(row.structure.id == id for row in table)]
    for redrawn in range(200 if known else 0):
        id = str(rng.choice(known))
        places = [row for row in table if row.structure.id == id]
        effect = _sized(rng, places[int(rng.integers(len(places)))], motion)
        if effect is not None:
            return effect, redrawn
    raise ValueError(f"the {machine} cannot show {', '.join(ids)} in motion {motion}")


def _sized(rng: np.random.Generator, row: Row, motion: int) -> Effect | None:
    mechanism, floor = mechanism_of(row.structure), row.detection_limits[motion]
    shape = row.structure.shape
    low = max(LOWEST * floor, shape.get("least", 0.0))
    high = max(HIGHEST * floor, 1.5 * shape.get("least", 0.0))
    high = min(high, mechanism.bound, shape.get("most", np.inf))
    if not low <= high:
        return None
    amplitude = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return mechanism.effect(row.structure, amplitude)
