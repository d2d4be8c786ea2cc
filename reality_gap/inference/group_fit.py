"""A machine that is a little wrong everywhere: groups of causes, fitted together at rest.

No single cause explains such a machine, and the search for one after the other would end after
three. What many small errors do together is most of the gap between a drawing and a machine that
was built by hand.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause
from reality_gap.diagnosis import Diagnosis, Estimate, NamedCause, Rival, Verdict, sentence
from reality_gap.inference.groups import Group, find_groups, noise_at_rest, positions_at
from reality_gap.inference.held_out import score
from reality_gap.inference.remainder import dependences
from reality_gap.inference.static_fit import Noise, Settled, fit_at_rest
from reality_gap.inference.traces import traces
from reality_gap.inference.verdict import at_bound
from reality_gap.simulation.hypothesis import Suspect, acts_beside
from reality_gap.simulation.replayer import Hypothesis, Part, Workbench
from reality_gap.simulation.statics import Statics
from reality_gap.study.measurements import Measured, channel_noise
from reality_gap.study.splits import REPORT, split
from reality_gap.study.static_poses import find_moments

Array = NDArray[np.float64]
Tell = Callable[[str], None]

FEWEST = 8
"""Moments of rest without which groups are not fitted."""
BETTER = 0.5
"""Groups stand if they leave less than this share of the power of anything else."""
AGAIN = 3
"""Steps of the fit without a group, from the fit with it."""
UNASKED = "what is a little wrong everywhere hides single causes"
WIDE = 1.96
"""Half of a 95 % interval, in standard deviations."""


@dataclass(frozen=True)
class Whole:
    """Groups that were fitted, and that stand.

    Attributes:
        named: one cause a group, the most certain first.
        rivals: every suspect of every group with its values.
        hypothesis: all suspects with their values.
        residual: (n,) of all readings, in units of sensor noise, from a replay of the whole log.
        power: of it, on the report split.
        moments: how many moments of rest served.
    """

    named: tuple[NamedCause, ...]
    rivals: tuple[Rival, ...]
    hypothesis: list[Part]
    residual: Array
    power: float
    moments: int


def power(measured: Measured, residual: Array) -> float:
    """Mean square of a residual (n,) on the report split; infinite where the replay diverged."""
    mean = float(np.mean(residual[split(measured) == REPORT] ** 2))
    return mean if np.isfinite(mean) else np.inf


def explain(
    bench: Workbench,
    causes: Sequence[Cause],
    best: Array,
    large: float,
    tell: Tell = lambda what: None,
) -> Whole | None:
    """Fit groups of causes; None where there is no need or no way to, or where they are no better.

    As for single causes, no name holds with a parameter at its bound, or without a gain on held-out
    readings.

    Args:
        bench: replays.
        causes: the catalogue.
        best: (n,) residual of the best hypothesis so far, in units of sensor noise.
        large: RMS of ``best`` from which on it is worth the time [noise].
        tell: called with what is being done.
    """
    before = power(bench.measured, best)
    if not large**2 <= before < np.inf:
        return None
    moments = find_moments(bench.system.study)
    if len(moments) < FEWEST:
        return None
    groups = find_groups(bench.system, causes)
    if not groups:
        return None
    table = _Table(bench, groups, tell)
    found = table.fit(f"fitting {table.count} parameters at {len(moments)} moments of rest")
    residual = bench.residual(found.hypothesis)
    after = power(bench.measured, residual)
    if not after < BETTER * before or at_bound(found.hypothesis):
        return None
    if not score(bench.system.study, bench.measured, best, residual).pays:
        return None
    worse = [_worse(table, found, group, after, len(moments)) for group in groups]
    named = [_name(g, found, w) for g, w in zip(groups, worse, strict=True)]
    return Whole(
        named=tuple(sorted(named, key=lambda cause: -cause.confidence)),
        rivals=_rivals(groups, found, worse),
        hypothesis=found.hypothesis,
        residual=residual,
        power=after,
        moments=len(moments),
    )


class _Table:
    """Where groups are fitted, with some left out."""

    def __init__(self, bench: Workbench, groups: Sequence[Group], tell: Tell) -> None:
        self.bench, self._tell = bench, tell
        study = bench.system.study
        moments = find_moments(study)
        self._statics = Statics(bench.system, moments)
        self._qpos = positions_at(moments, bench.look([]))
        self._noise: Noise = noise_at_rest(
            bench.system, self._statics, channel_noise(study), self._qpos
        )
        self._suspects = [suspect for group in groups for suspect in group.suspects]
        self.count = sum(len(suspect.parameters) for suspect in self._suspects)

    def fit(self, what: str) -> Settled:
        """All groups, from null."""
        start = [(suspect, suspect.nulls()) for suspect in self._suspects]
        return self._fit(start, what, {})

    def without(self, found: Settled, group: Group) -> list[Part]:
        """The others without a group, from where they stand with it."""
        start = [part for part in found.hypothesis if part[0] not in group.suspects]
        what = f"fitting without {group.suspects[0].cause.title}"
        return self._fit(start, what, {"rounds": AGAIN}).hypothesis

    def _fit(self, start: Hypothesis, what: str, more: dict[str, int]) -> Settled:
        def tick(number: int) -> None:
            self._tell(f"{what}, step {number}")

        self._tell(what)
        system = self.bench.system
        return fit_at_rest(system, self._statics, start, self._qpos, self._noise, tick=tick, **more)


def _worse(table: _Table, found: Settled, group: Group, after: float, moments: int) -> float:
    """How much less likely the log is without a group [nats].

    The residual's size is what the best fit leaves, and a moment of rest counts once: what is left
    over is the same error over and over, in every reading of a moment.
    """
    bench = table.bench
    without = power(bench.measured, bench.residual(table.without(found, group)))
    return 0.5 * moments * float(np.log(min(without / after, 1e6)))


def _confidence(worse: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(worse, -50.0, 50.0))))


def _name(group: Group, found: Settled, worse: float) -> NamedCause:
    parameters = {}
    for (suspect, values), sizes in zip(found.hypothesis, found.deviation, strict=True):
        if suspect in group.suspects:
            for p in suspect.parameters:
                low, high = (values[p.name] + s * WIDE * sizes[p.name] for s in (-1.0, 1.0))
                parameters[group.label(suspect, p.name)] = Estimate(
                    values[p.name], max(low, p.low), min(high, p.high), p.unit
                )
    return NamedCause(group.named(), parameters, _confidence(worse), ())


def _rivals(groups: Sequence[Group], found: Settled, worse: Sequence[float]) -> tuple[Rival, ...]:
    values: dict[Suspect, dict[str, float]] = {s: dict(v) for s, v in found.hypothesis}
    return tuple(
        Rival(suspect, values[suspect], nats, _confidence(nats), step, chosen=True)
        for step, (group, nats) in enumerate(zip(groups, worse, strict=True))
        for suspect in group.suspects
    )


def of_groups(bench: Workbench, whole: Whole, null: Array, begin: float) -> Diagnosis:
    """The diagnosis of a machine that groups of causes explain.

    Args:
        bench: replays.
        whole: the groups.
        null: (n,) residual of the study's model, in units of sensor noise.
        begin: when the diagnosis began, by `time.monotonic`.
    """
    system, residual = bench.system, whole.residual
    scored = score(system.study, bench.measured, null, residual)
    named = {cause.suspect.cause.id for cause in whole.named}
    diagnosis = Diagnosis(
        study=system.study.name,
        verdict=Verdict.NAMED,
        sentence="",
        causes=whole.named,
        rivals=whole.rivals,
        rms_before=scored.before,
        rms_after=scored.after,
        noise_floor=scored.floor,
        gain=scored.gain,
        unexplained_fraction=scored.unexplained,
        explainable_fraction=1.0 - scored.unexplained,
        depends_on=dependences(bench, residual, bench.look(whole.hypothesis).records),
        next_experiment=None,
        not_judged=tuple((name, UNASKED) for name in CATALOGUE if name not in named),
        traces=traces(bench, null, residual),
        effects=tuple(part for part in whole.hypothesis if acts_beside(system, *part)),
        extended_xml=bench.machine(whole.hypothesis).spec.to_xml(),
        seconds=time.monotonic() - begin,
        measures={"causes": float(len(whole.named)), "moments": float(whole.moments)},
    )
    return replace(diagnosis, sentence=sentence(diagnosis))
