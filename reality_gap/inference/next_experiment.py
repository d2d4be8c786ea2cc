"""The next experiment: the feasible motion on which the remaining rivals part the most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from reality_gap.causes.base import Parameter
from reality_gap.diagnosis import Experiment
from reality_gap.inference.confidence import TEMPER
from reality_gap.inference.equivalence import Alternatives
from reality_gap.inference.gauss_newton import STEP, Fit, at
from reality_gap.inference.motions import PERIOD, SECONDS, Motion, motions
from reality_gap.inference.screening import Sensitivity, allowances
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.study.data import Episode, Reading, Study
from reality_gap.study.measurements import channel_noise
from reality_gap.types import Floats

TRIED = 6.0
"""How much of each candidate is replayed, to choose among them [s]."""
RIVALS = 3
HELD = 0.5
"""Share of the evidence that a motion promises which real ones hold, about: it is linear."""
SLACK = 20
"""How much of what every drawing is off by is weighed: that which looks most like the rivals."""


def next_experiment(
    replayer: Replayer,
    fitted_candidates: Sequence[Alternatives],
    found: Sequence[Sensitivity],
    null: Floats,
    unmodelled: float = 0.0,
) -> Experiment | None:
    """The motion that best separates the likeliest rivals of the least certain cause.

    That there is none of them is a rival, too. None where there are no rivals, or no motion is
    likely to halve the doubt between them.

    Args:
        bench: replays.
        rivals: of each cause.
        found: sensitivities of all suspects, by which what every drawing is off by is known.
        null: (n,) residual of the study's model.
        nameless: confidence that it is something without a name, which no motion promises to tell.
    """
    known = replayer.system.study
    if not fitted_candidates or known.inverse:
        return None
    unsure = min(fitted_candidates, key=lambda a: float(a.confidence.max()))
    order = np.argsort(-unsure.confidence)[:RIVALS]
    nobody = unsure.without or Fit([], null, np.zeros((len(null), 0)), np.zeros(0), 0.0)
    fits = [*(unsure.tried[i] for i in order), nobody]
    nobodys = max(0.0, 1.0 - unsure.confidence.sum() - unmodelled)
    chances = np.append(unsure.confidence[order], nobodys)
    second = fits[1 + int(np.argmax(chances[1:]))]
    slack = _confusing(found, second.residual - fits[0].residual)
    here = _known(fits, [column for _, _, column in slack])
    before = distances(len(fits), here)

    def together(motion: Motion, seconds: float) -> Floats:
        there = _foreseen(replayer, _as_study(known, motion, seconds), fits, slack)
        return distances(len(fits), here, there)

    def mean(apart: Floats) -> float:
        return float(np.average(apart, weights=np.maximum(chances[1:], 1e-12)))

    motion = max(motions(known), key=lambda motion: mean(together(motion, TRIED)))
    after = together(motion, SECONDS)
    promised = (after**2 - before**2) / 2
    # Who is not replayed is further away than the nearest of those who are.
    others = float(unsure.confidence.sum() - unsure.confidence[order].sum())
    if not halves(np.append(chances, others), np.append(promised, promised.min())):
        return None
    one = fits[0].candidates[-1]
    alone = f"shows whether {one} is there"
    aim = alone if second is nobody else f"tells {one} from {second.candidates[-1]}"
    return Experiment(
        title=motion.title,
        sentence=f"Command {motion.title} for {SECONDS:.0f} s: it best {aim}.",
        time=PERIOD * np.arange(len(motion.command), dtype=np.float64),
        command=motion.command,
        separation=mean(after),
        separation_before=mean(before),
    )


def halves(chances: Floats, evidence: Floats) -> bool:
    """Whether an experiment is likely to halve the entropy of the confidences.

    Args:
        chances: confidence of each rival (k,), the one that is to be confirmed first. What they
            leave to one is of those that it tells nothing of.
        evidence: that the experiment promises against each of the others (k - 1,) [nats].
    """
    rest = max(0.0, 1.0 - float(chances.sum()))
    promised = np.concatenate([[0.0], HELD * evidence])
    after = np.append(chances * np.exp(-promised / TEMPER), rest)
    return _entropy(after) <= 0.5 * _entropy(np.append(chances, rest))


def _entropy(weights: Floats) -> float:
    shares = weights[weights > 0] / weights.sum()
    return float(-np.sum(shares * np.log(shares)))


_Slack = list[tuple[Candidate, Parameter, Floats]]


@dataclass(frozen=True)
class Apart:
    """What tells the others from the likeliest of the rivals in a study, all in units of noise.

    Attributes:
        gaps: (n,) of each other's prediction from the likeliest's.
        slopes: (n, p) of each other's prediction by its parameters.
        slack: (n, s) what every drawing is off by.
    """

    gaps: Sequence[Floats]
    slopes: Sequence[Floats]
    slack: Floats


def _confusing(found: Sequence[Sensitivity], gap: Floats) -> _Slack:
    """What every drawing is off by that looks most like the gap (n,) between two rivals."""
    listed = sorted(allowances(found), key=lambda item: -abs(float(item[2] @ gap)))
    return listed[:SLACK]


def _as_study(study: Study, motion: Motion, seconds: float) -> Study:
    """The motion's first seconds as an episode, read as often as the study's channels were."""
    command = motion.command[: round(seconds / PERIOD)]
    time = PERIOD * np.arange(len(command), dtype=np.float64)
    longest = max(study.episodes, key=lambda e: e.duration)
    readings = []
    for reading in longest.readings:
        period = float(np.median(np.diff(reading.time))) if len(reading.time) > 1 else seconds
        times = np.arange(0.0, time[-1], period)
        readings.append(Reading(times, np.zeros(len(times))))
    noise = [float(n) for n in channel_noise(study)]
    channels = tuple(replace(c, noise=n) for c, n in zip(study.channels, noise, strict=True))
    episode = Episode(motion.title, time, command, tuple(readings), longest.joints)
    return replace(study, channels=channels, episodes=(episode,))


def _known(fits: Sequence[Fit], slack: Sequence[Floats]) -> Apart:
    """Of the study at hand."""
    gaps = [other.residual - fits[0].residual for other in fits[1:]]
    slopes = [other.jacobian for other in fits[1:]]
    return Apart(gaps, slopes, _columns(len(gaps[0]), slack))


def _foreseen(replayer: Replayer, study: Study, fits: Sequence[Fit], slack: _Slack) -> Apart:
    """Of one that nobody has made yet."""
    asked: list[Hypothesis] = [[], fits[0].hypothesis]
    asked += [
        [(candidate, candidate.nulls() | {p.name: p.null + STEP * p.scale})]
        for candidate, p, _ in slack
    ]
    for fit in fits[1:]:
        asked.append(fit.hypothesis)
        asked += [at(fit.hypothesis, fit.theta + STEP * axis) for axis in np.eye(len(fit.theta))]
    found = iter(replayer.predictions(study, asked))
    null, first = next(found), next(found)
    off = [(next(found) - null) * (p.tolerance / abs(STEP * p.scale)) for _, p, _ in slack]
    gaps, slopes = list[Floats](), list[Floats]()
    for fit in fits[1:]:
        other = next(found)
        gaps.append(first - other)
        slopes.append(_columns(len(first), [(next(found) - other) / STEP for _ in fit.theta]))
    return Apart(gaps, slopes, _columns(len(first), off))


def _columns(rows: int, columns: Sequence[Floats]) -> Floats:
    """Side by side (rows, k), though there may be none."""
    return np.column_stack([np.zeros((rows, 0)), *columns])


def distances(count: int, *studies: Apart) -> Floats:
    """Distance of each other from the likeliest of ``count`` rivals (count - 1,) [noise].

    In all studies together, but those where a replay failed. The others' parameters adapt, and so
    does what every drawing is off by, at the price of its tolerance.
    """
    found = []
    for k in range(count - 1):
        parts = [np.column_stack([s.gaps[k], s.slopes[k], s.slack]) for s in studies]
        rows = np.vstack([part for part in parts if np.all(np.isfinite(part))])
        free = studies[0].slopes[k].shape[1]
        price = np.eye(rows.shape[1])[1 + free :]
        gap, *columns = np.vstack([rows, price]).T
        matrix = _columns(len(gap), columns)
        left = gap - matrix @ np.linalg.lstsq(matrix, gap, rcond=None)[0]
        found.append(float(np.linalg.norm(left)))
    return np.array(found)
