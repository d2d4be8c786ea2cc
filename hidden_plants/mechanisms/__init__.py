"""Mechanisms of all effects by their ids."""

from __future__ import annotations

from hidden_plants.machine import Machine
from hidden_plants.mechanisms import camera, drive, friction, load, outside, path, sensing, tendon
from hidden_plants.mechanisms.mechanism import Mechanism, Structure
from hidden_plants.secret import Effect

MECHANISMS: dict[str, Mechanism] = {
    mechanism.id: mechanism
    for module in (friction, tendon, drive, path, sensing, load, camera, outside)
    for mechanism in module.MECHANISMS
}


def mechanism_of(effect: Effect | Structure) -> Mechanism:
    """Return the mechanism of an effect.

    Raises:
        ValueError: the id is unknown.
    """
    if effect.id not in MECHANISMS:
        raise ValueError(f"unknown effect {effect.id!r}; valid are: {', '.join(MECHANISMS)}")
    return MECHANISMS[effect.id]


def resized(effect: Effect, amplitude: float) -> Effect:
    """Return the same effect at another amplitude."""
    parameters = mechanism_of(effect).parameters(effect.parameters, amplitude)
    return Effect(effect.id, effect.elements, parameters, amplitude)


SHOWN_TENDONS = (
    "scm_left",
    "splenius_right",
    "trap_sup",
    "serr_inf",
    "pec_minor",
    "delt_ant",
    "delt_post",
    "pec_major",
    "biceps",
    "triceps",
    "ecr",
    "supinator",
)
SHOWN_JOINTS = ("neck_pitch", "sc_yaw", "sh_pitch", "sh_roll", "elbow", "wrist_flex")
"""Elements of the arm that effects act on: only some, as each detection limit takes minutes."""


def structures(machine: Machine, id: str) -> list[Structure]:
    """List where and in which shapes an effect may act on a machine.

    On the arm only `SHOWN_TENDONS` and `SHOWN_JOINTS` are used, each with one of the shapes.
    """
    all_structures = MECHANISMS[id].structures(machine)
    if machine.name == "elbow":
        return all_structures
    unused = set(machine.tendons).difference(SHOWN_TENDONS)
    unused |= set(machine.joints).difference(SHOWN_JOINTS)
    for name, sites in zip(machine.tendons, machine.paths, strict=True):
        if name not in SHOWN_TENDONS:
            unused.update(sites)
    by_elements: dict[tuple[str, ...], list[Structure]] = {}
    for structure in all_structures:
        by_elements.setdefault(structure.elements, []).append(structure)
    if len(by_elements) == 1:
        return all_structures
    return [
        shapes[k % len(shapes)]
        for k, (elements, shapes) in enumerate(by_elements.items())
        if len(elements) > 2 or not any(_in(name, unused) for name in elements)
    ]


def _in(name: str, unused: set[str]) -> bool:
    """Whether an element, or the tendon that a sensor measures, is among ``unused``."""
    return name in unused or name.removeprefix("length_").removeprefix("tension_") in unused
