"""Outcome: what a diagnosis concludes, from a search for single causes or from a fit of groups."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from reality_gap.causes import CATALOGUE
from reality_gap.diagnosis import (
    Calibration,
    Criterion,
    Dependence,
    Experiment,
    FittedCandidate,
    Gain,
    NamedCause,
    Rejected,
    Share,
    Verdict,
)
from reality_gap.inference.group_fit import GroupFit
from reality_gap.inference.held_out import Score, score
from reality_gap.inference.remainder import dependences
from reality_gap.inference.verdict import ABOVE
from reality_gap.inference.waterfall import shares
from reality_gap.log_findings import FlatDirection
from reality_gap.posterior import Branch
from reality_gap.simulation.hypothesis import Hypothesis
from reality_gap.simulation.replayer import Replayer
from reality_gap.types import Floats

TOGETHER = "the named groups of causes together"
"""What the only step of the waterfall is called."""
HIDDEN = "small errors of all elements hide single causes"
"""Why other causes are not judged in a machine that groups explain."""


@dataclass(frozen=True)
class Outcome:
    """What a diagnosis concludes; see `reality_gap.diagnosis.Diagnosis` for fields of that name.

    Attributes:
        hypothesis: the named causes with their values; empty if none is named.
        residual: residual of the model with these causes in units of noise, shape (n,).
        score: comparison of the model with and without these causes.
        branches: what the data leave open; see `reality_gap.posterior`.
        objection: why the best causes are not named, or not all that is wrong, as the end of a
            sentence.
    """

    verdict: Verdict
    hypothesis: Hypothesis
    residual: Floats
    score: Score
    causes: tuple[NamedCause, ...]
    fitted_candidates: tuple[FittedCandidate, ...]
    gain: Gain | None
    unexplained_fraction: float
    explainable_fraction: float
    depends_on: tuple[Dependence, ...]
    not_judged: tuple[tuple[str, str], ...]
    measures: Mapping[str, float]
    unmodelled: float | None = None
    objection: str | None = None
    likelihood_gain: Gain | None = None
    next_experiment: Experiment | None = None
    criteria: tuple[Criterion, ...] = ()
    waterfall: tuple[Share, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    flat: tuple[FlatDirection, ...] = ()
    branches: tuple[Branch, ...] = ()
    calibration: Calibration | None = None


def groups_outcome(
    replayer: Replayer, null_residual: Floats, groups: GroupFit, left: float
) -> Outcome:
    """Return the outcome for a machine that groups of causes explain.

    Args:
        replayer: replays of the study.
        null_residual: residual of the nominal model in units of sensor noise, shape (n,).
        groups: the groups.
        left: RMS on the report split above which the groups are not all that is wrong [noise].
    """
    scored = score(replayer.system.study, replayer.measured, null_residual, groups.residual)
    records = replayer.replay(groups.hypothesis).records
    named = {cause.candidate.cause.id for cause in groups.causes}
    noises = Criterion("report_noises", scored.after, left, scored.after <= left, ABOVE)
    return Outcome(
        verdict=Verdict.NAMED if noises.met else Verdict.PARTLY_NAMED,
        hypothesis=groups.hypothesis,
        residual=groups.residual,
        score=scored,
        causes=groups.causes,
        fitted_candidates=groups.fitted_candidates,
        gain=scored.gain,
        unexplained_fraction=scored.unexplained,
        explainable_fraction=1.0 - scored.unexplained,
        depends_on=dependences(replayer, groups.residual, records),
        not_judged=tuple((name, HIDDEN) for name in CATALOGUE if name not in named),
        measures={
            "causes": float(len(groups.causes)),
            "moments": float(groups.moments),
            "time_step": replayer.step,
        },
        objection=None if noises.met else noises.objection,
        criteria=(noises,),
        waterfall=shares([TOGETHER], [scored.before, scored.after], scored.floor),
        branches=(Branch(groups.hypothesis, groups.covariance),),
    )
