"""Scores of a diagnosis trial: right cause, right location, parameter errors."""

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
"""Least share of common elements among all elements of two locations that count as the same."""
AMBIGUOUS = 0.1
"""Entropy of confidences above which an experiment is worthwhile [nats]: about 98 % to 2 %."""

Trial = Mapping[str, Any]


def first_name(trial: Trial) -> str:
    """The first named cause, or `NOTHING`, or `UNEXPLAINED`."""
    if trial["verdict"] == "nothing_wrong":
        return NOTHING
    return str(trial["causes"][0]["cause"]) if trial["causes"] else UNEXPLAINED


def truth(trial: Trial) -> str:
    """The id of the only effect."""
    return str(trial["truth"][0]["cause"])


def right_first(trial: Trial) -> bool:
    """Whether the cause of a single effect is named first."""
    return first_name(trial) == truth(trial)


def right_or_equivalent(trial: Trial) -> bool:
    """Whether the cause of a single effect is the first name or declared equivalent to it."""
    return bool(trial["causes"]) and truth(trial) in _names(trial["causes"][0])


def _names(cause: Mapping[str, Any]) -> set[str]:
    return {cause["cause"], *cause["equivalent"]}


def exact_set(trial: Trial, equivalents: bool = False) -> bool:
    """Whether exactly the true causes are named, or causes declared equivalent to them."""
    true = [effect["cause"] for effect in trial["truth"]]
    named = [_names(c) if equivalents else {c["cause"]} for c in trial["causes"]]
    if len(named) != len(true):
        return False
    return any(all(map(set.__contains__, order, true)) for order in permutations(named))


def right_location(trial: Trial, elsewhere: bool = False) -> bool | None:
    """Whether the first name is at the muscle, joint or sensor of a single effect.

    None for effects without a location, such as the direction of gravity.

    Args:
        trial: of a single effect.
        elsewhere: whether locations that the diagnosis declares equivalent count, too.
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
    """Whether two lists of elements belong to the same muscles, joints, links or sensors."""
    machine = machine_of(trial)
    a, b = (locations_of(machine, cause, elements) for elements in (one, other))
    return len(a & b) >= SHARED * len(a | b)


def machine_of(trial: Trial) -> Machine:
    """Nominal model of the machine of a trial."""
    return load(trial["case"]["machine"], ASSETS)


def locations_of(machine: Machine, cause: str, elements: Sequence[str]) -> set[str]:
    """Tendons of sites and sensors, links of bodies, and all other elements themselves.

    A delay acts on commands or on sensors, so their names are kept.
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
    """Largest entropy of the candidates of a step of the search [nats]; None without candidates."""
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
    """Family and error of the parameter of a named single effect; None if none is comparable.

    Mass: relative to that of the link with its load. Friction, stiffness: relative. Delay: in
    samples. Moved sites: RMS of a tendon's length [mm]. All except the last two in %. Friction
    around bends is hidden as a share of the tension, which is the coefficient times the bend.
    """
    if not trial["causes"] or not right_first(trial) or right_location(trial) is False:
        return None
    id, true = truth(trial), trial["truth"][0]["parameters"]
    named = {name: value[0] for name, value in trial["causes"][0]["parameters"].items()}
    if id in ("link_mass", "payload"):
        whole = link_mass(trial) + true["mass"]
        return "mass", 100 * abs(named["mass"] - true["mass"]) / whole
    if id in SAME_PARAMETER:
        family, one, other = SAME_PARAMETER[id]
        size = named[other] * (trial["bend"] or 1.0)
        return family, 100 * abs(size / true[one] - 1)
    if id == "direction_dependent_friction":
        directions = (("forward", "force_out"), ("backward", "force_in"))
        gaps = sum(abs(named[a] - true[b]) for a, b in directions)
        return "friction", 100 * gaps / sum(true[b] for _, b in directions)
    if id == "tendon_elasticity":
        return "stiffness", 100 * abs(1 / (named["compliance"] * true["stiffness"]) - 1)
    if id == "delay":
        return "delay", abs(named["delay"] - true["delay"]) / SAMPLE
    if id == "attachment_shift" and trial["length_error"] is not None:
        return "moved sites", 1000 * trial["length_error"]
    return None


SAME_PARAMETER = {
    "coulomb_friction": ("friction", "force", "friction"),
    "viscous_friction": ("friction", "coefficient", "damping"),
    "load_dependent_friction": ("friction", "share", "coefficient"),
    "joint_stiffness": ("stiffness", "stiffness", "stiffness"),
}
"""Family, hidden parameter and named parameter, by cause."""


def added_mass_error(trial: Trial) -> float | None:
    """Error of the mass added to a link, relative to that mass [%]; None for other causes."""
    found = parameter_error(trial)
    if found is None or found[0] != "mass":
        return None
    return (
        found[1]
        * (link_mass(trial) + trial["truth"][0]["parameters"]["mass"])
        / (trial["truth"][0]["parameters"]["mass"])
    )


def link_mass(trial: Trial) -> float:
    """Nominal mass of the link that a single effect acts on [kg]."""
    model = machine_of(trial).model
    body = model.body(trial["truth"][0]["elements"][0]).id
    return float(model.body_mass[model.body_weldid == model.body_weldid[body]].sum())


LEAST_GAIN = 0.05
"""Gain of the true model below which the ratio of gains is dominated by noise."""


def gain_ratio(trial: Trial) -> float | None:
    """Ratio of the gain of the extended model to that of the true model; None if undefined."""
    true = (trial["true_model"] or {}).get("gain")
    if true is None or true < LEAST_GAIN or trial["gain"] is None:
        return None
    return float(trial["gain"] / true)
