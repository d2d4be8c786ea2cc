"""Next experiment: the feasible motion that separates the remaining hypotheses best.

Two hypotheses are separated by the distance of their predictions in units of noise, after the
parameters of the less likely one and the tolerances of the nominal model were adapted to make it
small. The slopes of parameters and tolerances are finite differences, so that the distance is that
of a linear least-squares problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from reality_gap.diagnosis import Experiment
from reality_gap.inference.confidence import TEMPER
from reality_gap.inference.equivalence import Alternatives
from reality_gap.inference.gauss_newton import STEP, Fit
from reality_gap.inference.motions import PERIOD, SECONDS, TIGHTER, Motion, motions
from reality_gap.inference.problem import Problem
from reality_gap.inference.screening import Sensitivity
from reality_gap.inference.theta import with_theta
from reality_gap.inference.tolerances import Tolerance, list_tolerances
from reality_gap.simulation.hypothesis import Hypothesis
from reality_gap.study.data import Episode, Reading, Study
from reality_gap.study.measurements import channel_noise
from reality_gap.study.system import System
from reality_gap.types import Floats

TRIED = 6.0
"""How much of each motion is replayed to select one of them [s]."""
MOST = 3
"""Largest number of candidates that are compared."""
HELD = 0.5
"""Share of the linearly predicted evidence that a real motion reaches, about."""
LITTLE = 0.01
"""Probability of the other hypotheses together below which there is no doubt to halve."""
CONFUSING = 20
"""Number of tolerances that are adapted: those that resemble the gap between hypotheses most."""


def next_experiment(
    problem: Problem,
    fitted: Sequence[Alternatives],
    sensitivities: Sequence[Sensitivity],
    unmodelled: float = 0.0,
) -> Experiment | None:
    """Return the motion that best separates the alternatives to the least certain cause.

    The hypothesis without that cause is one of them.

    Args:
        problem: what is to be explained.
        fitted: alternatives to each cause.
        sensitivities: of all candidates; they hold the tolerances of the nominal model.
        unmodelled: probability that the cause is not in the catalogue, on which no motion decides.

    Returns:
        The experiment; None if there are no causes, if nothing can be commanded, if there is hardly
            any doubt, or if no motion is likely to halve it.
    """
    study = problem.system.study
    if not fitted or study.inverse or not problem.system.model.nu:
        return None
    compared = _compare(problem, fitted, sensitivities, unmodelled)
    # A candidate that is not compared is farther away than the nearest of those that are.
    probability = np.append(compared.probability, compared.others)
    if not is_in_doubt(probability):
        return None
    tried = feasible_motions(problem.system)
    motion = max(tried, key=lambda m: compared.mean(compared.with_motion(m, TRIED)))
    before, after = distances(compared.known), compared.with_motion(motion, SECONDS)
    gained = (after**2 - before**2) / 2
    if not halves_doubt(probability, np.append(gained, gained.min())):
        return None
    return Experiment(
        title=motion.title,
        sentence=f"Command {motion.title} for {SECONDS:.0f} s: it best {compared.aim()}.",
        time=PERIOD * np.arange(len(motion.command), dtype=np.float64),
        command=motion.command,
        separation=compared.mean(after),
        separation_before=compared.mean(before),
    )


def feasible_motions(system: System) -> tuple[Motion, ...]:
    """Return motions through commands of a study; tighter tendons only where there are tendons."""
    found = motions(system.study)
    return found if system.tendons else found[:: len(TIGHTER)]


def is_in_doubt(probability: Floats) -> bool:
    """Return whether the first of some hypotheses is in doubt because of the others.

    Args:
        probability: see `halves_doubt`.
    """
    return bool(probability[1:].sum() > LITTLE)


def halves_doubt(probability: Floats, evidence: Floats) -> bool:
    """Return whether an experiment is likely to halve the entropy of the confidences.

    Where there is hardly any doubt, there is nothing to halve.

    Args:
        probability: confidence of each hypothesis, the one to be confirmed first, shape (k,). The
            rest to 1 is that of hypotheses on which the experiment does not decide.
        evidence: predicted evidence of the experiment against each of the others, shape (k - 1,)
            [nats].
    """
    if not is_in_doubt(probability):
        return False
    rest = max(0.0, 1.0 - float(probability.sum()))
    predicted = np.concatenate([[0.0], HELD * evidence])
    after = np.append(probability * np.exp(-predicted / TEMPER), rest)
    return _entropy(after) <= 0.5 * _entropy(np.append(probability, rest))


def _entropy(weights: Floats) -> float:
    shares = weights[weights > 0] / weights.sum()
    return float(-np.sum(shares * np.log(shares)))


@dataclass(frozen=True)
class Separation:
    """What separates other hypotheses from the likeliest one in a study, in units of noise.

    Attributes:
        gaps: difference of each prediction from that of the likeliest, shape (n,) each.
        slopes: change of each prediction per scale of its parameters, shape (n, p) each.
        tolerances: change of the readings by tolerances, shape (n, s).
    """

    gaps: Sequence[Floats]
    slopes: Sequence[Floats]
    tolerances: Floats


def distances(*studies: Separation) -> Floats:
    """Return the distance of each other hypothesis from the likeliest, shape (k,) [noise].

    It is that in all studies together, except those in which a replay diverged. Parameters of the
    other hypothesis adapt freely, tolerances with a penalty.
    """
    found = []
    for k in range(len(studies[0].gaps)):
        parts = [np.column_stack([s.gaps[k], s.slopes[k], s.tolerances]) for s in studies]
        rows = np.vstack([part for part in parts if np.all(np.isfinite(part))])
        free = studies[0].slopes[k].shape[1]
        penalty = np.eye(rows.shape[1])[1 + free :]
        gap, *columns = np.vstack([rows, penalty]).T
        matrix = _stack(len(gap), columns)
        left = gap - matrix @ np.linalg.lstsq(matrix, gap, rcond=None)[0]
        found.append(float(np.linalg.norm(left)))
    return np.array(found)


@dataclass(frozen=True)
class _Comparison:
    """The likeliest alternatives to a cause, and what separates them.

    Attributes:
        problem: what is to be explained.
        fits: the likeliest hypotheses, best first, and last the one without the cause.
        probability: of each, shape (k,).
        others: probability of all other candidates.
        tolerances: tolerances that resemble the gap between the two likeliest hypotheses.
        known: what separates the hypotheses in the study.
    """

    problem: Problem
    fits: Sequence[Fit]
    probability: Floats
    others: float
    tolerances: Sequence[Tolerance]
    known: Separation

    def with_motion(self, motion: Motion, seconds: float) -> Floats:
        """Return the distances in the study and the first seconds of a motion together."""
        study = motion_study(self.problem.system.study, motion, seconds)
        return distances(self.known, self._predict(study))

    def mean(self, distance: Floats) -> float:
        """Return the mean distance, weighted by the probability of the other hypotheses."""
        return float(np.average(distance, weights=np.maximum(self.probability[1:], 1e-12)))

    def aim(self) -> str:
        """Return what the experiment is to decide."""
        first, second = self.fits[0].candidates[-1], _second(self.fits, self.probability)
        if second is self.fits[-1]:
            return f"shows whether {first} is there"
        return f"distinguishes {first} from {second.candidates[-1]}"

    def _predict(self, study: Study) -> Separation:
        """Replay the hypotheses in a study without measurements."""
        first, *others = self.fits
        trials: list[Hypothesis] = [[], first.hypothesis]
        for candidate, p, _, _ in self.tolerances:
            values = candidate.null_values() | {p.name: p.null + STEP * p.scale}
            trials.append([(candidate, values)])
        for fit in others:
            trials.append(fit.hypothesis)
            for axis in np.eye(len(fit.theta)):
                trials.append(with_theta(fit.hypothesis, fit.theta + STEP * axis))
        found = iter(self.problem.replayer.predictions(study, trials))
        null, best = next(found), next(found)
        columns = [
            (next(found) - null) * (p.tolerance / abs(STEP * p.scale))
            for _, p, _, _ in self.tolerances
        ]
        gaps, slopes = list[Floats](), list[Floats]()
        for fit in others:
            other = next(found)
            gaps.append(best - other)
            slopes.append(_stack(len(best), [(next(found) - other) / STEP for _ in fit.theta]))
        return Separation(gaps, slopes, _stack(len(best), columns))


def _compare(
    problem: Problem,
    fitted: Sequence[Alternatives],
    sensitivities: Sequence[Sensitivity],
    unmodelled: float,
) -> _Comparison:
    """Compare the likeliest alternatives to the least certain cause."""
    unsure = min(fitted, key=lambda a: float(a.confidence.max()))
    order = np.argsort(-unsure.confidence)[:MOST]
    fits = [*(unsure.tried[i] for i in order), unsure.without]
    without = max(0.0, 1.0 - unsure.confidence.sum() - unmodelled)
    probability = np.append(unsure.confidence[order], without)
    others = float(unsure.confidence.sum() - unsure.confidence[order].sum())
    gap = _second(fits, probability).residual - fits[0].residual
    tolerances = sorted(
        list_tolerances(sensitivities), key=lambda one: -abs(float(one.column @ gap))
    )[:CONFUSING]
    known = Separation(
        gaps=[other.residual - fits[0].residual for other in fits[1:]],
        slopes=[other.jacobian for other in fits[1:]],
        tolerances=_stack(len(gap), [one.column for one in tolerances]),
    )
    return _Comparison(problem, fits, probability, others, tolerances, known)


def _second(fits: Sequence[Fit], probability: Floats) -> Fit:
    """Return the likeliest hypothesis but the first."""
    return fits[1 + int(np.argmax(probability[1:]))]


def motion_study(study: Study, motion: Motion, seconds: float) -> Study:
    """Return a study of the first seconds of a motion, with readings at the same rates."""
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


def _stack(rows: int, columns: Sequence[Floats]) -> Floats:
    """Return columns side by side (rows, k), even if there are none."""
    return np.column_stack([np.zeros((rows, 0)), *columns])
