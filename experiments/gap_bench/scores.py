"""What a trial of the diagnosis is worth: right cause, right place, right numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import permutations
from typing import Any

import numpy as np

from hidden_plants.machine import Machine, load
from kengoro_env.assets import asset_path

ASSETS = asset_path("mjcf/kengoro_arm/elbow.xml").parent
NOTHING, UNEXPLAINED = "nothing", "unexplained"
SAMPLE = 0.02
"""Period of the logs [s]."""
SHARED = 0.5
"""Places are the same if they share at least this part of what either of them names."""
AMBIGUOUS = 0.1
"""Entropy of confidences above which an experiment is worth doing [nats]: about 98 % to 2 %."""

Trial = Mapping[str, Any]


def said(trial: Trial) -> str:
    """The first name, or `NOTHING`, or `UNEXPLAINED`."""
    if trial["verdict"] == "nothing_wrong":
        return NOTHING
    return str(trial["causes"][0]["cause"]) if trial["causes"] else UNEXPLAINED


def truth(trial: Trial) -> str:
    """The id of the only effect."""
    return str(trial["truth"][0]["cause"])


def right_first(trial: Trial) -> bool:
    """Whether a single's cause is named first."""
    return said(trial) == truth(trial)


def right_or_equivalent(trial: Trial) -> bool:
    """Whether a single's cause is named first, or declared equivalent to what is."""
    return bool(trial["causes"]) and truth(trial) in _names(trial["causes"][0])


def _names(cause: Mapping[str, Any]) -> set[str]:
    return {cause["cause"], *cause["equivalent"]}


def exact_set(trial: Trial, equivalents: bool = False) -> bool:
    """Whether as many causes are named as there are, and each is one (or equivalent to one)."""
    true = [effect["cause"] for effect in trial["truth"]]
    named = [_names(c) if equivalents else {c["cause"]} for c in trial["causes"]]
    if len(named) != len(true):
        return False
    return any(all(map(set.__contains__, order, true)) for order in permutations(named))


def right_location(trial: Trial, elsewhere: bool = False) -> bool | None:
    """Whether the first name is at the single's muscle, joint or sensor, whatever its cause.

    None for effects that are nowhere in particular, as the direction of gravity.

    Args:
        trial: of a single.
        elsewhere: other places count too where, as is said, the same cause would do the same.
    """
    effect = trial["truth"][0]
    if not effect["elements"]:
        return None
    if not trial["causes"]:
        return False
    first = trial["causes"][0]
    locations = [first["elements"], *(first["elsewhere"] if elsewhere else [])]
    return any(same_location(trial, effect["cause"], effect["elements"], p) for p in locations)


def same_location(trial: Trial, cause: str, one: Sequence[str], other: Sequence[str]) -> bool:
    """Whether two lists of elements are about the same muscles, joints, links or sensors."""
    machine = machine_of(trial)
    a, b = (locations_of(machine, cause, elements) for elements in (one, other))
    return len(a & b) >= SHARED * len(a | b)


def machine_of(trial: Trial) -> Machine:
    """The drawing of a trial's machine."""
    return load(trial["case"]["machine"], ASSETS)


def locations_of(machine: Machine, cause: str, elements: Sequence[str]) -> set[str]:
    """Sites and sensors of a wire stand for it, bodies for the link that they are welded into.

    A delay is one of commands or one of sensors: their names stay apart.
    """
    if cause == "delay":
        return set(elements)
    tendons, bodies = _tendons(machine), _links(machine)
    found = set()
    for name in elements:
        bare = name.removeprefix("length_").removeprefix("tension_")
        found |= tendons.get(bare, {bodies.get(name, name)})
    return found


@lru_cache(maxsize=4)
def _tendons(machine: Machine) -> dict[str, set[str]]:
    found = {tendon: {tendon} for tendon in machine.tendons}
    for tendon, path in zip(machine.tendons, machine.paths, strict=True):
        for site in path:
            found.setdefault(site, set()).add(tendon)
    return found


