"""What a diagnosis says: the verdict, its evidence, and the model that it extends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from reality_gap.causes.base import Location
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.types import Floats


class Verdict(Enum):
    """What the data say of the model."""

    NOTHING_WRONG = "nothing_wrong"
    NAMED = "named"
    UNEXPLAINED = "unexplained"


@dataclass(frozen=True)
class Estimate:
    """A parameter's value with its 95 % interval, in SI units."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class FittedCandidate:
    """A suspect that was fitted fully.

    Attributes:
        suspect: the cause and its place.
        values: fitted parameters.
        score: log predictive probability of the choose split over the model without it [nats].
        confidence: probability that it is (one of) the right causes; of the step it was in. Those
            of a step leave room for nobody, and for what is `Diagnosis.unmodelled`.
        step: 0 in the search for the first cause, 1 for the second, ...
        chosen: whether it is in the verdict.
        evidence: log marginal likelihood over the hypothesis without it [nats].
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
    """A cause in the verdict.

    Attributes:
        suspect: the cause and its place.
        parameters: by name.
        confidence: calibrated probability that this cause is right.
        equivalent: ids of causes that these data cannot tell from it.
        elsewhere: other places where the same cause would do the same.
    """

    candidate: Candidate
    parameters: dict[str, Estimate]
    confidence: float
    equivalent: tuple[str, ...]
    elsewhere: tuple[Location, ...] = ()

    def foremost(self, most: int = 8) -> tuple[str, ...]:
        """Names of the parameters in their order; of more than ``most``, those that are farthest
        from doing nothing, the farthest first."""
        known = [p for p in self.candidate.parameters if p.name in self.parameters]
        if len(known) > most:
            far = {p.name: abs((self.parameters[p.name].value - p.null) / p.scale) for p in known}
            known = sorted(known, key=lambda p: -far[p.name])[:most]
        return tuple(p.name for p in known)


@dataclass(frozen=True)
class Gain:
    """What an extension gains on held-out readings, with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Trace:
    """One channel in one episode, for pictures and tables.

    Attributes:
        channel, episode: names.
        unit: SI.
        split: by sample (k,): 0 fit, 1 choose, 2 report.
        time, measured, before, after: (k,); before and after are replays of the model and of the
            extended model.
        noise: standard deviation of one reading.
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
    """How much of the remainder a quantity explains, held out.

    Attributes:
        quantity: "tension of biceps", "velocity sign of elbow", "angle of elbow", "time", ...
        channel: where it shows most.
        fraction: explained share of the remainder's power, 0 to 1.
    """

    quantity: str
    channel: str
    fraction: float


@dataclass(frozen=True)
class Experiment:
    """A motion that would tell the remaining rivals apart.

    Attributes:
        title, sentence: for people: what to do, and which rivals it separates.
        time, command: (n,) [s], (n, nu), within the range of what was commanded in the study.
        separation: mean distance of the others from the likeliest rival, by how likely they are,
            on the data at hand and on it [standard deviations of the noise];
            ``separation_before``: on the data at hand alone.
    """

    title: str
    sentence: str
    time: Floats
    command: Floats
    separation: float
    separation_before: float


@dataclass(frozen=True)
class Diagnosis:
    """The outcome of a diagnosis; what `verdict.json` holds, and what the report draws.

    Attributes:
        study: its name.
        verdict: see `Verdict`; ``sentence`` says it to people, with advice.
        causes: the one that explains most first; empty unless the verdict is "named".
        rivals: every suspect that was fitted, best first in each step.
        nameless: probability that what is wrong is none of the causes: a learned residual, which is
            no name, was put in their place. None where no cause was found.
        rms_before, rms_after, noise_floor: RMS of the whitened residual on the report split, of the
            user's model and of the extended one; the same unless the verdict is "named".
        gain: (before - after) / (before - floor); None when before is not surely above the floor,
            or where causes are named whose gain is not surely above zero in the RMS.
        likelihood_gain: how much likelier the named causes make the report split, given tolerances
            and the other splits [nats]; None where nothing or groups are named.
        unexplained_fraction: of the power above the floor, what the best of the causes leave, 0 to
            1, whether they are named or not.
        explainable_fraction: of the power above the floor, what a learned residual, which is no
            name, would explain on held-out data: the upper bound.
        depends_on: of what remains, strongest first.
        next_experiment: None where there is nothing to tell apart, or no motion is likely to.
        not_judged: causes that this motion says nothing about, with the reason.
        traces: measured and replayed signals.
        effects: what `extended.xml` cannot hold, with its values.
        extended_xml: the user's model with the named mechanisms in it.
        seconds: how long it took.
        measures: the numbers that the verdict was decided on.
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


MANY = 8
"""Elements of a place with a note that are not listed."""


def sentence(diagnosis: Diagnosis) -> str:
    """What the verdict means and what to do about it."""
    if diagnosis.verdict is Verdict.NOTHING_WRONG:
        return (
            "Nothing is wrong with the model as far as these data can tell: what differs is noise "
            "and what every honest drawing is off by."
        )
    if diagnosis.verdict is Verdict.UNEXPLAINED:
        return (
            "Something is wrong that none of the known causes explains: "
            f"{diagnosis.unexplained_fraction:.0%} of the difference remains after the best of "
            f"them. {_hint(diagnosis)}"
        )
    return " ".join(_named(cause) for cause in diagnosis.causes) + _rest(diagnosis)


def _named(cause: NamedCause) -> str:
    foremost = cause.foremost()
    numbers = ", ".join(
        f"{name.replace('_', ' ')} {e.value:.4g} {e.unit} [{e.low:.4g}, {e.high:.4g}]"
        for name, e in ((name, cause.parameters[name]) for name in foremost)
    )
    more = len(cause.parameters) - len(foremost)
    if more:
        numbers += f" and {more} that are smaller"
    other = (
        f"; these data cannot tell it from {', '.join(cause.equivalent)}"
        if cause.equivalent
        else ""
    )
    title, location = cause.candidate.cause.title, cause.candidate.location
    where = location.note if len(location.elements) > MANY and location.note else str(location)
    return (
        f"{title[0].upper()}{title[1:]} at {where}: {numbers} "
        f"(confidence {cause.confidence:.0%}{other})."
    )


def _rest(diagnosis: Diagnosis) -> str:
    if diagnosis.gain is None:
        likelihood = diagnosis.likelihood_gain
        if likelihood is None or likelihood.low <= 0.0:
            return ""
        return (
            f" With it in the model, readings that were not used to find it are likelier by "
            f"{likelihood.value:.0f} nats [{likelihood.low:.0f}, {likelihood.high:.0f}]."
        )
    return (
        f" With it in the model, {diagnosis.gain.value:.0%} of the avoidable error is gone on "
        "readings that were not used to find it."
    )


def _hint(diagnosis: Diagnosis) -> str:
    if not diagnosis.depends_on:
        return "It follows none of the quantities that were looked at."
    first = diagnosis.depends_on[0]
    return f"It shows most in {first.channel} and goes with the {first.quantity}."
