"""Tolerances: how the deviations of a nominal model that are no faults change the readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.causes.base import Location, Parameter
from reality_gap.causes.support.typical_scales import joint_speed
from reality_gap.inference.screening import STEP, Sensitivity
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, Part, build
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import ReadState, Study
from reality_gap.study.restarts import part_of_readings, with_states
from reality_gap.types import Floats

DRIFT_TOLERANCE = 0.2
"""Relative tolerance of the error of the time step that was subtracted from residuals. A log that
was simulated contains a part of it."""
LARGE = 10.0
"""Norm of a tolerance's column from which on it is replayed exactly [noise]."""
MANY = 5.0
"""Step of a column, in tolerances, from which on it hardly tells the effect of one tolerance."""
START_SEEN = 0.3
"""Norm of the effect of an initial state up to which it does not matter [noise]."""
MOST_STARTS = 400
"""Largest number of errors of initial states, for studies with many episodes or restarts."""
BEFORE, UNKNOWN = 0.01, 0.1
"""Errors of the position [s] and of the velocity with which a log begins, over the joint's velocity
then or its typical one: what was commanded before is not known, and machines with a delay still
follow that."""
FORM = 3.0
"""Factor by which the travel before friction slips deviates."""
SEEN = 1.0
"""Norm of the error of a column up to which it does not matter [noise]."""


class Tolerance(NamedTuple):
    """A parameter with a tolerance.

    Attributes:
        candidate: the candidate that has the parameter.
        parameter: the parameter.
        size: the tolerance [unit], with the sign of the parameter's scale.
        column: change of the readings by the tolerance in units of noise, shape (n,).
    """

    candidate: Candidate
    parameter: Parameter
    size: float
    column: Floats

    def deviation(self, share: float) -> Part:
        """Return the candidate with the parameter at a multiple of the tolerance."""
        value = self.parameter.null + share * self.size
        return self.candidate, self.candidate.null_values() | {self.parameter.name: value}


def list_tolerances(
    sensitivities: Sequence[Sensitivity], factor: float = 1.0
) -> Iterator[Tolerance]:
    """Yield the tolerances of all candidates, times a factor.

    Those of groups are left out, because they are sums of tolerances of their elements, and those
    of candidates that act in one log, because deviations are the same in all of them. Usual
    effects, such as friction, may deviate in all elements of a group at once and are included.
    """
    seen = set()
    for sensitivity in sensitivities:
        candidate = sensitivity.candidate
        key = (candidate.cause.id, candidate.location)
        if key in seen or candidate.location.log:
            continue
        seen.add(key)
        single = len(candidate.location.elements) == 1
        for i, name in enumerate(sensitivity.names):
            p = candidate.parameter(name)
            if p.tolerance > 0 and (single or p.usual):
                column = sensitivity.columns[:, i].astype(np.float64)
                size = factor * float(np.copysign(p.tolerance, p.scale))
                yield Tolerance(candidate, p, size, column * (size / p.scale))


def tolerance_columns(
    replayer: Replayer, tolerances: Sequence[Tolerance], null_residual: Floats
) -> Floats:
    """Return the columns of all tolerances, in their order, and others behind them, shape (n, p).

    If the column of a large tolerance is slightly wrong, the rest of it looks like a fault. Large
    tolerances are therefore replayed at the full time step. So are those where joints stick, if the
    column comes from a step of many tolerances: a small deviation changes what a joint's friction
    bears while it stands still as much as a large one does. The error of the column is one more
    column and does not replace it, because candidates are ranked by the same columns.

    Args:
        replayer: replays hypotheses.
        tolerances: the tolerances.
        null_residual: residual of the nominal model, shape (n,).
    """
    drift, error = DRIFT_TOLERANCE * replayer.drift, replayer.drift_error
    steps = drift, error, replayer.drift_curvature
    drifts = [step / replayer.measured.noise for step in steps]
    system = replayer.system
    sticks = system.model.dof_frictionloss.any() or system.model.tendon_frictionloss.any()

    def is_wrong(one: Tolerance) -> bool:
        if np.linalg.norm(one.column) > LARGE:
            return True
        coarse = STEP * abs(one.parameter.scale) > MANY * abs(one.size)
        return bool(sticks and coarse and not build(system, [one.deviation(1.0)]).effects.hooks)

    large = [one for one in tolerances if is_wrong(one)]
    residuals = replayer.residuals([[one.deviation(1.0)] for one in large])
    errors = [
        null_residual - residual - one.column
        for one, residual in zip(large, residuals, strict=True)
        if np.all(np.isfinite(residual))
    ]
    errors += form_errors(replayer, tolerances)
    seen = [error for error in errors if np.linalg.norm(error) > SEEN]
    starts = start_columns(replayer)
    return np.column_stack([*(one.column for one in tolerances), *seen, *drifts, *starts])


