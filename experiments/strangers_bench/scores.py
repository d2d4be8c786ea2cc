"""Scores of a trial: whether the names are right, and whether intervals cover the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import Any

NOTHING, UNEXPLAINED, REFUSED = "nothing", "unexplained", "refused"
SURE = 0.9
"""Confidence from which a name counts as sure."""

NAMES: dict[str, tuple[str, ...]] = {
    "less_damping": ("viscous_friction",),
    "less_friction": ("coulomb_friction",),
    "less_stiffness": ("joint_stiffness",),
    "servo_kp": ("position_gain",),
    "servo_kd": ("velocity_gain",),
    "torque_limit": ("force_limit",),
    "command_delay": ("delay",),
    "sensor_delay": ("delay",),
    "early_stamps": ("delay",),
    "reading_zero": ("joint_offset",),
    "reading_scale": ("encoder_scale",),
    "mirrored_reading": ("encoder_scale", "mirrored_axis"),
    "force_reading_scale": ("tension_scale", "effort_scale"),
    "force_reading_zero": ("tension_offset", "effort_offset"),
}
"""Causes of the diagnosis's catalogue that express a hidden effect; others have its own id."""

SAME_IN: dict[tuple[str, str], tuple[str, ...]] = {
    ("efforts", "force_reading_zero"): ("force_offset",),
    ("efforts", "force_reading_scale"): ("force_scale",),
    ("motors", "force_scale"): ("command_gain",),
}
"""Further causes that are the same effect on a kind of machine."""

PARAMETERS: dict[str, str] = {
    "armature": "inertia",
    "viscous_friction": "damping",
    "coulomb_friction": "friction",
    "joint_stiffness": "stiffness",
    "link_mass": "mass",
    "payload": "mass",
    "position_gain": "excess",
    "velocity_gain": "excess",
    "force_scale": "excess",
    "force_limit": "limit",
    "gravity_compensation": "share",
    "joint_offset": "offset",
    "encoder_scale": "scale",
    "length_scale": "scale",
    "length_offset": "offset",
    "delay": "delay",
    "backlash": "gap",
    "wire_elongation": "elongation",
    "torque_speed_curve": "drop",
    "speed_limit": "slowness",
    "dead_zone": "half_width",
    "gear_friction": "coefficient",
    "joint_elasticity": "compliance",
    "motor_coupling": "ratio",
    "clock_drift": "drift",
}
"""Parameter of a cause that the true size of an effect is compared with."""

Trial = Mapping[str, Any]


def true_names(trial: Trial, effect: Mapping[str, Any]) -> frozenset[str]:
    """Ids of the causes that express a hidden effect; none for one outside the catalogue."""
    if trial["case"]["kind"] == "outside":
        return frozenset()
    id = effect["effect"]
    same = SAME_IN.get((trial["machine"]["kind"], id), ())
    return frozenset((*NAMES.get(id, (id,)), *same))


def named(cause: Mapping[str, Any], equivalents: bool = True) -> frozenset[str]:
    """Id of a named cause, with those that are declared equivalent."""
    return frozenset((cause["cause"], *(cause["equivalent"] if equivalents else ())))


def first_name(trial: Trial) -> str:
    """The first named cause, or `NOTHING`, `UNEXPLAINED` or `REFUSED`."""
    if trial["causes"]:
        return str(trial["causes"][0]["cause"])
    other = {"nothing_wrong": NOTHING, "refused": REFUSED}
    return other.get(trial["verdict"], UNEXPLAINED)


def right_first(trial: Trial) -> bool:
    """Whether the cause of a single effect is named first, or declared equivalent to the first."""
    if not trial["causes"]:
        return False
    return bool(true_names(trial, trial["truth"][0]) & named(trial["causes"][0]))


def exact_set(trial: Trial) -> bool:
    """Whether exactly the true causes are named, or causes declared equivalent to them."""
    true = [true_names(trial, effect) for effect in trial["truth"]]
    found = [named(cause) for cause in trial["causes"]]
    if len(found) != len(true):
        return False
    return any(
        all(one & other for one, other in zip(order, true, strict=True))
        for order in permutations(found)
    )


def false_names(trial: Trial) -> list[Mapping[str, Any]]:
    """Named causes that are not, nor are declared equivalent to, a hidden effect."""
    true = frozenset().union(*(true_names(trial, effect) for effect in trial["truth"]))
    return [cause for cause in trial["causes"] if not named(cause) & true]


def sure_and_wrong(trial: Trial) -> bool:
    """Whether a false name has a confidence of at least `SURE`."""
    return any((cause["confidence"] or 0.0) >= SURE for cause in false_names(trial))


def false_alarm(trial: Trial) -> bool:
    """Whether a cause is named, or a gap is claimed, although nothing is hidden."""
    return bool(trial["verdict"] not in ("nothing_wrong", REFUSED))


def rejected(trial: Trial) -> bool:
    """Whether an effect outside the catalogue is seen and gets no false name."""
    return trial["verdict"] in ("unexplained", "partly_named") and not trial["causes"]


def same_location(trial: Trial, one: Sequence[str], other: Sequence[str]) -> bool:
    """Whether two lists of elements have a joint, tendon, link or sensor in common."""
    known = trial["machine"]["elements"]
    a, b = ({part for name in names for part in known.get(name, [name])} for names in (one, other))
    return not a or bool(a & b)


def right_location(trial: Trial) -> bool | None:
    """Whether the right first cause of a single effect is at the right place; None if it is not."""
    if not right_first(trial):
        return None
    effect, cause = trial["truth"][0], trial["causes"][0]
    return same_location(trial, effect["elements"], cause["elements"])


def covered(trial: Trial) -> bool | None:
    """Whether the interval of a right single effect covers its true size; None if not comparable.

    A cause that acts on several elements with one number each is not compared.
    """
    if not right_location(trial) or len(trial["causes"]) > 1:
        return None
    effect, cause = trial["truth"][0], trial["causes"][0]
    name = sized_parameter(trial, effect, cause)
    if name is None:
        return None
    _, low, high = cause["parameters"][name]
    return bool(low <= effect["size"] <= high)


def sized_parameter(
    trial: Trial, effect: Mapping[str, Any], cause: Mapping[str, Any]
) -> str | None:
    """Parameter of a cause whose value is the size of a hidden effect; None if not comparable."""
    name = PARAMETERS.get(cause["cause"])
    exact = cause["cause"] in true_names(trial, effect)
    if effect["size"] is None or not exact or name not in cause["parameters"]:
        return None
    return name if len(cause["elements"]) == len(effect["elements"]) else None
