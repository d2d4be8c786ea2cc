"""Baselines of the diagnosis: largest correlation, and a fit of all parameters at once.

The fit of all parameters uses the optimiser and the intervals of `mujoco.sysid`, with the replay of
`reality_gap` (encoders, elastic tendons, cameras), the noise of the sensors, and the prior of the
diagnosis, without which most intervals are infinite. Causes with a Python hook in
each simulation step (backlash, slack, some frictions, external forces) are left out, because a step
of the fit would take half an hour with them.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jmm_agent.types import Floats
from reality_gap.inference.evidence import PRIOR
from reality_gap.inference.screening import Sensitivity
from reality_gap.inference.theta import to_theta, with_theta
from reality_gap.simulation.hypothesis import Candidate, Hypothesis, build
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import SELECT, split

STEP = 0.05
"""Finite difference of the fit, in scales; below it dry friction has no slope."""
ITERATIONS = 6
"""Largest number of iterations of the fit."""
NEAR_NULL = 0.02
"""Start of one-sided parameters, in scales; the optimiser stalls at a bound."""
FAR = 20.0
"""Bounds of parameters without bounds, in scales."""


@dataclass(frozen=True)
class Named:
    """The cause that a baseline names if its score exceeds a threshold.

    Attributes:
        cause: its id.
        elements: where it acts.
        score: explained share of the residual's power, or change of a parameter relative to the
            half width of its 95 % interval.
    """

    cause: str
    elements: tuple[str, ...]
    score: float


def largest_correlation(
    readings: Measured, residual: Floats, found: Sequence[Sensitivity]
) -> Named | None:
    """The candidate with the column that correlates best with the residual, shape (n,).

    Nothing is fitted, tolerances are ignored, and the report split is not used.
    """
    use = split(readings) <= SELECT
    r = residual[use]
    best: Named | None = None
    for sensitivity in found:
        columns = sensitivity.columns[use]
        power = np.sum(columns**2, axis=0) * (r @ r)
        along = (r @ columns) ** 2
        share = np.divide(along, power, out=np.zeros(len(power)), where=power > 0)
        score = float(share.max(initial=0.0))
        if best is None or score > best.score:
            best = _named(sensitivity.candidate, score)
    return best


def _named(candidate: Candidate, score: float) -> Named:
    return Named(candidate.cause.id, candidate.location.elements, score)


def sysid_installed() -> bool:
    """Whether `mujoco.sysid` is installed; without its extra it imports as an empty package."""
    from mujoco import sysid

    return hasattr(sysid, "optimize")


def free_parameter_baseline(replayer: Replayer, found: Sequence[Sensitivity]) -> Named | None:
    """Fit all parameters at once and choose the one with the largest change.

    Changes are relative to the interval of the parameter. None without the extra ``mujoco[sysid]``.
    """
    if not sysid_installed():
        return None
    from mujoco import sysid

    logging.getLogger("absl").setLevel(logging.ERROR)
    start = free_parameters(replayer, found)
    use = split(replayer.measured) <= SELECT
    owners = [candidate for candidate, _ in start for _ in candidate.parameters]
    parameters = _parameters(sysid, start)

    def residual(x: Floats, _: object) -> tuple[list[Floats], None, None]:
        columns = [_residual(replayer, start, theta)[use] for theta in np.atleast_2d(x.T)]
        rows = np.vstack([np.column_stack(columns), np.atleast_2d(x.T).T / PRIOR])
        return [rows if x.ndim > 1 else rows[:, 0]], None, None

    _, fit = sysid.optimize(
        parameters, residual, verbose=False, max_iters=ITERATIONS, eps=STEP, output=io.StringIO()
    )
    theta = np.ravel(fit.x)
    left, _, _ = residual(theta, None)
    _, half = sysid.calculate_intervals(left, np.asarray(fit.jac))
    moved = np.abs(theta) / np.maximum(half, 1e-12)
    most = int(np.argmax(moved))
    return _named(owners[most], float(moved[most]))


def free_parameters(replayer: Replayer, found: Sequence[Sensitivity]) -> Hypothesis:
    """All causes at single elements without a Python hook in their replay, at their null."""
    parts, seen = [], set()
    for sensitivity in found:
        candidate = sensitivity.candidate
        key = (candidate.cause.id, candidate.location)
        smooth = not any(p.hints.starts for p in candidate.parameters)
        if key in seen or not smooth or len(candidate.location.elements) > 1:
            continue
        seen.add(key)
        null = [(candidate, candidate.null_values())]
        values = with_theta(null, np.full(len(candidate.parameters), NEAR_NULL))
        if not build(replayer.system, values).effects.hooks:
            parts += null
    return parts


def _parameters(sysid: Any, start: Hypothesis) -> Any:
    """Parameters of `mujoco.sysid`, one for each number, in scales and away from the bounds."""
    found = sysid.ParameterDict()
    parameters = [p for candidate, _ in start for p in candidate.parameters]
    for i, (p, null) in enumerate(zip(parameters, to_theta(start), strict=True)):
        low, high = sorted(((p.low - p.null) / p.scale, (p.high - p.null) / p.scale))
        low, high = max(low, -FAR), min(high, FAR)
        first = float(np.clip(null, low + NEAR_NULL, high - NEAR_NULL))
        found.add(sysid.Parameter(f"{i}", first, low, high))
    return found


def _residual(replayer: Replayer, start: Hypothesis, theta: Floats) -> Floats:
    return np.nan_to_num(replayer.residual(with_theta(start, theta)), posinf=1e3, neginf=-1e3)