def form_errors(replayer: Replayer, tolerances: Sequence[Tolerance]) -> list[Floats]:
    """Return how other forms of tolerated friction change the readings, shape (n,) each.

    A little friction has a form that no log shows: the travel before it slips may be a third of the
    usual one, or three times as long. Kinds of friction at one location have errors alike, and the
    largest stands for them.

    Args:
        replayer: replays hypotheses.
        tolerances: the tolerances.
    """
    largest = dict[Location, Tolerance]()
    for one in tolerances:
        before, visible = largest.get(one.candidate.location), _norm(one) > FORM * SEEN
        if one.candidate.cause.sticky and _forms(one) and visible:
            largest[one.candidate.location] = max(one, before or one, key=_norm)
    replays, pairs = list[Hypothesis](), list[tuple[int, int]]()
    for one in largest.values():
        candidate, values = one.deviation(1.0)
        name, usual = one.parameter.name, len(replays)
        values = {**values, name: values[name] + one.parameter.usual}
        replays.append([(candidate, values)])
        for p in _forms(one):
            for form in (max(p.low, p.null / FORM), min(p.high, p.null * FORM)):
                pairs.append((usual, len(replays)))
                replays.append([(candidate, {**values, p.name: form})])
    residuals = replayer.residuals(replays)
    errors = [residuals[usual] - residuals[other] for usual, other in pairs]
    return [error for error in errors if np.isfinite(error).all()]


def _norm(one: Tolerance) -> float:
    """Return the norm of a tolerance's column [noise]."""
    return float(np.linalg.norm(one.column))


def _forms(one: Tolerance) -> list[Parameter]:
    """Return the parameters of a tolerance's candidate that no log without the effect shows."""
    return [p for p in one.candidate.parameters if p.hints.shape and p.null > 0.0]


def start_columns(replayer: Replayer, base: Hypothesis = ()) -> list[Floats]:
    """Return the change of the readings by each error of an initial state, shape (n,) each.

    Each joint whose readings show where an episode begins has an error of its position and one of
    its velocity in each episode, and at each of its restarts, where what was commanded before is
    known. Those with little effect are left out, as are the least of many.

    Args:
        replayer: replays hypotheses.
        base: causes beside which the readings change.
    """
    study, measured = replayer.system.study, replayer.measured
    if study.inverse:
        return []
    joints = dict.fromkeys(joint for states in study.states for joint in states)
    parts, columns = part_of_readings(study, measured), list[Floats]()
    for joint in joints:
        typical = joint_speed(replayer.system, Location("joint", (joint,)))
        for moved in (_displaced(study, joint, typical), _pushed(study, joint, typical)):
            change = replayer.change_of_start(moved, base) / measured.noise
            for part in range(len(study.states)):
                own = np.where(parts == part, change, 0.0)
                if np.linalg.norm(own) > START_SEEN:
                    columns.append(own)
    return sorted(columns, key=lambda c: -float(np.linalg.norm(c)))[:MOST_STARTS]


def _displaced(study: Study, joint: str, typical: float) -> Study:
    """Return a study that begins with a joint displaced by the error of its position."""

    def change(state: ReadState, within: bool) -> ReadState:
        before = 0.0 if within else BEFORE * max(abs(state.speed), typical)
        error = float(np.hypot(state.position_error, before))
        return state._replace(position=state.position + error)

    return with_states(study, change, joint)


def _pushed(study: Study, joint: str, typical: float) -> Study:
    """Return a study that begins with a joint faster by the error of its velocity."""

    def change(state: ReadState, within: bool) -> ReadState:
        unknown = 0.0 if within else UNKNOWN * max(abs(state.speed), typical)
        return state._replace(speed=state.speed + float(np.hypot(state.speed_error, unknown)))

    return with_states(study, change, joint)
