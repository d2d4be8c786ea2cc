"""Flat directions: what a log cannot show, and what would show it.

A cause does not show at a location if a typical fault changes the readings by less than the noise,
or if deviations within the tolerances have the same effect. Two causes cannot be separated if each
can have the effect of a typical fault of the other. Both follow from the Gram matrix of the
sensitivities, whitened by the noise model.

A remedy is a motion through commands of the log, with or without an added mass. Its effects are
replayed for a few seconds, and their squares are extrapolated to `SECONDS`. Distances are those in
the log and in the motion together, where the tolerances of all candidates that are replayed adapt.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.causes import CATALOGUE
from reality_gap.inference.motions import TIGHTER, Motion, motions
from reality_gap.inference.next_experiment import motion_study
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import TYPICAL_FAULTS, Sensitivity, list_candidates
from reality_gap.inference.typical_effects import (
    Effects,
    effects_of,
    largest_of_each,
    left_over,
    whitened,
)
from reality_gap.log_findings import FlatDirection, Remedy
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, Part
from reality_gap.types import Bools, Floats

SECONDS, TRIED = 30.0, 6.0
"""Duration of a remedy, and how much of it is replayed [s]."""
SURE = 2.0
"""Multiple of the threshold that a remedy must reach, because predictions are linear."""
BUDGET = 300
"""Number of candidates that are replayed, times 1 and the numbers of degrees of freedom and tendons
of the model."""
MASS = 10.0
"""Added mass, in scales of a payload."""
PAYLOAD = "payload"
"""Id of the cause that is an added mass."""


def flat_directions(
    problem: Problem,
    sensitivities: Sequence[Sensitivity],
    visible: float,
    named: Sequence[Candidate] = (),
) -> tuple[FlatDirection, ...]:
    """Return what a log cannot show, by cause and location.

    Args:
        problem: the study and its noise model.
        sensitivities: of all candidates.
        visible: change of the readings by a typical fault from which on a cause shows [noise].
        named: causes that were found, which show themselves: a typical fault of the nominal model
            may be smaller.
    """
    own = largest_of_each(sensitivities)
    if not own:
        return ()
    known = effects_of(own, whitened(problem, own))
    hidden = [i for i in range(len(own)) if known.size(i) <= visible]
    by_cause: dict[str, list[int]] = {}
    for i in hidden:
        if any(own[i].candidate.matches(one) for one in named):
            continue
        by_cause.setdefault(own[i].candidate.cause.id, []).append(i)
    together = _inseparable(known, set(hidden), visible)
    groups = [*by_cause.values(), *together]
    wanted = [[max(group, key=known.size)] for group in by_cause.values()]
    wanted += [group[:2] for group in together]
    chosen = list(dict.fromkeys(i for some in wanted for i in some))[: _most(problem)]
    trials = _trials(problem, [own[i] for i in chosen])
    found = []
    for group, some in zip(groups, wanted, strict=True):
        alone = len(some) == 1
        size = [known.size(some[0])] if alone else [known.distances(j)[group].max() for j in group]
        tried = bool(trials) and all(i in chosen for i in some)
        remedy = _remedy(known, trials, some, [chosen.index(i) for i in some]) if tried else None
        if remedy is not None and remedy.change < SURE * visible:
            remedy = None
        parts = tuple(own[i].candidate for i in group)
        found.append(FlatDirection(parts, alone, float(max(size)), remedy, tried))
    return tuple(found)


class _Trial(NamedTuple):
    """A motion that may show something.

    Attributes:
        motion: the motion.
        mass: the added mass as a part of all hypotheses; None without.
        effects: effects of the candidates that were replayed, for `SECONDS`.
        tolerated: size of each parameter's tolerance in typical faults, shape (k,).
    """

    motion: Motion
    mass: Part | None
    effects: Effects
    tolerated: Floats


def _inseparable(known: Effects, hidden: set[int], visible: float) -> list[list[int]]:
    """Return groups of candidates that show, but not which of them it is; the largest first."""
    shown = [i for i in range(known.count) if i not in hidden]
    distance = np.array([known.distances(j) for j in range(known.count)])
    near = np.maximum(distance, distance.T) <= visible
    groups = list[list[int]]()
    common = list[Bools]()  # which candidates are near all those of a group
    for i in sorted(shown, key=lambda one: -known.size(one)):
        k = next((k for k, one in enumerate(common) if one[i]), len(groups))
        if k == len(groups):
            groups.append([])
            common.append(near[i])
        groups[k].append(i)
        common[k] = common[k] & near[i]
    return [group for group in groups if len(group) > 1]


def _most(problem: Problem) -> int:
    model = problem.system.model
    return max(2, BUDGET // (1 + int(model.nv) + int(model.ntendon)))


def _trials(problem: Problem, own: Sequence[Sensitivity]) -> list[_Trial]:
    """Replay candidates in motions through commands of the study, and with an added mass."""
    study = problem.system.study
    if study.inverse or not own or not study.episodes[0].command.shape[1]:
        return []
    plain = motions(study)[:: len(TIGHTER)]
    tried: list[tuple[Motion, Part | None]] = [(motion, None) for motion in plain]
    for payload in list_candidates(problem.system, [CATALOGUE[PAYLOAD]])[:1]:
        mass = MASS * payload.parameters[0].scale
        values = payload.null_values() | {payload.parameters[0].name: mass}
        tried.append((plain[-1], (payload, values)))
    parameters = [one.candidate.parameter(name) for one in own for name in one.names]
    tolerated = np.array([p.tolerance / abs(TYPICAL_FAULTS * p.scale) for p in parameters])
    found = []
    for motion, load in tried:
        columns = _replayed(problem, own, motion, load)
        if np.isfinite(columns).all():
            found.append(_Trial(motion, load, effects_of(own, columns), tolerated))
    return found


def _replayed(
    problem: Problem, own: Sequence[Sensitivity], motion: Motion, mass: Part | None
) -> Floats:
    """Return the change of the readings of a motion by typical faults, shape (m, k)."""
    trials: list[Hypothesis] = [[] if mass is None else [mass]]
    factors = list[float]()
    for one in own:
        fixed = {name: _within(one, name, value) for name, value in one.fixed.items()}
        for name in one.names:
            p = one.candidate.parameter(name)
            value = float(np.clip(p.null + TYPICAL_FAULTS * p.scale, p.low, p.high))
            factors.append(TYPICAL_FAULTS * p.scale / (value - p.null))
            trials.append(_beside(mass, (one.candidate, fixed | {name: value})))
    study = motion_study(problem.system.study, motion, TRIED)
    null, *others = problem.replayer.predictions(study, trials)
    longer = np.sqrt(SECONDS / TRIED)
    return np.column_stack(
        [(other - null) * longer * factor for other, factor in zip(others, factors, strict=True)]
    )


def _within(one: Sensitivity, name: str, value: float) -> float:
    """Return the fixed value of a parameter, or for the time of an event one in a short motion."""
    p = one.candidate.parameter(name)
    return TRIED / 2 if p.hints.starts and p.unit == "s" else value


def _beside(mass: Part | None, part: Part) -> Hypothesis:
    """Return a candidate beside an added mass; two masses at one location are one."""
    if mass is None:
        return [part]
    if not mass[0].matches(part[0]):
        return [mass, part]
    name = part[0].parameters[0].name
    return [(part[0], {**part[1], name: part[1][name] + mass[1][name]})]


def _remedy(
    known: Effects, trials: Sequence[_Trial], some: Sequence[int], at: Sequence[int]
) -> Remedy:
    """Return the trial that shows most of candidates.

    Args:
        known: effects in the study.
        trials: effects in motions.
        some: indices of one candidate, or of two that are to be separated, in ``known``.
        at: their indices in ``trials``.
    """
    shown = [_shown(known, trial, some, at) for trial in trials]
    best = int(np.argmax(shown))
    motion, mass, _, _ = trials[best]
    weight, body = 0.0, ""
    if mass is not None:
        weight, body = mass[1][mass[0].parameters[0].name], str(mass[0].location)
    return Remedy(motion.title, SECONDS, weight, body, shown[best])


def _shown(known: Effects, trial: _Trial, some: Sequence[int], at: Sequence[int]) -> float:
    """Return the effect of one candidate, or the smaller distance of two, with a trial [noise]."""
    if len(some) == 1:
        return _distance(known, trial, (some[0], at[0]), None)
    pairs = list(zip(some, at, strict=True))
    return min(_distance(known, trial, *pairs), _distance(known, trial, *pairs[::-1]))


def _distance(
    known: Effects, trial: _Trial, one: tuple[int, int], other: tuple[int, int] | None
) -> float:
    """Return the part of a candidate's effect in log and trial that nothing else can have [noise].

    Args:
        known: effects in the study.
        trial: effects in a motion.
        one: index of the candidate in ``known`` and in ``trial``.
        other: those of a candidate whose parameters adapt; None if only tolerances do.
    """
    gram, c, k = trial.effects.gram, trial.effects.columns(one[1]), known.columns(one[0])
    first = int(np.argmax(gram[c, c] + known.gram[k, k]))
    i, j = int(c[first]), int(k[first])
    free = trial.effects.columns(other[1]) if other else np.zeros(0, dtype=np.int64)
    rest = np.setdiff1d(np.arange(len(gram)), np.concatenate([c, free]))
    size = np.concatenate([np.ones(len(free)), trial.tolerated[rest]])
    columns = np.concatenate([free, rest])
    along = size * gram[columns, i]
    square = size[:, None] * gram[np.ix_(columns, columns)] * size
    square[len(free) :, len(free) :] += np.eye(len(rest))
    if other:
        own = known.columns(other[0])
        along[: len(free)] += known.gram[own, j]
        square[: len(free), : len(free)] += known.gram[np.ix_(own, own)]
    return left_over(float(gram[i, i] + known.gram[j, j]), along, square)