@lru_cache(maxsize=4)
def _links(machine: Machine) -> dict[str, str]:
    model = machine.model
    return {
        model.body(i).name: model.body(int(model.body_weldid[i])).name for i in range(model.nbody)
    }


def entropy(trial: Trial) -> float | None:
    """Of the rivals for the least certain place in the verdict [nats]; None where nobody is."""
    steps: dict[int, list[float]] = {}
    for step, _, _, _, confidence in trial["candidates"]:
        steps.setdefault(step, []).append(confidence)
    found = []
    for confidences in steps.values():
        shares = np.array([*confidences, max(0.0, 1.0 - sum(confidences))])
        shares = shares[shares > 0]
        found.append(float(-np.sum(shares * np.log(shares))))
    return max(found, default=None)


def parameter_error(trial: Trial) -> tuple[str, float] | None:
    """Family and error of a named single's number; None where there is none to compare.

    Mass: over the mass of the link with what it carries. Friction, stiffness: relative. Delay: in
    samples. Moved sites: RMS of a wire's length [mm]. All but the last two in %. Friction around a
    wire's bends is hidden as a share of the tension, which is the coefficient times the bend.
    """
    if not trial["causes"] or not right_first(trial) or right_location(trial) is False:
        return None
    id, true = truth(trial), trial["truth"][0]["parameters"]
    told = {name: value[0] for name, value in trial["causes"][0]["parameters"].items()}
    if id in ("link_mass", "payload"):
        whole = link_mass(trial) + true["mass"]
        return "mass", 100 * abs(told["mass"] - true["mass"]) / whole
    if id in ALIKE:
        family, one, other = ALIKE[id]
        size = told[other] * (trial["bend"] or 1.0)
        return family, 100 * abs(size / true[one] - 1)
    if id == "direction_dependent_friction":
        ways = (("forward", "force_out"), ("backward", "force_in"))
        gaps = sum(abs(told[a] - true[b]) for a, b in ways)
        return "friction", 100 * gaps / sum(true[b] for _, b in ways)
    if id == "tendon_elasticity":
        return "stiffness", 100 * abs(1 / (told["compliance"] * true["stiffness"]) - 1)
    if id == "delay":
        return "delay", abs(told["delay"] - true["delay"]) / SAMPLE
    if id == "attachment_shift" and trial["length_error"] is not None:
        return "moved sites", 1000 * trial["length_error"]
    return None


ALIKE = {
    "coulomb_friction": ("friction", "force", "friction"),
    "viscous_friction": ("friction", "coefficient", "damping"),
    "load_dependent_friction": ("friction", "share", "coefficient"),
    "joint_stiffness": ("stiffness", "stiffness", "stiffness"),
}
"""Family, the hidden parameter and the named one."""


def added_mass_error(trial: Trial) -> float | None:
    """Error of what was added to a link, over what was added [%]; None for other causes."""
    found = parameter_error(trial)
    if found is None or found[0] != "mass":
        return None
    return (
        found[1]
        * (link_mass(trial) + trial["truth"][0]["parameters"]["mass"])
        / (trial["truth"][0]["parameters"]["mass"])
    )


def link_mass(trial: Trial) -> float:
    """Drawn mass of the link that the single acts on [kg]."""
    model = machine_of(trial).model
    body = model.body(trial["truth"][0]["elements"][0]).id
    return float(model.body_mass[model.body_weldid == model.body_weldid[body]].sum())


LEAST_GAIN = 0.05
"""Gain of the true model below which a ratio would be one of two noises."""


def gain_ratio(trial: Trial) -> float | None:
    """Gain of the extended model over that of the true one; None where there is none to make."""
    true = (trial["true_model"] or {}).get("gain")
    if true is None or true < LEAST_GAIN or trial["gain"] is None:
        return None
    return float(trial["gain"] / true)
