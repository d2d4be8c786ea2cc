"""The cheap look at every suspect: how the replay would change if it were there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Cause, Parameter
from reality_gap.inference.checkpoint import Checkpoint, Columns
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.study.system import System
from reality_gap.types import Floats

STEP = 0.25
"""Finite difference, in scales of a parameter: of what can just be seen."""
PART = 32
"""Suspects that are looked at between two notes of how far it is."""

NO_CHECKPOINT = Checkpoint(None, "")
_Trial = tuple[Candidate, dict[str, float], tuple[str, ...], tuple[float, ...]]


@dataclass(frozen=True)
class Sensitivity:
    """Change of the prediction by a suspect, linearised about the null.

    Attributes:
        suspect: a cause at a place.
        names: parameters that the columns belong to.
        fixed: values of the others, as the time of an event.
        columns: (n, p) change of the prediction in units of noise, per ``scale`` of a parameter;
            in single precision, for there are thousands.
    """

    candidate: Candidate
    names: tuple[str, ...]
    fixed: dict[str, float]
    columns: NDArray[np.float32]

    @property
    def change(self) -> float:
        """By how much three typical faults change the readings, all together [noise]."""
        return 3.0 * float(np.sqrt(np.max(np.sum(self.columns**2, axis=0), initial=0.0)))

    def values(self, theta: Floats) -> dict[str, float]:
        """Parameter values at ``theta`` (p,), in scales from the null, cut at the bounds."""
        found = dict(self.fixed)
        for name, x in zip(self.names, theta, strict=True):
            p = parameter(self.candidate, name)
            found[name] = float(np.clip(p.null + x * p.scale, p.low, p.high))
        return found

    def bounds(self) -> tuple[Floats, Floats]:
        """Bounds of theta (p,), (p,)."""
        chosen = [parameter(self.candidate, name) for name in self.names]
        ends = [sorted(((p.low - p.null) / p.scale, (p.high - p.null) / p.scale)) for p in chosen]
        low, high = np.array(ends).T
        return low, high


def parameter(candidate: Candidate, name: str) -> Parameter:
    """A suspect's parameter by its name."""
    return next(p for p in candidate.parameters if p.name == name)


def candidates(system: System, causes: Sequence[Cause], most: int = 8) -> tuple[Candidate, ...]:
    """Every cause at every place where it may act with at most so many parameters."""
    found = []
    for cause in causes:
        for location in cause.locations(system):
            parameters = cause.parameters(system, location)
            if len(parameters) <= most:
                found.append(Candidate(cause, location, parameters))
    return tuple(found)


