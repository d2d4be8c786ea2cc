"""Findings of a commissioning run: kinds, and a sentence for each."""

from __future__ import annotations

from dataclasses import dataclass

SWAPPED = "swapped"
REVERSED = "reversed"
ABSENT = "absent"
SLACK = "slack"
MOTOR_DEAD = "motor_dead"
TENSION_SENSOR_DEAD = "tension_sensor_dead"
TENSION_SCALE = "tension_scale"
ENCODER_DEAD = "encoder_dead"
ENCODER_STUCK = "encoder_stuck"
ENCODER_SCALE = "encoder_scale"
UNDECIDED = "undecided"

KINDS = {
    SWAPPED: "motors or sensors of muscles are exchanged",
    REVERSED: "a motor, an encoder or a tension sensor has the wrong sign",
    ABSENT: "the motor turns, but nothing else moves: the muscle is absent or broken",
    SLACK: "the muscle is too long, and pulls only after it has been shortened",
    MOTOR_DEAD: "the motor neither turns nor pulls",
    TENSION_SENSOR_DEAD: "the tension sensor does not respond, but the muscle moves others",
    TENSION_SCALE: "the tension sensor has another unit or scale",
    ENCODER_DEAD: "the encoder reads no number",
    ENCODER_STUCK: "the encoder does not respond, but the muscle pulls",
    ENCODER_SCALE: "the encoder has another unit or scale",
    UNDECIDED: "the pulls do not show whether the muscle is right",
}
"""All kinds of findings, and the meaning of each."""


@dataclass(frozen=True)
class Finding:
    """Something that a commissioning run has found.

    Attributes:
        kind: a key of `KINDS`.
        muscles: names; those that are exchanged in order: the first is connected where the second
            should be, and so on, and the last where the first should be.
        sentence: what was found, why, and what to do.
        part: what is concerned, such as "motors and sensors" or "encoder"; empty if it is clear.
        value: factor of the scale [1], or how far a slack muscle was shortened [m]; NaN without.
        evidence: logarithm of the likelihood ratio to a robot without it [nat].
        confidence: probability beside other explanations with the same muscles [1].
    """

    kind: str
    muscles: tuple[str, ...]
    sentence: str
    part: str = ""
    value: float = float("nan")
    evidence: float = float("nan")
    confidence: float = float("nan")


def named(muscles: tuple[str, ...]) -> str:
    """Names in a sentence."""
    *first, last = muscles
    return f"{', '.join(first)} and {last}" if first else last


def factor_of(value: float) -> str:
    """A factor in words, with the unit that it may come from."""
    powers = (1000.0, 100.0, 0.01, 0.001)
    near = next((power for power in powers if 0.6 < value / power < 1.6), None)
    units = {1000.0: "milli-units", 100.0: "centi-units", 0.01: "hundreds", 0.001: "thousands"}
    return f"{value:.3g}" + ("" if near is None else f" (as if given in {units[near]})")
