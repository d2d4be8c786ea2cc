"""Screening: the sensitivity of the replay to each candidate, by finite differences at the null."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Cause, Location, Parameter, SearchHints
from reality_gap.causes.support.own_amounts import OWN, single_locations
from reality_gap.inference.checkpoint import Checkpoint, Columns
from reality_gap.inference.repetition import repeating_periods
from reality_gap.inference.theta import begin_and_duration, theta_bounds
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.system import System
from reality_gap.types import Floats

STEP = 0.25
"""Finite difference, in scales of a parameter."""
CHUNK = 32
"""Number of candidates that are screened between two checkpoints."""
LONGER = (2, 3, 4, 6, 8, 12, 16, 24, 32)
"""How many short events in a row make a longer one."""
MEMORY = 3e8
"""Size of the columns of longer events above which only every second of them is kept, or fewer
[bytes]."""
TYPICAL_FAULTS = 3.0
"""Size of a fault, in scales of a parameter, whose change of the readings decides on visibility."""

FindPeriods = Callable[[SearchHints], tuple[float, ...]]
"""Returns the starts of a period from which fits start."""

NO_CHECKPOINT = Checkpoint(None, "")
"""Keeps nothing."""


@dataclass(frozen=True)
class Sensitivity:
    """Change of the prediction by a candidate, linearised at the null.

    Attributes:
        candidate: a cause at a location.
        names: names of the parameters that the columns belong to.
        fixed: values of the other parameters, such as the time of an event.
        columns: change of the prediction in units of noise per ``scale`` of a parameter, shape
            (n, p); in single precision to save memory.
        step: size of the change from which the columns were found, in scales of a parameter.
    """

    candidate: Candidate
    names: tuple[str, ...]
    fixed: dict[str, float]
    columns: NDArray[np.float32]
    step: float = STEP

    @property
    def change(self) -> float:
        """Norm of the change of all readings by `TYPICAL_FAULTS` scales of a parameter [noise]."""
        power = np.sum(self.columns**2, axis=0)
        return TYPICAL_FAULTS * float(np.sqrt(np.max(power, initial=0.0)))

    @property
    def largest_change(self) -> float:
        """The same, or by a larger fault at which the cause was screened [noise]."""
        return self.change * max(1.0, self.step / TYPICAL_FAULTS)

    def values(self, theta: Floats) -> dict[str, float]:
        """Return the parameter values at ``theta`` (p,), clipped to their bounds."""
        found = dict(self.fixed)
        for name, x in zip(self.names, theta, strict=True):
            p = self.candidate.parameter(name)
            found[name] = float(np.clip(p.null + x * p.scale, p.low, p.high))
        return found

    def bounds(self) -> tuple[Floats, Floats]:
        """Return lower and upper bounds of theta, shape (p,) each."""
        return theta_bounds([self.candidate.parameter(name) for name in self.names])


def list_candidates(
    system: System, causes: Sequence[Cause], most: int = 8
) -> tuple[Candidate, ...]:
    """Return each cause at each of its locations.

    Args:
        system: the study's model and its elements.
        causes: which causes to list.
        most: locations where a cause has more parameters are left out.
    """
    found = []
    for cause in causes:
        for location in cause.locations(system):
            parameters = cause.parameters(system, location)
            if len(parameters) <= most:
                found.append(Candidate(cause, location, parameters))
    return tuple(found)


def screen(
    replayer: Replayer,
    candidates: Sequence[Candidate],
    null_residual: Floats,
    checkpoint: Checkpoint = NO_CHECKPOINT,
    progress: Callable[[float], None] = lambda share: None,
    base: Hypothesis = (),
) -> tuple[Sensitivity, ...]:
    """Compute the sensitivities of candidates beside other causes.

    Args:
        replayer: replays hypotheses.
        candidates: which candidates to screen.
        null_residual: residual of the other causes, shape (n,).
        checkpoint: keeps what was computed, for after an interruption.
        progress: called with the completed share, 0 to 1.
        base: the other causes; none for the nominal model.

    Returns:
        One or more sensitivities of each candidate, but those whose replay diverges.
    """
    find = cache(
        partial(repeating_periods, replayer.system.study, replayer.measured, null_residual)
    )
    if replayer.coarse:
        null_residual = replayer.residuals([[*base]], True)[0]
    found = []
    candidates, composed = _split_composed(candidates)
    for i in range(0, len(candidates), CHUNK):
        trials = [trial for one in candidates[i : i + CHUNK] for trial in _trials(one, find)]
        columns = checkpoint.get(
            i // CHUNK, partial(_columns, replayer, trials, null_residual, base)
        )
        for trial, own in zip(trials, columns, strict=True):
            if np.all(np.isfinite(own)):
                sensitivity = Sensitivity(
                    trial.candidate, trial.names, trial.fixed, own, trial.step
                )
                found.append(sensitivity)
        progress(min(1.0, (i + CHUNK) / len(candidates)))
    sums = [one for candidate in composed for one in _composed(candidate, found)]
    return (*found, *sums, *_longer_events(found))


def _split_composed(
    candidates: Sequence[Candidate],
) -> tuple[tuple[Candidate, ...], tuple[Candidate, ...]]:
    """Return the candidates to replay, and those whose single joints are among them."""
    known = {(one.cause.id, one.location) for one in candidates}

    def is_composed(one: Candidate) -> bool:
        singles = single_locations(one.location) if one.location.note == OWN else ()
        return bool(singles) and all((one.cause.id, single) in known for single in singles)

    composed = tuple(one for one in candidates if is_composed(one))
    return tuple(one for one in candidates if one not in composed), composed


def _composed(candidate: Candidate, found: Sequence[Sensitivity]) -> Iterator[Sensitivity]:
    """Yield the sensitivities of a candidate whose columns are those of its single joints.

    There are as many as the joint with most has, at as many sizes; the others have their last one.
    """
    levels = list[list[Sensitivity]]()
    for single in single_locations(candidate.location):
        own = [
            one
            for one in found
            if one.candidate.cause.id == candidate.cause.id
            and one.candidate.location == single
            and one.names[0] == one.candidate.parameters[0].name
        ]
        if not own:
            return
        levels.append(own)
    names = tuple(p.name for p in candidate.parameters)
    for i in range(max(len(own) for own in levels)):
        parts = [own[min(i, len(own) - 1)] for own in levels]
        columns = np.hstack([one.columns[:, :1] for one in parts])
        step = max(one.step for one in parts)
        yield Sensitivity(candidate, names, candidate.null_values(), columns, step)


def _longer_events(found: Sequence[Sensitivity]) -> Iterator[Sensitivity]:
    """Yield the sensitivities of events that last longer than those that were replayed.

    To first order, a long event is several short ones, each of which begins where another ends.

    Args:
        found: of events at all starts, and of other candidates.
    """
    events = dict[tuple[str, Location], list[Sensitivity]]()
    for one in found:
        if begin_and_duration(one.candidate):
            events.setdefault((one.candidate.cause.id, one.candidate.location), []).append(one)
    longer = [pair for short in events.values() for pair in _rows(short)]
    size = sum(row[0].columns.nbytes for row, _ in longer)
    for row, duration in longer[:: 1 + int(size / MEMORY)]:
        fixed = row[0].fixed | {duration: len(row) * row[0].fixed[duration]}
        yield replace(row[0], fixed=fixed, columns=np.sum([one.columns for one in row], axis=0))


def _rows(events: Sequence[Sensitivity]) -> Iterator[tuple[list[Sensitivity], str]]:
    """Yield short events in a row that make a longer one, and the name of their duration."""
    times = begin_and_duration(events[0].candidate)
    assert times is not None
    begin, duration = times
    short, starts = {one.fixed[begin.name]: one for one in events}, begin.hints.starts
    for count in LONGER:
        for i in range(0, len(starts) - count + 1, max(1, count // 4)):
            row = [short[start] for start in starts[i : i + count] if start in short]
            if len(row) == count:
                yield row, duration.name


class _Trial(NamedTuple):
    """Finite differences of a candidate.

    Attributes:
        candidate: a cause at a location.
        fixed: values of all parameters, but of the one that is changed.
        names, values: which parameters to change, one at a time, and to which values.
    """

    candidate: Candidate
    fixed: dict[str, float]
    names: tuple[str, ...]
    values: tuple[float, ...]

    def changes(self) -> list[tuple[int, str, float]]:
        """Return index, name and value of each parameter whose change has an effect."""
        pairs = enumerate(zip(self.names, self.values, strict=True))
        return [(i, n, v) for i, (n, v) in pairs if not self.candidate.parameter(n).hints.shape]

    @property
    def step(self) -> float:
        """Size of the largest change, in scales of its parameter."""
        parameters = [self.candidate.parameter(name) for name in self.names]
        changes = zip(parameters, self.values, strict=True)
        return max((abs((value - p.null) / p.scale) for p, value in changes), default=0.0)


def _columns(
    replayer: Replayer, trials: Sequence[_Trial], before: Floats, base: Hypothesis
) -> Columns:
    """Return the columns of each trial (n, p); those of a shape are 0 and need no replay."""
    hypotheses: list[Hypothesis] = [
        [*base, (trial.candidate, trial.fixed | {name: value})]
        for trial in trials
        for _, name, value in trial.changes()
    ]
    residuals = iter(replayer.residuals(hypotheses, replayer.coarse))
    found = []
    for trial in trials:
        columns = np.zeros((len(before), len(trial.names)), dtype=np.float32)
        for i, name, value in trial.changes():
            p = trial.candidate.parameter(name)
            columns[:, i] = (before - next(residuals)) / ((value - p.null) / p.scale)
        found.append(columns)
    return found


def _trials(candidate: Candidate, find: FindPeriods) -> list[_Trial]:
    """Return which parameters to change, and at which values of the others.

    A parameter with starts is fixed at each of them while the others change. If it is the only one,
    the secants to its starts are taken. The secants of a parameter are taken in addition, with the
    first start of each other one, and so are other values of a shape. Of the starts of a period,
    those are used that ``find`` returns.
    """
    with_starts = [p for p in candidate.parameters if p.hints.starts]
    free = [p for p in candidate.parameters if not p.hints.starts]
    if len(candidate.parameters) == len(with_starts) == 1:
        return _secants(candidate, with_starts[0], with_starts[0].hints.starts)
    if not free:
        free, with_starts = with_starts, []
    names, values = tuple(p.name for p in free), tuple(p.null + STEP * p.scale for p in free)
    nulls = {p.name: p.null for p in free}
    trials = [
        _Trial(candidate, nulls | fixed, names, values) for fixed in _starts(with_starts, find)
    ]
    for p in candidate.parameters:
        trials += _secants(candidate, p, p.hints.secants)
        trials += _with_shapes(trials, p)
    return trials


def _with_shapes(trials: Sequence[_Trial], p: Parameter) -> list[_Trial]:
    """Return the first of some trials, if there is one, with other values of a shape."""
    found = []
    for first in trials[:1]:
        others = [(n, v) for n, v in zip(first.names, first.values, strict=True) if n != p.name]
        names, values = tuple(n for n, _ in others), tuple(v for _, v in others)
        for shape in p.hints.screened:
            found.append(_Trial(first.candidate, first.fixed | {p.name: shape}, names, values))
    return found


def _starts(parameters: Sequence[Parameter], find: FindPeriods) -> Iterator[dict[str, float]]:
    """Yield the starts of parameters, in all combinations."""
    period = next((p for p in parameters if p.hints.period), None)
    others = [p for p in parameters if p is not period]
    names = [p.name for p in others]
    for starts in product(*(p.hints.starts for p in others)):
        if period is None:
            yield dict(zip(names, starts, strict=True))
            continue
        for value in find(period.hints):
            share = value / max(period.hints.starts)
            scaled = [share * start for start in starts]
            yield dict(zip(names, scaled, strict=True)) | {period.name: value}


def _secants(candidate: Candidate, p: Parameter, values: Sequence[float]) -> list[_Trial]:
    """Return trials of one parameter of a candidate at some values."""
    first = {q.name: q.hints.starts[0] for q in candidate.parameters if q.hints.starts}
    fixed = candidate.null_values() | first | {p.name: p.null}
    return [_Trial(candidate, fixed, (p.name,), (value,)) for value in values]
