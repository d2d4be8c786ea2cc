"""What others would name from the same log: the largest correlation, or a fit of everything.

The fit of everything is `mujoco.sysid`'s, with its optimiser and intervals. It is given more than
it brings: this project's replay, so that it knows encoders, wires' elasticity and cameras too, the
sensors' noise, and a prior as wide as the diagnosis', without which most intervals are infinite.
Only what acts in every step through Python is left out (backlash, slack, some frictions, pushes):
with it, one step of the fit would take half an hour.
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
from reality_gap.inference.gauss_newton import at, to_theta
from reality_gap.inference.screening import Sensitivity
from reality_gap.simulation.hypothesis import Candidate, build
from reality_gap.simulation.replayer import Hypothesis, Replayer
from reality_gap.study.measurements import Measured
from reality_gap.study.splits import CHOOSE, split

STEP = 0.05
"""Finite difference of the fit, in scales: dry friction has no slope within a smaller one."""
ITERATIONS = 6
NEAR_NULL = 0.02
"""Where one-sided parameters start, in scales: in the corner the optimiser would stall."""
FAR = 20.0
"""Bounds of those without, in scales."""


@dataclass(frozen=True)
class Named:
    """What a baseline names, if its threshold lets it.

    Attributes:
        cause, where: id and elements.
        score: what the threshold cuts: explained share of the residual's power, or a parameter's
            change over the half width of its 95 % interval.
    """

    cause: str
    where: tuple[str, ...]
    score: float


def largest_correlation(
    readings: Measured, residual: Floats, found: Sequence[Sensitivity]
) -> Named | None:
    """The suspect with the column that correlates best with the residual (n,).

    Nothing is fitted, no drawing has tolerances, and the report split is left alone.
    """
    use = split(readings) <= CHOOSE
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
    """Whether `mujoco.sysid` is there: without its extra it imports as an empty package."""
    from mujoco import sysid

    return hasattr(sysid, "optimize")


def free_parameter_baseline(replayer: Replayer, found: Sequence[Sensitivity]) -> Named | None:
    """Fit all parameters at once, and take the one that moved most for its interval.

    None without the extra ``mujoco[sysid]``.
    """
    if not sysid_installed():
        return None
    from mujoco import sysid

    logging.getLogger("absl").setLevel(logging.ERROR)
    start = freed(replayer, found)
    use = split(replayer.measured) <= CHOOSE
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


def freed(replayer: Replayer, found: Sequence[Sensitivity]) -> Hypothesis:
    """Every cause at every single element whose replay needs no Python in its steps, at null."""
    parts, seen = [], set()
    for sensitivity in found:
        candidate = sensitivity.candidate
        key = (candidate.cause.id, candidate.location)
        smooth = not any(p.hints.starts for p in candidate.parameters)
        if key in seen or not smooth or len(candidate.location.elements) > 1:
            continue
        seen.add(key)
        values = at([(candidate, candidate.nulls())], np.full(len(candidate.parameters), NEAR_NULL))
        if not build(replayer.system, values).effects.hooks:
            parts.append((candidate, candidate.nulls()))
    return parts


def _parameters(sysid: Any, start: Hypothesis) -> Any:
    """One number for each parameter, in scales, moved off the bounds."""
    found = sysid.ParameterDict()
    parameters = [p for candidate, _ in start for p in candidate.parameters]
    for i, (p, null) in enumerate(zip(parameters, to_theta(start), strict=True)):
        low, high = sorted(((p.low - p.null) / p.scale, (p.high - p.null) / p.scale))
        low, high = max(low, -FAR), min(high, FAR)
        first = float(np.clip(null, low + NEAR_NULL, high - NEAR_NULL))
        found.add(sysid.Parameter(f"{i}", first, low, high))
    return found


def _residual(replayer: Replayer, start: Hypothesis, theta: Floats) -> Floats:
    return np.nan_to_num(replayer.residual(at(start, theta)), posinf=1e3, neginf=-1e3)
