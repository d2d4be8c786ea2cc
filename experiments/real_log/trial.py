"""One start in the log: what is learned from there on, and errors on the second half."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.harness.errors import ExperimentError
from experiments.real_log.baselines import METHODS, corrected
from experiments.real_log.hysteresis import by_direction, spreads
from experiments.real_log.learning import Learned, estimate, learn
from experiments.real_log.log import Log, read_log
from experiments.real_log.machine import (
    Machine,
    cable_lengths,
    joint_angles,
    make_machine,
    sheet_angles,
)
from jmm_agent.types import Floats

OURS, STEADY, NOISY = "ours", "... no elongations", "... and 3 times the noise"
"""Our method with default options; without permanent elongations; and, beside that, with lengths of
`MORE_NOISE` times the default noise."""
OWN = (OURS, STEADY, NOISY)
TITLES = (*METHODS, *OWN)
"""Methods in the order of the tables."""
COUNTS = (1, 3, 5, 10, 27)
"""Numbers of samples to learn from."""
MORE_NOISE = 3.0
"""Factor of the lengths' noise in `NOISY`. It was chosen on one log of this machine, of random
motions, after the errors were known there; another log of the same machine tests it [1]."""
INSIDE = 1.96
"""Standard deviations that hold 95 % of normally distributed errors."""
QUICK_SAMPLES = 300
"""Number of samples of a log in a quick run."""


def load(folder: Path, quick: bool) -> Log:
    """The log, or its first samples in a quick run."""
    log, most = read_log(folder), QUICK_SAMPLES if quick else None
    return replace(
        log, time=log.time[:most], commanded=log.commanded[:most], measured=log.measured[:most]
    )


def trial(
    folder: Path, start: float, counts: tuple[int, ...], cache: Path | None, quick: bool
) -> dict[str, Any]:
    """Learn from samples of the first half of a log, and estimate joint angles in the second half.

    Args:
        folder: of the log.
        start: where learning begins, as a share of the first half [1].
        counts: numbers of samples to learn from.
        cache: folder of trained maps; the user's cache folder if left out.
        quick: whether a short log and a small network are used.

    Returns:
        Errors by method and number of samples, RMS of each joint [rad]; the share of errors that
        are inside of the predicted 95 %, with all samples; what was learned from; and what the map
        of `NOISY` misses over the whole log (N, 6) [rad].

    Raises:
        ExperimentError: the first half has too few samples that are far from each other.
    """
    counts = tuple(counts)
    log, machine = load(folder, quick), make_machine(cache, quick)
    lengths, measured = cable_lengths(log), joint_angles(log.measured)
    split = len(lengths) // 2
    begin = round(start * split)
    learned: dict[str, Learned] = {}
    errors: dict[str, dict[str, list[float]]] = {}
    covered: dict[str, list[float]] = {}
    robots = dict(zip(OWN, (machine, _steady(machine), _noisy(_steady(machine))), strict=True))
    for title, robot in robots.items():
        own = slice(begin, split)
        found = learn(robot, log.time[own], lengths[own], measured[own], counts)
        if missing := [count for count in counts if count not in found.maps]:
            raise ExperimentError(
                f"{folder}: from {start:.0%} of the first half on only {len(found.samples)} "
                f"samples are far enough from each other, but {missing[-1]} are needed."
            )
        learned[title] = found
        errors[title] = {}
        for count, jmm in found.maps.items():
            angles, spread = estimate(robot, jmm, log.time[split:], lengths[split:])
            errors[title][str(count)] = _rms(angles - measured[split:])
            inside = np.abs(angles - measured[split:]) <= INSIDE * spread
            covered[title] = inside.mean(axis=0).tolist()
    errors |= _baselines(learned[OURS], lengths, measured, begin, split, counts)
    last = learned[NOISY].maps[max(counts)]
    missed = measured - estimate(robots[NOISY], last, log.time, lengths).angles
    direction = by_direction(sheet_angles(lengths), missed, split)
    return {
        "start": start,
        "errors": errors,
        "covered": covered,
        "learned": {title: _facts(found, begin) for title, found in learned.items()},
        "direction": [_plain(one._asdict()) for one in direction],
        "missed": np.round(missed, 6).tolist(),
    }


def floor(folder: Path, quick: bool) -> dict[str, Any]:
    """Spread of the measured joint angles at the same motor angles, over the whole log."""
    log = load(folder, quick)
    asked, measured = sheet_angles(cable_lengths(log)), joint_angles(log.measured)
    joints = [_plain(one._asdict()) for one in spreads(asked, measured - asked)]
    return {"samples": len(asked), "lost": log.lost, "joints": joints}


def _steady(machine: Machine) -> Machine:
    """A robot of which it is known that its cables do not become longer for good."""
    observations = replace(machine.options.vision.observations, elongation_evidence=np.inf)
    vision = replace(machine.options.vision, observations=observations)
    return replace(machine, options=replace(machine.options, vision=vision))


def _noisy(machine: Machine) -> Machine:
    """A robot of which it is known that maps of its lengths are missed by more than usual."""
    options = machine.options
    vision = replace(options.vision, noise=MORE_NOISE * options.vision.noise)
    prior = replace(options.prior, noise=MORE_NOISE * options.prior.noise)
    return replace(machine, options=replace(options, vision=vision, prior=prior))


def _baselines(
    learned: Learned,
    lengths: Floats,
    measured: Floats,
    begin: int,
    split: int,
    counts: tuple[int, ...],
) -> dict[str, dict[str, list[float]]]:
    """Errors of the other methods with the samples that ours has chosen."""
    sheet = sheet_angles(lengths)
    errors: dict[str, dict[str, list[float]]] = {method: {} for method in METHODS}
    for method, count in ((method, count) for method in METHODS for count in counts):
        rows = begin + np.array(learned.samples[:count])
        angles = corrected(method, sheet[rows], measured[rows], sheet[split:])
        errors[method][str(count)] = _rms(angles - measured[split:])
    return errors


def _facts(learned: Learned, begin: int) -> dict[str, Any]:
    """What JSON keeps of a learned map."""
    return {
        "samples": [begin + number for number in learned.samples],
        "dropped": learned.dropped,
        "elongations": learned.elongations,
    }


def _plain(numbers: dict[str, float]) -> dict[str, float | None]:
    """The same for JSON: NaN becomes None."""
    return {key: None if np.isnan(value) else value for key, value in numbers.items()}


def _rms(errors: Floats) -> list[float]:
    return np.sqrt(np.mean(errors**2, axis=0)).tolist()
