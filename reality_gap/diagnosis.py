"""Diagnosis: the verdict, its evidence, and the extended model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Location, Parameter
from reality_gap.errors import StudyError
from reality_gap.extended import Extended
from reality_gap.log_findings import Estimate as Estimate
from reality_gap.log_findings import FlatDirection, LogComparison
from reality_gap.posterior import Posterior
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.types import Floats

NO_POSTERIOR = (
    "the gap is unexplained, so that no samples of the model would be like the machine; train on "
    "the model itself with ranges of your own, or name the gap first, such as with another motion"
)
"""Why an unexplained gap has no samples."""
STOP = "gain_of_stop"
"""Name of the criterion that no end stop explains more than the causes do."""


class Verdict(Enum):
    """Kind of the result.

    ``NOTHING_WRONG``: the data show no error of the model. ``NAMED``: causes explain the gap; what
    remains is at the noise, given the tolerances. ``PARTLY_NAMED``: causes explain a part of the
    gap, also on held-out data; the rest has no name. ``UNEXPLAINED``: there is a gap, and no known
    cause explains a part of it, or only guesses do.
    """

    NOTHING_WRONG = "nothing_wrong"
    NAMED = "named"
    PARTLY_NAMED = "partly_named"
    UNEXPLAINED = "unexplained"

    @property
    def has_names(self) -> bool:
        """Whether causes are named."""
        return self in (Verdict.NAMED, Verdict.PARTLY_NAMED)


@dataclass(frozen=True)
class Gain:
    """Gain on readings to which nothing was fitted, with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Share:
    """What one part of the waterfall removes from the error of the report split.

    Attributes:
        part: the cause at its location, or what else removes it.
        before, after: RMS of the residual before and after [noise].
        fraction: share of the power of the error above the noise that it removes; negative if the
            error grows.
    """

    part: str
    before: float
    after: float
    fraction: float


@dataclass(frozen=True)
class Criterion:
    """A comparison on which the verdict was decided.

    Attributes:
        name: name of the measure.
        value: the measure.
        threshold: what it is compared with.
        met: whether it is in favour of the cause, or of all causes.
        objection: what it means if it is not met, as the end of a sentence about the causes.
    """

    name: str
    value: float
    threshold: float
    met: bool
    objection: str


def names_stop(criteria: Sequence[Criterion]) -> bool:
    """Return whether an end stop of a joint explains what the causes do not."""
    return any(one.name == STOP and not one.met for one in criteria)


@dataclass(frozen=True)
class Doubt:
    """Something that may be right in the place of a named cause.

    Attributes:
        reason: what it is.
        probability: that it is right.
    """

    reason: str
    probability: float


@dataclass(frozen=True)
class FittedCandidate:
    """A candidate that was fitted.

    Attributes:
        candidate: the cause and its location.
        values: fitted parameters in SI units.
        score: gain in log likelihood of the selection split by a fit to the fit split [nats].
        confidence: probability that it is a right cause. The sum over a step may be below 1; the
            rest is that of no cause at all, and of causes that are not in the catalogue (see
            `NamedCause.doubts`).
        step: index of the cause in whose place it was tried.
        chosen: whether it is that cause.
        evidence: log marginal likelihood relative to the hypothesis without it [nats].
    """

    candidate: Candidate
    values: dict[str, float]
    score: float
    confidence: float
    step: int = 0
    chosen: bool = False
    evidence: float = 0.0


