"""The mechanisms of all effects, by their ids."""

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
    """The mechanism of an effect."""
    if effect.id not in MECHANISMS:
        raise ValueError(f"no effect {effect.id!r}; there are: {', '.join(MECHANISMS)}")
    return MECHANISMS[effect.id]


def resized(effect: Effect, amplitude: float) -> Effect:
    """The same effect at another amplitude."""
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
"""Where effects are hidden in the whole arm: each of its floors takes minutes."""


def structures(machine: Machine, id: str) -> list[Structure]:
    """Where an effect may act on a machine; on the arm, some wires and joints, one shape each."""
    every = MECHANISMS[id].structures(machine)
    if machine.name == "elbow":
        return every
    hidden = set(machine.tendons).difference(SHOWN_TENDONS)
    hidden |= set(machine.joints).difference(SHOWN_JOINTS)
    shown = set(SHOWN_TENDONS)
    hidden_sites = {
        site
        for tendon, path in zip(machine.tendons, machine.paths, strict=True)
        for site in path
        if tendon not in shown
    }
    by_place: dict[tuple[str, ...], list[Structure]] = {}
    for structure in every:
        by_place.setdefault(structure.elements, []).append(structure)
    if len(by_place) == 1:
        return every
    return [
        shapes[k % len(shapes)]
        for k, (place, shapes) in enumerate(by_place.items())
        if len(place) > 2 or not any(_inside(name, hidden | hidden_sites) for name in place)
    ]


def _inside(name: str, hidden: set[str]) -> bool:
    """Whether an element, or the wire that a sensor reads, is hidden."""
    return name in hidden or name.removeprefix("length_").removeprefix("tension_") in hidden
