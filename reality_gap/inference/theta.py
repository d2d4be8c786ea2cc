"""Theta: the parameters of a hypothesis as a vector, in scales from their null values.

For a parameter with value v, theta = (v - null) / scale, so that 0 has no effect and 1 is a typical
fault.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.causes.base import Parameter, Values
from reality_gap.inference.evidence import PRIOR
from reality_gap.simulation.hypothesis import Candidate, Hypothesis
from reality_gap.types import Floats

GOOD = 2.0
"""Deviation up to which a nominal model is good, in tolerances; it is not named as a cause."""


def free_parameters(hypothesis: Hypothesis) -> list[tuple[int, Parameter]]:
    """Return all p parameters of a hypothesis, each with the index of its candidate."""
    return [(i, p) for i, (candidate, _) in enumerate(hypothesis) for p in candidate.parameters]


def is_time(parameter: Parameter) -> bool:
    """Return whether a parameter is a time of an event, which only readings near it show."""
    return bool(parameter.hints.starts) and parameter.unit == "s"


def begin_and_duration(candidate: Candidate) -> tuple[Parameter, Parameter] | None:
    """Return the times of an event that begins once and lasts for some time; None for others."""
    times = [p for p in candidate.parameters if is_time(p)]
    if len(times) != 2 or any(p.hints.period for p in times):
        return None
    begin, duration = times
    return (begin, duration) if len(begin.hints.starts) > 1 and duration.low > 0.0 else None


def to_theta(hypothesis: Hypothesis) -> Floats:
    """Return theta of a hypothesis, shape (p,)."""
    found = free_parameters(hypothesis)
    return np.array([(hypothesis[i][1][p.name] - p.null) / p.scale for i, p in found])


def with_theta(hypothesis: Hypothesis, theta: Floats) -> list[tuple[Candidate, dict[str, float]]]:
    """Return a hypothesis with the values of ``theta`` (p,), clipped to their bounds."""
    values: list[dict[str, float]] = [{} for _ in hypothesis]
    for (i, p), x in zip(free_parameters(hypothesis), theta, strict=True):
        values[i][p.name] = float(np.clip(p.null + x * p.scale, p.low, p.high))
    return [(candidate, v) for (candidate, _), v in zip(hypothesis, values, strict=True)]


def theta_bounds(parameters: Sequence[Parameter]) -> tuple[Floats, Floats]:
    """Return lower and upper bounds of theta, shape (p,) each."""
    ends = [sorted(((p.low - p.null) / p.scale, (p.high - p.null) / p.scale)) for p in parameters]
    low, high = np.array(ends).T
    return low, high


def prior_weights(hypothesis: Hypothesis) -> Floats:
    """Return 1 / prior deviation of theta, shape (p,); 0 for a flat prior (one with starts).

    A cause that is larger than usual has a wider prior, so that its size is not pulled to the null.
    """
    free, theta = free_parameters(hypothesis), to_theta(hypothesis)
    flat = np.array([bool(p.hints.starts) for _, p in free], dtype=bool)
    owner = np.array([i for i, _ in free], dtype=np.int64)
    sizes = np.full(len(hypothesis), PRIOR)
    np.maximum.at(sizes, owner[~flat], np.abs(theta[~flat]))
    return np.asarray(np.where(flat, 0.0, 1.0 / sizes[owner]))


def is_tolerable(candidate: Candidate, values: Values) -> bool:
    """Return whether a candidate's deviation is one that every good model may have.

    Args:
        candidate: a cause at a location.
        values: values of its parameters.
    """
    known = [p for p in candidate.parameters if p.tolerance > 0.0]
    return bool(known) and all(
        abs(values[p.name] - p.null) <= max(GOOD * p.tolerance, p.least) for p in known
    )