@dataclass(frozen=True)
class NamedCause:
    """A cause of the verdict.

    Attributes:
        candidate: the cause and its location.
        parameters: estimates by name.
        confidence: calibrated probability that this cause is right.
        equivalent: ids of causes that these data cannot distinguish from it.
        elsewhere: other locations where the same cause has the same effect.
        gain: gain in log likelihood of held-out readings over the other named causes alone, by
            cross-validation [nats]; None for a group of causes.
        share: what it removes from the error of the report split, beside the causes before it.
        logs: its values in each log; None if there is one log.
        doubts: what lowers the confidence, the likeliest first; their probabilities and the
            confidence add up to 1.
    """

    candidate: Candidate
    parameters: dict[str, Estimate]
    confidence: float
    equivalent: tuple[str, ...]
    elsewhere: tuple[Location, ...] = ()
    gain: Gain | None = None
    share: Share | None = None
    logs: LogComparison | None = None
    doubts: tuple[Doubt, ...] = ()

    @property
    def title(self) -> str:
        """The cause and its location in words."""
        return f"{self.candidate.cause.title} at {self.candidate.location}"

    def foremost(self, most: int = 8) -> tuple[str, ...]:
        """Return the names of the parameters in their order.

        A shape at its null value, which the data did not move, is left out.

        Args:
            most: if there are more parameters, so many with the largest deviations from their null
                values, relative to their scales, are returned, the largest first.
        """
        known = [
            p
            for p in self.candidate.parameters
            if p.name in self.parameters and not (p.hints.shape and self._is_null(p))
        ]
        if len(known) > most:
            far = {p.name: abs((self.parameters[p.name].value - p.null) / p.scale) for p in known}
            known = sorted(known, key=lambda p: -far[p.name])[:most]
        return tuple(p.name for p in known)

    def _is_null(self, parameter: Parameter) -> bool:
        """Return whether a parameter is at its null value, but for rounding."""
        moved = self.parameters[parameter.name].value - parameter.null
        return abs(moved) <= 1e-6 * abs(parameter.scale)


@dataclass(frozen=True)
class Rejected:
    """A cause of the best attempt that is not named.

    Attributes:
        candidate: the cause and its location.
        values: fitted parameters in SI units.
        reason: why it is not named, as the end of a sentence.
        gain: gain in log likelihood of held-out readings over the other causes of the attempt
            alone, by cross-validation [nats].
    """

    candidate: Candidate
    values: Mapping[str, float]
    reason: str
    gain: Gain | None = None


@dataclass(frozen=True)
class Correction:
    """A number of the model that is adjusted, within what may be wrong in a good model or near it.

    Attributes:
        candidate: the cause that would change it, and where.
        parameter: the number.
        value: the adjustment [unit of the parameter].
        tolerances: the adjustment in tolerances; many of these after a joint fit.
    """

    candidate: Candidate
    parameter: Parameter
    value: float
    tolerances: float


@dataclass(frozen=True)
class Calibration:
    """The model with the named causes, and with all its numbers adjusted as little as needed.

    Attributes:
        corrections: the adjustments, the largest first. None of them is a finding.
        rms: RMS of the residual on the report split [noise].
        xml: the model as MJCF.
        effects: adjustments and named causes that ``xml`` cannot express, with their values.
        together: whether gains, friction, damping, masses and the like were fitted together, in
            place of the named causes: these left too much.
    """

    corrections: tuple[Correction, ...]
    rms: float
    xml: str
    effects: tuple[tuple[Candidate, Mapping[str, float]], ...] = ()
    together: bool = False


@dataclass(frozen=True)
class Trace:
    """Signals of one channel in one episode.

    Attributes:
        channel, episode: names.
        unit: SI unit of the values.
        split: split of each reading, shape (k,): 0 fit, 1 selection, 2 report.
        noise: standard deviation of one reading.
        time: time of each reading, shape (k,) [s].
        measured: readings, shape (k,).
        before, after: replays of the nominal and of the extended model, shape (k,).
    """

    channel: str
    episode: str
    unit: str
    noise: float
    time: Floats
    split: NDArray[np.int64]
    measured: Floats
    before: Floats
    after: Floats


@dataclass(frozen=True)
class Dependence:
    """A quantity that explains a part of the remainder on the report split.

    Attributes:
        quantity: name of the quantity, such as "force of biceps", "position of elbow" or "time".
        channel: channel in which it explains most.
        fraction: explained share of the remainder's power, 0 to 1.
    """

    quantity: str
    channel: str
    fraction: float


@dataclass(frozen=True)
class Experiment:
    """A motion that would separate the remaining hypotheses.

    Attributes:
        title, sentence: what to do, and which hypotheses it separates.
        time: times of the commands, shape (n,) [s].
        command: commands within the range of those of the study, shape (n, nu).
        separation, separation_before: mean distance of the other hypotheses from the likeliest,
            weighted by their probabilities, with and without this experiment, in standard
            deviations of the noise.
    """

    title: str
    sentence: str
    time: Floats
    command: Floats
    separation: float
    separation_before: float


