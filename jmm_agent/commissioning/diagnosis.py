"""From the record of the pulls to findings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from jmm_agent.commissioning import findings as kinds
from jmm_agent.commissioning import sentences
from jmm_agent.commissioning.candidates import EXCHANGED
from jmm_agent.commissioning.findings import Finding
from jmm_agent.commissioning.likelihood import FREEDOM, Likelihood
from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.commissioning.pull_control import MUCH
from jmm_agent.commissioning.search import TEMPER, Step, search
from jmm_agent.commissioning.wiring import Wiring
from jmm_agent.types import Bools

LOOSE = 0.1
"""A slack muscle is named if it was shortened by this share of the travel [1]."""
REACHES = 0.1
"""Predicted response of another muscle from which on a muscle cannot be shortened far without
effect [1]."""
WOUND = 1.0
"""A motor that has wound up by this many travels before it was pulled turns [1]."""
TURNS = 0.8
"""Response of its own length from which on a motor turns, as a share of the stroke [1]."""


def diagnose(
    likelihood: Likelihood, options: CommissionOptions
) -> tuple[Wiring, list[Finding], list[Finding]]:
    """Wiring, what is wrong with it, and what cannot be decided.

    Args:
        likelihood: of wirings, by the record of a run.
        options: least evidence, and least factor of a scale.
    """
    wiring, steps = search(likelihood, options)
    idle = _idle(likelihood, wiring)
    for index in np.flatnonzero(idle):
        wiring = wiring.without(int(index), dead=_is_dead(likelihood, wiring, int(index)))
    steps = [step for step in steps if not _idles(step, wiring)]
    found = [*_swaps(likelihood, wiring, steps), *_faults(likelihood, steps)]
    found += _absent(likelihood, wiring)
    found = [*_units(likelihood, found), *found]
    concerned = {muscle for finding in found for muscle in finding.muscles}
    found += _slack(likelihood, concerned)
    concerned |= {muscle for finding in found for muscle in finding.muscles}
    return wiring, found, list(_undecided(likelihood, wiring, options, concerned))


def _swaps(likelihood: Likelihood, wiring: Wiring, steps: list[Step]) -> Iterator[Finding]:
    """A finding for each ring of muscles that are exchanged."""
    names = likelihood.record.muscles
    for ring in _rings(wiring):
        parts = tuple(
            name for name in ("commands", "lengths", "tensions")
            if any(getattr(wiring, name)[channel] != channel for channel in ring)
        )  # fmt: skip
        part = next((part for part, those in EXCHANGED.items() if those == parts), "parts")
        own = [step for step in steps if set(step.candidate.channels) & set(ring)
               and step.candidate.kind == kinds.SWAPPED]  # fmt: skip
        muscles = tuple(names[channel] for channel in ring)
        yield Finding(
            kinds.SWAPPED, muscles, sentences.swapped(muscles, part), part,
            evidence=sum(step.evidence for step in own),
            confidence=min(step.confidence for step in own),
        )  # fmt: skip


def _rings(wiring: Wiring) -> Iterator[tuple[int, ...]]:
    """Rings of channels that are exchanged, each in the order of one of its parts."""
    left = set(range(len(wiring.commands)))
    orders = [getattr(wiring, name) for name in ("commands", "lengths", "tensions")]
    while left:
        first = min(left)
        ring, new = [first], [first]
        while new:
            channel = new.pop()
            for order in orders:
                other = int(order[channel])
                if other not in ring:
                    ring.append(other)
                    new.append(other)
        left -= set(ring)
        if len(ring) > 1:
            yield tuple(ring)


def _idle(likelihood: Likelihood, wiring: Wiring) -> Bools:
    """Muscles that had no tension, and neither pulled nor moved any other when shortened far."""
    mean = np.abs(likelihood.predicted(Wiring.healthy(len(wiring.commands))).mean)
    reaches = np.where(likelihood.apart, mean, 0.0).max(axis=0) > REACHES
    usual = wiring.commands == np.arange(len(reaches))
    idle = np.isinf(likelihood.record.taken_up) & reaches & usual & ~wiring.idle
    for index in np.flatnonzero(idle):
        if not _is_dead(likelihood, wiring, int(index)):
            continue  # its motor turns, and its length does not follow the arm
        ends = [wiring.without(int(index), dead) for dead in (False, True)]
        idle[index] = max(map(likelihood.of, ends)) > likelihood.of(wiring)
    return np.asarray(idle)


def _idles(step: Step, wiring: Wiring) -> bool:
    """Whether a step is explained by a muscle that is absent."""
    candidate = step.candidate
    if candidate.kind == kinds.SWAPPED:
        return False
    return bool(wiring.idle[wiring.commands[candidate.channels[0]]])


def _is_dead(likelihood: Likelihood, wiring: Wiring, index: int) -> bool:
    """Whether the motor of a muscle that holds nothing does not turn either."""
    record = likelihood.record
    channel = int(np.argsort(wiring.commands)[index])
    wound = record.first_lengths[channel] - record.rest_lengths[channel]
    own = float(likelihood.lengths[channel, channel])
    return not (wound > WOUND * record.travel or record.running[channel] or own > TURNS)


def _absent(likelihood: Likelihood, wiring: Wiring) -> Iterator[Finding]:
    """A finding for each muscle that holds nothing."""
    for index in np.flatnonzero(wiring.idle):
        dead = _is_dead(likelihood, wiring, int(index))
        kind = kinds.MOTOR_DEAD if dead else kinds.ABSENT
        muscle = likelihood.record.muscles[index]
        sentence = sentences.motor_dead(muscle) if dead else sentences.absent(muscle)
        others = np.arange(len(wiring.commands)) != index
        with_it = replace(wiring, absent=wiring.absent & others, dead=wiring.dead & others)
        evidence = likelihood.of(wiring) - likelihood.of(with_it)
        confidence = 1.0 / (1.0 + float(np.exp(-TEMPER * np.clip(evidence, 0.0, 100.0))))
        yield Finding(kind, (muscle,), sentence, "", np.nan, evidence, confidence)


def _faults(likelihood: Likelihood, steps: list[Step]) -> Iterator[Finding]:
    """A finding for each step that is neither an exchange nor an absent muscle."""
    for (kind, channels, part, _, value), evidence, confidence in steps:
        if kind in (kinds.SWAPPED, kinds.ABSENT, kinds.MOTOR_DEAD):
            continue
        muscle = likelihood.record.muscles[channels[0]]
        sentence = _sentence(kind, muscle, part, value)
        yield Finding(kind, (muscle,), sentence, part, value, evidence, confidence)


def _sentence(kind: str, muscle: str, part: str, value: float) -> str:
    """Sentence of a fault of one muscle."""
    if kind == kinds.REVERSED:
        return sentences.turned(muscle, part)
    if kind == kinds.TENSION_SCALE:
        return sentences.tension_scale(muscle, value)
    if kind == kinds.ENCODER_SCALE:
        return sentences.encoder_scale(muscle, value, part)
    dead = kind == kinds.TENSION_SENSOR_DEAD
    return sentences.sensor_dead(muscle) if dead else sentences.stuck(muscle)


def _units(likelihood: Likelihood, found: list[Finding]) -> list[Finding]:
    """Tension sensors that read more than any motor pulls; what they explain leaves ``found``."""
    record, result = likelihood.record, list[Finding]()
    for index in np.flatnonzero(record.rest_tensions > MUCH * record.motors.limit):
        muscle = record.muscles[index]
        factor = float(record.rest_tensions[index] / record.motors.bias)
        sentence = (
            f"The tension sensor of {muscle} reads {record.rest_tensions[index]:.3g} N at rest, "
            f"more than its motor can pull ({record.motors.limit:g} N); check its unit and its "
            "calibration."
        )
        result.append(Finding(kinds.TENSION_SCALE, (muscle,), sentence, "", factor, np.inf, 1.0))
        found[:] = [each for each in found if each.muscles != (muscle,)]
    return result


def _slack(likelihood: Likelihood, concerned: set[str]) -> Iterator[Finding]:
    """Muscles that had no tension until they were shortened."""
    record = likelihood.record
    for index, taken_up in enumerate(record.taken_up):
        muscle = record.muscles[index]
        if np.isfinite(taken_up) and taken_up > LOOSE * record.travel and muscle not in concerned:
            sentence = sentences.slack(muscle, float(taken_up))
            yield Finding(kinds.SLACK, (muscle,), sentence, "", float(taken_up), confidence=1.0)


def _undecided(
    likelihood: Likelihood, wiring: Wiring, options: CommissionOptions, concerned: set[str]
) -> Iterator[Finding]:
    """What the pulls do not show."""
    record = likelihood.record
    for index, muscle in enumerate(record.muscles):
        if muscle in concerned:
            continue
        if record.released[index] > 0.0:
            sentence = sentences.contradicts(muscle, float(record.released[index]))
            yield Finding(kinds.UNDECIDED, (muscle,), sentence)
        elif np.isinf(record.taken_up[index]):
            yield Finding(kinds.UNDECIDED, (muscle,), sentences.no_tension(muscle))
        elif not np.isfinite(likelihood.lengths[:, index]).any():
            sentence = sentences.not_moved(muscle, record, index)
            yield Finding(kinds.UNDECIDED, (muscle,), sentence)
    for one, other in combinations(range(len(record.muscles)), 2):
        pair = record.muscles[one], record.muscles[other]
        if concerned & set(pair):
            continue
        parts = EXCHANGED["motors and sensors"]
        if power(likelihood, wiring, wiring.swapped(one, other, parts)) < options.named:
            yield Finding(kinds.UNDECIDED, pair, sentences.alike(pair))


def power(likelihood: Likelihood, wiring: Wiring, other: Wiring) -> float:
    """Evidence for another wiring that is to be expected if it were true [nat].

    Args:
        likelihood: of wirings.
        wiring: as found.
        other: with one more fault.
    """
    mean = likelihood.predicted(wiring).mean
    rows = [np.ix_(each.lengths, each.commands) for each in (wiring, other)]
    deviation = likelihood.terms(wiring).deviations[0]
    change = (mean[rows[1]] - mean[rows[0]]) / deviation
    known = np.isfinite(likelihood.lengths)
    return float(0.5 * (FREEDOM + 1.0) * np.log1p(change[known] ** 2 / FREEDOM).sum())
