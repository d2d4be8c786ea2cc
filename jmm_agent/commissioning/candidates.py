"""Candidates: what may be wrong with the wiring of a robot, one step beyond what was found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from jmm_agent.commissioning.findings import (
    ABSENT,
    ENCODER_SCALE,
    ENCODER_STUCK,
    MOTOR_DEAD,
    REVERSED,
    SWAPPED,
    TENSION_SCALE,
    TENSION_SENSOR_DEAD,
)
from jmm_agent.commissioning.likelihood import Likelihood
from jmm_agent.commissioning.wiring import Wiring
from jmm_agent.types import Floats

EXCHANGED = {
    "motors and sensors": ("commands", "lengths", "tensions"),
    "motors": ("commands",),
    "sensors": ("lengths", "tensions"),
    "encoders": ("lengths",),
    "tension sensors": ("tensions",),
}
"""Parts that may be exchanged, by name."""
ARMS = "arms"
"""Kind of a candidate that is no fault: all moment arms of a muscle are larger or smaller."""
MOST_ARMS = 4.0
"""Largest factor between moment arms and nominal ones [1]."""
TURNED = {
    "motor and encoder": ("command_factors", "length_factors"),
    "motor": ("command_factors",),
    "encoder": ("length_factors",),
    "tension sensor": ("tension_factors",),
}
"""Parts that may have the wrong sign, by name."""
FLAT, NOISES, OWN_NOISES = 0.06, 5.0, 2.0
"""Largest response of a sensor that does not respond [1], beside this many standard deviations, to
other muscles and to its own."""
QUIET = 0.2
"""Noise of a sensor without a signal, as a share of the median noise [1]."""
BETTER = 0.35
"""Largest difference of a response that a scale may leave, as a share of that without it [1]."""
LOW = 0.5
"""Tension of an absent muscle, as a share of T_bias [1]; every motor pulls with T_bias."""


class Candidate(NamedTuple):
    """Something that may be wrong.

    Attributes:
        kind: a key of `findings.KINDS`.
        channels: concerned.
        part: what is concerned.
        wiring: with it.
        value: factor of a scale [1].
    """

    kind: str
    channels: tuple[int, ...]
    part: str
    wiring: Wiring
    value: float = np.nan


def candidates(likelihood: Likelihood, wiring: Wiring, factor: float) -> Iterator[Candidate]:
    """All that may be wrong beside what was found.

    Args:
        likelihood: of wirings.
        wiring: as found until now.
        factor: units and scales count if they are off by this factor [1].
    """
    count = len(wiring.commands)
    for channel in range(count):
        yield from _arms(likelihood, wiring, channel)
        if wiring.idle[wiring.commands[channel]]:
            continue
        if _low(likelihood, wiring, channel):
            muscle = int(wiring.commands[channel])
            yield Candidate(ABSENT, (channel,), "", wiring.without(muscle))
            yield Candidate(MOTOR_DEAD, (channel,), "", wiring.without(muscle, dead=True))
        for part, names in TURNED.items():
            if not _own_sign_fits(likelihood, channel, part):
                continue
            yield Candidate(
                REVERSED, (channel,), part, wiring.scaled(channel, **dict.fromkeys(names, -1.0))
            )
        yield from _scales(likelihood, wiring, channel, factor)
    for one, other in combinations(range(count), 2):
        for part, names in EXCHANGED.items():
            yield Candidate(SWAPPED, (one, other), part, wiring.swapped(one, other, names))


def _arms(likelihood: Likelihood, wiring: Wiring, channel: int) -> Iterator[Candidate]:
    """Other moment arms of a muscle, which change how it moves others and how they move it."""
    others = likelihood.apart[channel]
    mean = likelihood.predicted(wiring).mean
    row = likelihood.lengths[channel][others], mean[channel][others]
    column = likelihood.lengths[:, channel][others], mean[:, channel][others]
    factor = _slope(np.append(row[0], column[0]), np.append(row[1], column[1]))
    if np.isfinite(factor) and factor > 0.0:
        arms = wiring.arms.copy()
        arms[channel] = np.clip(arms[channel] * factor, 1.0 / MOST_ARMS, MOST_ARMS)
        yield Candidate(ARMS, (channel,), "", replace(wiring, arms=arms))


def _scales(
    likelihood: Likelihood, wiring: Wiring, channel: int, factor: float
) -> Iterator[Candidate]:
    """Sensors of a channel that do not respond, or with another scale."""
    lengths, tensions = row_factors(likelihood, wiring, channel)
    record = likelihood.record
    if _flat(likelihood.lengths[channel], likelihood.length_noise[channel], channel):
        stuck = wiring.scaled(channel, length_factors=0.0)
        yield Candidate(ENCODER_STUCK, (channel,), "", stuck)
    quiet = record.tension_noise[channel] < QUIET * np.median(record.tension_noise)
    silent = (np.abs(record.before[channel]) < LOW * record.motors.bias).all()
    flat = _flat(likelihood.tensions[channel], likelihood.tension_noise[channel], channel)
    if (quiet or silent) and flat and _moves_others(likelihood, channel):
        dead = wiring.scaled(channel, tension_factors=0.0)
        yield Candidate(TENSION_SENSOR_DEAD, (channel,), "", dead)
    own = likelihood.lengths[channel, channel], likelihood.tensions[channel, channel]
    if _far(tensions, factor) and _better(own[1] / tensions, own[0] - 1.0, own[1]):
        scaled = wiring.scaled(channel, tension_factors=tensions)
        yield Candidate(TENSION_SCALE, (channel,), "", scaled, tensions)
    if not _far(lengths, factor):
        return
    if _better(own[1], own[0] / lengths - 1.0, own[0] - 1.0):
        read = wiring.scaled(channel, length_factors=lengths)
        yield Candidate(ENCODER_SCALE, (channel,), "reading", read, lengths)
    if np.isfinite(likelihood.lengths[:, channel]).any():  # else its moment arms may be others
        whole = wiring.scaled(
            channel, length_factors=lengths, command_factors=1.0 / lengths,
            tension_factors=lengths,
        )  # fmt: skip
        yield Candidate(ENCODER_SCALE, (channel,), "reading and command", whole, lengths)


def _moves_others(likelihood: Likelihood, channel: int) -> bool:
    """Whether other muscles moved when the muscle of a channel was pulled."""
    column = np.abs(likelihood.lengths[:, channel])
    noise = likelihood.length_noise[:, channel]
    return bool((column > FLAT + NOISES * noise)[likelihood.apart[channel]].any())


def _flat(responses: Floats, noise: Floats, channel: int) -> bool:
    """Whether a sensor responds to no pull, and to none of its own muscle either."""
    others = (np.abs(responses) > FLAT + NOISES * noise).any()
    return not others and not abs(responses[channel]) > FLAT + OWN_NOISES * noise[channel]


def _better(measured: float, expected: float, usual: float) -> bool:
    """Whether the response to the own pull agrees much better with a scale than without.

    Args:
        measured: response with the scale [1].
        expected: what it should be [1].
        usual: what ``measured``, or else ``expected``, is without the scale [1].
    """
    if not np.isfinite([measured, expected, usual]).all():
        return False
    left = abs(measured - expected)
    return left < BETTER * max(abs(usual - expected), abs(measured - usual))


def _own_sign_fits(likelihood: Likelihood, channel: int, part: str) -> bool:
    """Whether a part may be reversed by the signs of the responses to the own pull."""
    length = likelihood.lengths[channel, channel]
    tension = likelihood.tensions[channel, channel]
    rises, longer = not tension < 0.0, not length > 0.0  # where they are known
    return {
        "motor and encoder": rises and not length < 0.0,
        "motor": rises and longer,
        "encoder": longer and not tension > 0.0,
        "tension sensor": rises and not length < 0.0,
    }[part]


def _low(likelihood: Likelihood, wiring: Wiring, channel: int) -> bool:
    """Whether the tension of the muscle of a channel is below T_bias when it is pulled."""
    record = likelihood.record
    source = int(np.argsort(wiring.tensions)[wiring.commands[channel]])
    return bool(abs(record.before[source, channel]) < LOW * record.motors.bias)


def _far(value: float, factor: float) -> bool:
    return bool(np.isfinite(value) and value > 0.0 and not 1.0 / factor < value < factor)


def row_factors(likelihood: Likelihood, wiring: Wiring, channel: int) -> tuple[float, float]:
    """Factor between measured and predicted responses of a channel [1].

    Args:
        likelihood: of wirings.
        wiring: as found until now.
        channel: the channel.

    Returns:
        Of its length, by the pulls of others, and of its tension, by its length; NaN if nothing is
        predicted.
    """
    others = likelihood.apart[channel]
    mean = likelihood.predicted(wiring).mean
    expected = mean[wiring.lengths[channel], wiring.commands] * wiring.command_factors
    length = _slope(likelihood.lengths[channel][others], expected[others])
    source = int(np.argsort(wiring.lengths)[wiring.tensions[channel]])
    own = wiring.tensions[channel] == wiring.commands
    seen = likelihood.lengths[source] - own * wiring.command_factors
    return length, _slope(likelihood.tensions[channel], seen)


def _slope(measured: Floats, expected: Floats) -> float:
    known = np.isfinite(measured) & np.isfinite(expected)
    squares = float(np.sum(expected[known] ** 2))
    return float(np.sum(measured[known] * expected[known])) / squares if squares > 0.0 else np.nan
