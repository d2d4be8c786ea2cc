"""Sentences of the findings: what was found, why, and what to do."""

from __future__ import annotations

import numpy as np

from jmm_agent.commissioning.findings import factor_of, named
from jmm_agent.commissioning.pull_record import PullRecord


def swapped(muscles: tuple[str, ...], part: str) -> str:
    """Parts of muscles that are exchanged."""
    ring = ", ".join(
        f"{one} has those of {other}"
        for one, other in zip(muscles, (*muscles[1:], muscles[0]), strict=True)
    )
    what = f"The {part} of {named(muscles)} are exchanged"
    detail = "" if len(muscles) == 2 else f" ({ring})"
    return (
        f"{what}{detail}: what else moves when they are pulled fits the model only in this order; "
        "exchange their connectors, or give the result to make_agent."
    )


def turned(muscle: str, part: str) -> str:
    """A part of a muscle with the wrong sign."""
    why = {
        "tension sensor": "its reading falls where the muscle pulls more",
        "encoder": "its reading grows where the muscle shortens",
        "motor": "the muscle is let out when it is commanded to shorten",
    }.get(part, "all other muscles move the other way round when it is pulled")
    signs = "signs" if "and" in part else "sign"
    return (
        f"The {part} of {muscle} has the wrong {signs}: {why}; turn the {signs} over, or give the "
        "result to make_agent."
    )


def absent(muscle: str) -> str:
    """A muscle whose motor turns while nothing else moves."""
    return (
        f"{muscle} is absent or broken: its motor turns, but no other muscle moves and its tension "
        "stays low; mount it, or give the result to make_agent, which leaves it out."
    )


def motor_dead(muscle: str) -> str:
    """A motor that does nothing."""
    return (
        f"The motor of {muscle} does nothing: neither its own length nor any other changes when it "
        "is commanded, and its tension stays low; check its power, its fuse and its cable, and "
        "whether it hangs loose with a dead tension sensor."
    )


def slack(muscle: str, taken_up: float) -> str:
    """A muscle that pulls only after it was shortened."""
    return (
        f"{muscle} is slack: it had no tension until it was shortened by {1e3 * taken_up:.2g} mm; "
        "wind it up by that, and zero its length again."
    )


def sensor_dead(muscle: str) -> str:
    """A tension sensor that does not respond."""
    return (
        f"The tension sensor of {muscle} does not respond, although other muscles move when it is "
        "pulled; check its cable and its amplifier."
    )


def tension_scale(muscle: str, factor: float) -> str:
    """A tension sensor of another scale."""
    return (
        f"The tension sensor of {muscle} reads {factor_of(factor)} times what K_stiff times its "
        "change of length is; check its unit and its calibration."
    )


def stuck(muscle: str) -> str:
    """An encoder that does not respond."""
    return (
        f"The encoder of {muscle} does not respond, although other muscles move when it is pulled; "
        "check its cable and its shaft."
    )


def encoder_scale(muscle: str, factor: float, part: str) -> str:
    """An encoder of another scale."""
    where = "reads" if part == "reading" else "and the command of its motor have"
    return (
        f"The encoder of {muscle} {where} {factor_of(factor)} times the length that the other "
        "muscles show; check its unit, its gear and the diameter of its drum."
    )


def far_length(muscle: str, length: float, low: float, high: float) -> str:
    """A length that no posture has."""
    return (
        f"The encoder of {muscle} reads {length:.3g} m, but the map has {low:.3g} to {high:.3g} m "
        "between the joint limits: it has another unit or was never zeroed; nothing was pulled."
    )


def no_number(muscle: str) -> str:
    """An encoder that reads no number."""
    return (
        f"The encoder of {muscle} reads no number, so that no command holds the muscle; nothing "
        "was pulled; check its cable."
    )


def not_moved(muscle: str, record: PullRecord, index: int) -> str:
    """A muscle that was not pulled enough."""
    stroke = 1e3 * abs(float(record.strokes[index]))
    tension = float(record.before[index, index])
    why = f"its tension stayed at {tension:.3g} N" if np.isfinite(tension) else "it was not pulled"
    if record.ended[index] and stroke > 0.0:
        why = f"its pull ended after {stroke:.2g} mm, because a tension was too high"
    return f"{muscle} was not moved enough to know whether it is right: {why}."


def no_tension(muscle: str) -> str:
    """A muscle without tension, which is not known to be absent."""
    return (
        f"{muscle} showed no tension however far it was shortened: it is absent, or its tension "
        "sensor is dead; check both."
    )


def contradicts(muscle: str, released: float) -> str:
    """A muscle that pulled too much while it was held."""
    return (
        f"{muscle} pulled too much when it was commanded the length that it reads, and had to be "
        f"released by {1e3 * released:.3g} mm: its encoder may have another sign, unit or muscle "
        "than its motor; check them."
    )


def alike(muscles: tuple[str, ...]) -> str:
    """Muscles whose exchange changes too little."""
    return (
        f"Whether {named(muscles)} are exchanged cannot be decided here: both orders predict about "
        "the same responses; compare their cables, or repeat the run in another posture."
    )