@dataclass(frozen=True)
class Diagnosis:
    """Result of a diagnosis.

    Attributes:
        study: name of the study.
        verdict: kind of the result.
        sentence: what the verdict means, with advice.
        causes: the named causes, the one that explains most first; empty unless the verdict is
            "named" or "partly_named".
        fitted_candidates: all candidates that were fitted, best first in each step.
        rms_before, rms_after, noise_floor: RMS of the residual on the report split in units of
            noise, of the nominal model, of the extended model, and of the noise alone. The first
            two are equal if no cause is named.
        gain: (rms_before - rms_after) / (rms_before - noise_floor); None if ``rms_before`` is not
            surely above the floor, or if causes are named whose gain in the RMS is not surely above
            zero.
        unexplained_fraction: share of the power above the floor that the best causes leave, whether
            they are named or not, 0 to 1; if the verdict is "nothing_wrong", what deviations within
            the tolerances leave of it, or 0 if ``rms_before`` is not surely above the floor.
        explainable_fraction: share of the power above the floor that the best causes and a learned
            residual together explain on the report split, or tolerances if the verdict is
            "nothing_wrong"; an upper bound.
        depends_on: quantities that explain most of the remainder, strongest first.
        next_experiment: an experiment that is likely to halve the remaining doubt; None if there is
            none.
        not_judged: ids of causes on which this study does not decide, each with the reason.
        traces: measured and replayed signals.
        effects: named causes with effects that ``extended_xml`` cannot express, with their values.
        extended_xml: the nominal model with the named causes.
        seconds: duration of the diagnosis [s].
        measures: numbers of the search and of its remainder.
        criteria: comparisons on which the verdict was decided.
        waterfall: what the tolerances, and then each named cause, take from the error of the report
            split; the last ``after`` is what remains.
        rejected: causes of the best attempt that are not named.
        flat: what this study cannot show, by cause and location.
        unmodelled: probability that unknown causes have the effect of all causes; None if no cause
            was found. Each cause may be in more doubt; see `NamedCause.doubts`.
        likelihood_gain: gain in log likelihood of held-out readings by the named causes together,
            given the tolerances, by cross-validation [nats]; None if no single causes are named.
        posterior: what the data leave open, of which `sample` returns models; None if the
            verdict is "unexplained".
        notes: what is suspicious in the study, such as a sensor with the opposite sign; see
            `reality_gap.check_study`. None if it was not checked; `reality_gap.write_diagnosis`
            then checks it.
        calibration: the extended model with all its numbers adjusted; None if that does not predict
            better.
        restart: longest time between two moments at which replays began again as the readings show
            the state; 0 if each log was replayed from its begin only [s].
    """

    study: str
    verdict: Verdict
    sentence: str
    causes: tuple[NamedCause, ...]
    fitted_candidates: tuple[FittedCandidate, ...]
    rms_before: float
    rms_after: float
    noise_floor: float
    gain: Gain | None
    unexplained_fraction: float
    explainable_fraction: float
    depends_on: tuple[Dependence, ...]
    next_experiment: Experiment | None
    not_judged: tuple[tuple[str, str], ...]
    traces: tuple[Trace, ...]
    effects: tuple[tuple[Candidate, Mapping[str, float]], ...]
    extended_xml: str
    seconds: float
    measures: Mapping[str, float] = field(default_factory=dict)
    unmodelled: float | None = None
    likelihood_gain: Gain | None = None
    criteria: tuple[Criterion, ...] = ()
    waterfall: tuple[Share, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    flat: tuple[FlatDirection, ...] = ()
    posterior: Posterior | None = None
    notes: tuple[str, ...] | None = None
    calibration: Calibration | None = None
    restart: float = 0.0

    def sample(self, n: int, seed: int = 0) -> list[Extended]:
        """Sample models of what the machine may be, such as for the training of a policy.

        Named causes have values from their joint Gaussian within their bounds, and causes that the
        data cannot distinguish replace each other with their probabilities. If the verdict is
        "nothing_wrong", each parameter deviates from the model within its tolerance. The part of a
        gap that a diagnosis does not name is in no sample.

        Args:
            n: number of samples, from 1; the first of ``n + 1`` samples are those of ``n``.
            seed: of the samples; the same seed gives the same models.

        Raises:
            StudyError: the verdict is "unexplained", a number is out of its range, or there is no
                file of the study's model any more.
        """
        if self.posterior is None:
            raise StudyError(NO_POSTERIOR)
        return self.posterior.sample(n, seed)
