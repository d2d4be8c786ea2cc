"""Group fit: groups of causes for a machine that is slightly wrong everywhere, fitted at rest.

No single cause explains such a machine, and a search that adds one cause after the other would end
after three. Many small errors together make up most of the gap between a nominal model and a
machine that was built by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from reality_gap.causes.base import Cause
from reality_gap.diagnosis import Doubt, Estimate, FittedCandidate, NamedCause
from reality_gap.inference.groups import Group, find_groups, noise_at_rest, positions_at
from reality_gap.inference.held_out import score
from reality_gap.inference.paying import at_bound
from reality_gap.inference.static_fit import ROUNDS, StaticFit, fit_at_rest
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, Part
from reality_gap.simulation.replayer import Replayer
from reality_gap.simulation.statics import Statics
from reality_gap.study.measurements import Measured, channel_noise
from reality_gap.study.splits import REPORT, split
from reality_gap.study.static_poses import find_moments
from reality_gap.types import Floats

Progress = Callable[[str], None]
"""Called with what is being done."""

FEWEST = 8
"""Number of moments of rest below which groups are not fitted."""
BETTER = 0.5
"""Share of the power that anything else leaves, below which the remainder of groups must be."""
AGAIN = 3
"""Largest number of steps of the fit without a group, from the fit with it."""
WIDE = 1.96
"""Half of a 95 % interval, in standard deviations."""
WITHOUT = "none of these errors, because the other groups explain the readings as well"
"""What lowers the confidence of a group."""


@dataclass(frozen=True)
class GroupFit:
    """Groups that explain a log.

    Attributes:
        causes: one cause for each group, the most certain first.
        fitted_candidates: all candidates of all groups with their values.
        hypothesis: all candidates with their values.
        covariance: of the parameters of all candidates as theta, shape (p, p).
        residual: residual of a replay of the whole log in units of sensor noise, shape (n,).
        power: mean square of the residual on the report split.
        moments: number of moments of rest.
    """

    causes: tuple[NamedCause, ...]
    fitted_candidates: tuple[FittedCandidate, ...]
    hypothesis: list[Part]
    covariance: Floats
    residual: Floats
    power: float
    moments: int


def power(measured: Measured, residual: Floats) -> float:
    """Return the mean square of a residual on the report split; infinite if the replay diverged.

    Args:
        measured: the readings.
        residual: residual in units of sensor noise, shape (n,).
    """
    mean = float(np.mean(residual[split(measured) == REPORT] ** 2))
    return mean if np.isfinite(mean) else np.inf


def fit_groups(
    replayer: Replayer,
    causes: Sequence[Cause],
    best: Floats,
    large: float,
    progress: Progress = lambda text: None,
) -> GroupFit | None:
    """Fit groups of causes.

    Like single causes, groups are not named with a parameter at its bound, or without a gain on the
    report split.

    Args:
        replayer: replays of the study.
        causes: causes of the catalogue.
        best: residual of the best hypothesis so far in units of sensor noise, shape (n,).
        large: RMS of ``best`` from which on groups are fitted [noise].
        progress: called with what is being done.

    Returns:
        The groups; None if they are not needed, cannot be fitted, or are not better than ``best``.
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
    fitter = _Fitter(replayer, groups, progress)
    found = fitter.fit_all()
    residual = replayer.residual(found.hypothesis)
    after = power(replayer.measured, residual)
    if not after < BETTER * before or at_bound(found.hypothesis):
        return None
    scored = score(replayer.system.study, replayer.measured, best, residual)
    if scored.improvement.low <= 0.0:
        return None
    evidence = [_evidence(fitter, found, group, after) for group in groups]
    named = [_name(g, found, nats) for g, nats in zip(groups, evidence, strict=True)]
    return GroupFit(
        causes=tuple(sorted(named, key=lambda cause: -cause.confidence)),
        fitted_candidates=_fitted_candidates(groups, found, evidence),
        hypothesis=found.hypothesis,
        covariance=found.covariance,
        residual=residual,
        power=after,
        moments=len(moments),
    )


class _Fitter:
    """Fits all groups, or all but one."""

    def __init__(self, replayer: Replayer, groups: Sequence[Group], progress: Progress) -> None:
        self.replayer, self._progress = replayer, progress
        study = replayer.system.study
        self.moments = find_moments(study)
        self._statics = Statics(replayer.system, self.moments)
        self._qpos = positions_at(self.moments, replayer.replay([]))
        noise = channel_noise(study)
        self._noise = noise_at_rest(replayer.system, self._statics, noise, self._qpos)
        self._candidates = [candidate for group in groups for candidate in group.candidates]

    def fit_all(self) -> StaticFit:
        """Fit all groups, from the null."""
        start = [(candidate, candidate.null_values()) for candidate in self._candidates]
        count = sum(len(candidate.parameters) for candidate in self._candidates)
        text = f"fitting {count} parameters at {len(self.moments)} moments of rest"
        return self._fit(start, text, ROUNDS)

    def fit_without(self, found: StaticFit, group: Group) -> list[Part]:
        """Fit the other groups, from their fit with this group."""
        start = [part for part in found.hypothesis if part[0] not in group.candidates]
        text = f"fitting without {group.candidates[0].cause.title}"
        return self._fit(start, text, AGAIN).hypothesis

    def _fit(self, start: Hypothesis, text: str, rounds: int) -> StaticFit:
        def tick(number: int) -> None:
            self._progress(f"{text}, step {number}")

        self._progress(text)
        system = self.replayer.system
        return fit_at_rest(system, self._statics, start, self._qpos, self._noise, rounds, tick)


def _evidence(fitter: _Fitter, found: StaticFit, group: Group, after: float) -> float:
    """Return how much a group adds to the log likelihood [nats].

    The variance is what the best fit leaves (``after``). A moment of rest counts once, because the
    errors of its readings are the same throughout.
    """
    replayer = fitter.replayer
    without = power(replayer.measured, replayer.residual(fitter.fit_without(found, group)))
    return 0.5 * len(fitter.moments) * float(np.log(min(without / after, 1e6)))


def _confidence(evidence: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(evidence, -50.0, 50.0))))


def _name(group: Group, found: StaticFit, evidence: float) -> NamedCause:
    """Return a group as a cause of the verdict."""
    parameters = {}
    for (candidate, values), sizes in zip(found.hypothesis, found.deviation, strict=True):
        if candidate in group.candidates:
            for p in candidate.parameters:
                low, high = (values[p.name] + s * WIDE * sizes[p.name] for s in (-1.0, 1.0))
                parameters[group.label(candidate, p.name)] = Estimate(
                    values[p.name], max(low, p.low), min(high, p.high), p.unit
                )
    confidence = _confidence(evidence)
    doubts = (Doubt(WITHOUT, 1.0 - confidence),) if confidence < 1.0 else ()
    return NamedCause(group.merged(), parameters, confidence, (), doubts=doubts)


def _fitted_candidates(
    groups: Sequence[Group], found: StaticFit, evidence: Sequence[float]
) -> tuple[FittedCandidate, ...]:
    values: dict[Candidate, dict[str, float]] = {s: dict(v) for s, v in found.hypothesis}
    return tuple(
        FittedCandidate(candidate, values[candidate], nats, _confidence(nats), step, True, nats)
        for step, (group, nats) in enumerate(zip(groups, evidence, strict=True))
        for candidate in group.candidates
    )
