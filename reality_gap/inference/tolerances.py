"""Tolerances: how the deviations of a nominal model that are no faults change the readings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from reality_gap.causes.base import Parameter
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.simulation.replayer import Replayer
from reality_gap.types import Floats

DRIFT_TOLERANCE = 0.1
"""Relative tolerance of the error of the time step that was subtracted from residuals."""
LARGE = 10.0
"""Norm of a tolerance's column from which on it is replayed exactly [noise]."""


class Tolerance(NamedTuple):
    """A parameter with a tolerance.

    Attributes:
        candidate: the candidate that has the parameter.
        parameter: the parameter.
        column: change of the readings by the tolerance in units of noise, shape (n,).
    """

    candidate: Candidate
    parameter: Parameter
    column: Floats


def list_tolerances(sensitivities: Sequence[Sensitivity]) -> Iterator[Tolerance]:
    """Yield the tolerances of all candidates.

    Those of groups are left out, because they are sums of tolerances of their elements. Usual
    effects, such as friction, may deviate in all elements of a group at once and are included.
    """
    seen = set()
    for sensitivity in sensitivities:
        candidate = sensitivity.candidate
        key = (candidate.cause.id, candidate.location)
        if key in seen:
            continue
        seen.add(key)
        single = len(candidate.location.elements) == 1
        for i, name in enumerate(sensitivity.names):
            p = candidate.parameter(name)
            if p.tolerance > 0 and (single or p.usual):
                column = sensitivity.columns[:, i].astype(np.float64)
                yield Tolerance(candidate, p, column * (p.tolerance / abs(p.scale)))


def tolerance_columns(
    replayer: Replayer, sensitivities: Sequence[Sensitivity], null_residual: Floats
) -> Floats:
    """Return the changes of the readings by all tolerances in units of noise, shape (n, p).

    If the column of a large tolerance is slightly wrong, the rest of it looks like a fault. Large
    tolerances are therefore replayed at the full time step. The error of the column is one more
    column and does not replace it, because candidates are ranked by the same columns.

    Args:
        replayer: replays hypotheses.
        sensitivities: of all candidates.
        null_residual: residual of the nominal model, shape (n,).
    """
    steps = DRIFT_TOLERANCE * replayer.drift, replayer.drift_error
    drifts = [step / replayer.measured.noise for step in steps]
    tolerances = list(list_tolerances(sensitivities))
    large = [one for one in tolerances if np.linalg.norm(one.column) > LARGE]
    trials: list[Hypothesis] = []
    for candidate, p, _ in large:
        value = p.null + np.copysign(p.tolerance, p.scale)
        trials.append([(candidate, candidate.null_values() | {p.name: float(value)})])
    errors = [
        null_residual - residual - one.column
        for one, residual in zip(large, replayer.residuals(trials), strict=True)
        if np.all(np.isfinite(residual))
    ]
    return np.column_stack([*drifts, *(one.column for one in tolerances), *errors])