def screen(
    replayer: Replayer,
    chosen: Sequence[Candidate],
    base: Hypothesis,
    before: Floats,
    checkpoint: Checkpoint = NO_CHECKPOINT,
    tell: Callable[[float], None] = lambda share: None,
) -> tuple[Sensitivity, ...]:
    """Sensitivities of all suspects, added to a hypothesis.

    Args:
        bench: replays.
        chosen: whom to look at.
        base: what is in the model already.
        before: (n,) residual of ``base``.
        shelf: keeps what was done, for after an interruption.
        tell: called with the share that is done.
    """
    # Differences between replays forgive a coarse time step.
    if replayer.coarse:
        before = replayer.residuals([base], True)[0]
    found = []
    for i in range(0, len(chosen), PART):
        trials = [trial for candidate in chosen[i : i + PART] for trial in _trials(candidate)]
        columns = checkpoint.get(i // PART, partial(_columns, replayer, trials, base, before))
        for (candidate, fixed, names, _), own in zip(trials, columns, strict=True):
            if np.all(np.isfinite(own)):
                found.append(Sensitivity(candidate, names, fixed, own))
        tell(min(1.0, (i + PART) / len(chosen)))
    return tuple(found)


def _columns(
    replayer: Replayer, trials: Sequence[_Trial], base: Hypothesis, before: Floats
) -> Columns:
    """Columns of each trial (n, p); what is idle costs no replay."""
    hypotheses = [
        [*base, (candidate, fixed | {name: value})]
        for candidate, fixed, names, values in trials
        for name, value in zip(names, values, strict=True)
        if not parameter(candidate, name).hints.shape
    ]
    residuals = iter(replayer.residuals(hypotheses, replayer.coarse))
    found = []
    for candidate, _, names, values in trials:
        columns = np.zeros((len(before), len(names)), dtype=np.float32)
        for i, (name, value) in enumerate(zip(names, values, strict=True)):
            if not parameter(candidate, name).hints.shape:
                columns[:, i] = (before - next(residuals)) / _scales(candidate, name, value)
        found.append(columns)
    return found


def _scales(candidate: Candidate, name: str, value: float) -> float:
    """How many scales a value is from the null."""
    p = parameter(candidate, name)
    return (value - p.null) / p.scale


def _trials(candidate: Candidate) -> list[_Trial]:
    """Which parameters to change, with which others held at one of their starts.

    A lone parameter with starts is looked at in secants to each of them, one with secants in these,
    too.
    """
    held = [p for p in candidate.parameters if p.hints.starts]
    free = [p for p in candidate.parameters if not p.hints.starts]
    if len(candidate.parameters) == len(held) == 1:
        lone = held[0]
        return [(candidate, {lone.name: lone.null}, (lone.name,), (x,)) for x in lone.hints.starts]
    if not free:
        free, held = held, []
    trials = []
    for starts in product(*(p.hints.starts for p in held)):
        fixed = dict(zip((p.name for p in held), starts, strict=True))
        rest = {p.name: p.null for p in free}
        names = tuple(p.name for p in free)
        trials.append(
            (candidate, rest | fixed, names, tuple(p.null + STEP * p.scale for p in free))
        )
    if len(candidate.parameters) == 1:
        lone = candidate.parameters[0]
        trials += [
            (candidate, {lone.name: lone.null}, (lone.name,), (x,)) for x in lone.hints.secants
        ]
    return trials


DRIFT_TOLERANCE = 0.1
"""By how much the error of the time step may differ from what was taken out, relatively."""


MUCH = 10.0
"""What a tolerance must do to all readings to be replayed exactly [noise]."""


def tolerances(replayer: Replayer, found: Sequence[Sensitivity], null: Floats) -> Floats:
    """What every honest drawing may be off by: (n, p), in units of noise.

    Parameters of single elements, for a group's are their sums; but friction, of which no wire is
    free, may differ in all of them at once. What is left of a large tolerance beside a column that
    is a little wrong looks like a fault, so that large ones are replayed: the tolerance itself, at
    the full time step. What the column is wrong by is one tolerance more, and does not take its
    place, for suspects are ranked by such columns.

    Args:
        bench: replays.
        found: sensitivities of all suspects.
        null: (n,) residual of the study's model.
    """
    steps = DRIFT_TOLERANCE * replayer.drift, replayer.drift_error
    drifts = [step / replayer.measured.noise for step in steps]
    allowed = list(allowances(found))
    columns = [column for _, _, column in allowed]
    large = [i for i, column in enumerate(columns) if np.linalg.norm(column) > MUCH]
    trials: list[Hypothesis] = []
    for candidate, p, _ in (allowed[i] for i in large):
        off = p.null + np.copysign(p.tolerance, p.scale)
        trials.append([(candidate, candidate.nulls() | {p.name: float(off)})])
    for i, residual in zip(large, replayer.residuals(trials), strict=True):
        if np.all(np.isfinite(residual)):
            columns.append(null - residual - columns[i])
    return np.column_stack([*drifts, *columns])


def allowances(found: Sequence[Sensitivity]) -> Iterator[tuple[Candidate, Parameter, Floats]]:
    """Everything that has a tolerance, with what it may do to the readings (n,) [noise]."""
    seen = set()
    for sensitivity in found:
        candidate = sensitivity.candidate
        key = (candidate.cause.id, candidate.location)
        if key in seen:
            continue
        seen.add(key)
        alone = len(candidate.location.elements) == 1
        for i, name in enumerate(sensitivity.names):
            p = parameter(candidate, name)
            if p.tolerance > 0 and (alone or p.usual):
                own = sensitivity.columns[:, i].astype(np.float64)
                yield candidate, p, own * (p.tolerance / abs(p.scale))
