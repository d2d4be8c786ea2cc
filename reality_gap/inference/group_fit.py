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

from reality_gap.causes import CATALOGUE
from reality_gap.causes.base import Cause
from reality_gap.diagnosis import (
    Diagnosis,
    Estimate,
    FittedCandidate,
    NamedCause,
    Verdict,
    sentence,
)
from reality_gap.inference.groups import Group, find_groups, noise_at_rest, positions_at
from reality_gap.inference.held_out import pays, score
from reality_gap.inference.remainder import dependences
from reality_gap.inference.static_fit import Noise, Settled, fit_at_rest
from reality_gap.inference.traces import traces
from reality_gap.inference.verdict import at_bound
from reality_gap.simulation.hypothesis import Candidate, acts_beside
from reality_gap.simulation.replayer import Hypothesis, Part, Replayer
from reality_gap.simulation.statics import Statics
from reality_gap.study.measurements import Measured, channel_noise
from reality_gap.study.splits import REPORT, split
from reality_gap.study.static_poses import find_moments
from reality_gap.types import Floats

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
    fitted_candidates: tuple[FittedCandidate, ...]
    hypothesis: list[Part]
    residual: Floats
    power: float
    moments: int


def power(measured: Measured, residual: Floats) -> float:
    """Mean square of a residual (n,) on the report split; infinite where the replay diverged."""
    mean = float(np.mean(residual[split(measured) == REPORT] ** 2))
    return mean if np.isfinite(mean) else np.inf


def explain(
    replayer: Replayer,
    causes: Sequence[Cause],
    best: Floats,
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
    before = power(replayer.measured, best)
    if not large**2 <= before < np.inf:
        return None
    moments = find_moments(replayer.system.study)
    if len(moments) < FEWEST:
        return None
    groups = find_groups(replayer.system, causes)
    if not groups:
        return None
    table = _Table(replayer, groups, tell)
    found = table.fit(f"fitting {table.count} parameters at {len(moments)} moments of rest")
    residual = replayer.residual(found.hypothesis)
    after = power(replayer.measured, residual)
    if not after < BETTER * before or at_bound(found.hypothesis):
        return None
    if not pays(score(replayer.system.study, replayer.measured, best, residual).improvement):
        return None
    worse = [_worse(table, found, group, after, len(moments)) for group in groups]
    named = [_name(g, found, w) for g, w in zip(groups, worse, strict=True)]
    return Whole(
        named=tuple(sorted(named, key=lambda cause: -cause.confidence)),
        fitted_candidates=_fitted_candidates(groups, found, worse),
        hypothesis=found.hypothesis,
        residual=residual,
        power=after,
        moments=len(moments),
    )


class _Table:
    """Where groups are fitted, with some left out."""

    def __init__(self, replayer: Replayer, groups: Sequence[Group], tell: Tell) -> None:
        self.replayer, self._tell = replayer, tell
        study = replayer.system.study
        moments = find_moments(study)
        self._statics = Statics(replayer.system, moments)
        self._qpos = positions_at(moments, replayer.look([]))
        self._noise: Noise = noise_at_rest(
            replayer.system, self._statics, channel_noise(study), self._qpos
        )
        self._candidates = [candidate for group in groups for candidate in group.candidates]
        self.count = sum(len(candidate.parameters) for candidate in self._candidates)

    def fit(self, what: str) -> Settled:
        """All groups, from null."""
        start = [(candidate, candidate.nulls()) for candidate in self._candidates]
        return self._fit(start, what, {})

    def without(self, found: Settled, group: Group) -> list[Part]:
        """The others without a group, from where they stand with it."""
        start = [part for part in found.hypothesis if part[0] not in group.candidates]
        what = f"fitting without {group.candidates[0].cause.title}"
        return self._fit(start, what, {"rounds": AGAIN}).hypothesis

    def _fit(self, start: Hypothesis, what: str, more: dict[str, int]) -> Settled:
        def tick(number: int) -> None:
            self._tell(f"{what}, step {number}")

        self._tell(what)
        system = self.replayer.system
        return fit_at_rest(system, self._statics, start, self._qpos, self._noise, tick=tick, **more)


def _worse(table: _Table, found: Settled, group: Group, after: float, moments: int) -> float:
    """How much less likely the log is without a group [nats].

    The residual's size is what the best fit leaves, and a moment of rest counts once: what is left
    over is the same error over and over, in every reading of a moment.
    """
    replayer = table.replayer
    without = power(replayer.measured, replayer.residual(table.without(found, group)))
    return 0.5 * moments * float(np.log(min(without / after, 1e6)))


def _confidence(worse: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(worse, -50.0, 50.0))))


def _name(group: Group, found: Settled, worse: float) -> NamedCause:
    parameters = {}
    for (candidate, values), sizes in zip(found.hypothesis, found.deviation, strict=True):
        if candidate in group.candidates:
            for p in candidate.parameters:
                low, high = (values[p.name] + s * WIDE * sizes[p.name] for s in (-1.0, 1.0))
                parameters[group.label(candidate, p.name)] = Estimate(
                    values[p.name], max(low, p.low), min(high, p.high), p.unit
                )
    return NamedCause(group.named(), parameters, _confidence(worse), ())


def _fitted_candidates(
    groups: Sequence[Group], found: Settled, worse: Sequence[float]
) -> tuple[FittedCandidate, ...]:
    values: dict[Candidate, dict[str, float]] = {s: dict(v) for s, v in found.hypothesis}
    return tuple(
        FittedCandidate(candidate, values[candidate], nats, _confidence(nats), step, chosen=True)
        for step, (group, nats) in enumerate(zip(groups, worse, strict=True))
        for candidate in group.candidates
    )


def of_groups(replayer: Replayer, whole: Whole, null: Floats, begin: float) -> Diagnosis:
    """The diagnosis of a machine that groups of causes explain.

    Args:
        bench: replays.
        whole: the groups.
        null: (n,) residual of the study's model, in units of sensor noise.
        begin: when the diagnosis began, by `time.monotonic`.
    """
    system, residual = replayer.system, whole.residual
    scored = score(system.study, replayer.measured, null, residual)
    named = {cause.candidate.cause.id for cause in whole.named}
    diagnosis = Diagnosis(
        study=system.study.name,
        verdict=Verdict.NAMED,
        sentence="",
        causes=whole.named,
        fitted_candidates=whole.fitted_candidates,
        rms_before=scored.before,
        rms_after=scored.after,
        noise_floor=scored.floor,
        gain=scored.gain,
        unexplained_fraction=scored.unexplained,
        explainable_fraction=1.0 - scored.unexplained,
        depends_on=dependences(replayer, residual, replayer.look(whole.hypothesis).records),
        next_experiment=None,
        not_judged=tuple((name, UNASKED) for name in CATALOGUE if name not in named),
        traces=traces(replayer, null, residual),
        effects=tuple(part for part in whole.hypothesis if acts_beside(system, *part)),
        extended_xml=replayer.machine(whole.hypothesis).spec.to_xml(),
        seconds=time.monotonic() - begin,
        measures={"causes": float(len(whole.named)), "moments": float(whole.moments)},
    )
    return replace(diagnosis, sentence=sentence(diagnosis))
