"""Relinearisation: how deviations within the tolerances change the readings beside causes.

The columns of tolerances are slopes of the nominal model. Where a cause changes the motion a lot,
as friction in a pendulum that swings freely without it, they are not those of the machine: along a
few dozen wrong directions of thousands of noises each, deviations seem to explain whatever is left,
but only in the readings they are inferred from. Beside such a cause the slopes are replayed.

Tolerances of forces are those of the nominal machine. If its servo turns out to be fifty times
weaker, so are its friction, its dampings and its offsets; the friction that a good model of the
nominal machine may lack would move this one by fifty times as much, and explain any friction that
it has.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reality_gap.causes.support.joint_motors import motors_of
from reality_gap.inference.expansion import DIFFERENCE, is_small
from reality_gap.inference.gauss_newton import Fit, null_fit
from reality_gap.inference.problem import Problem
from reality_gap.inference.tolerances import Tolerance, start_columns
from reality_gap.simulation.hypothesis import Hypothesis
from reality_gap.study.system import System
from reality_gap.types import Floats

BENT = 0.5
"""Change of a slope from which on slopes are replayed, relative to the larger of both."""
COMPARED = 3
"""How many slopes are compared, those of the tolerances with the largest effects."""
STRENGTH = ("position_gain", "force_scale")
"""Causes whose excess e makes a motor 1 + e times as strong."""
WEAKEST = 1e-3
"""Least strength of a motor over that of its model."""


def relinearised(problem: Problem, fitted: Fit) -> Problem | None:
    """Return the problem with the slopes of tolerances beside the causes of a fit.

    Args:
        problem: what is to be explained; tolerances are its first columns.
        fitted: the causes.

    Returns:
        The problem, whose other columns are those beside the causes, too; None if the slopes are
        nearly the old ones, or explain little of what the causes leave.
    """
    columns, rough = problem.noise_model.tolerances, problem.roughness
    replayer, tolerances = problem.replayer, problem.tolerances
    if replayer.expansion.parts or is_small(replayer, columns, fitted.residual):
        return None
    free = [
        i
        for i, one in enumerate(tolerances)
        if not any(one.candidate.matches(other) for other in fitted.candidates)
    ]
    if not free:
        return None
    largest = sorted(free, key=lambda i: -float(np.linalg.norm(columns[:, i])))[:COMPARED]
    some = [tolerances[i] for i in largest]
    old, new = (_slopes(problem, some, one) for one in (null_fit(problem), fitted))
    if not np.isfinite(new).all() or not _is_bent(old, new):
        return None
    own = rough * _slopes(problem, [tolerances[i] for i in free], fitted)
    own[:, ~np.isfinite(own).all(axis=0)] = 0.0
    own = _as_strong(problem, [tolerances[i] for i in free], own, columns[:, free], fitted)
    found = np.zeros_like(columns[:, : len(tolerances)])
    found[:, free] = own
    starts = [rough * column for column in start_columns(replayer, fitted.hypothesis)]
    noise_model = replace(problem.noise_model, tolerances=np.column_stack([found, *starts]))
    return replace(problem, noise_model=noise_model)


def _slopes(problem: Problem, tolerances: list[Tolerance], fitted: Fit) -> Floats:
    """Return the changes of the readings by one tolerance each beside causes, shape (n, p).

    Steps are the same wherever slopes are taken: where a joint sticks, others differ by themselves.
    """
    hypotheses: list[Hypothesis] = [
        [one.deviation(DIFFERENCE), *fitted.hypothesis] for one in tolerances
    ]
    residuals = problem.replayer.residuals(hypotheses)
    return np.column_stack([(fitted.residual - other) / DIFFERENCE for other in residuals])


def _as_strong(
    problem: Problem, tolerances: list[Tolerance], own: Floats, nominal: Floats, fitted: Fit
) -> Floats:
    """Return columns (n, p) with tolerances of forces as large as their motors are strong.

    Their effect does not become less, or more where a motor is stronger, than that beside the
    nominal model.

    Args:
        problem: what is to be explained.
        tolerances: the p tolerances.
        own: change of the readings by these beside the causes.
        nominal: the same beside the nominal model.
        fitted: the causes.
    """
    strength = np.array([_strength(problem.system, one, fitted.hypothesis) for one in tolerances])
    before, now = np.linalg.norm(nominal, axis=0), np.linalg.norm(own, axis=0)
    factor = np.divide(before, now, out=np.ones_like(now), where=now > 0.0)
    return own * np.clip(factor, np.minimum(1.0, strength), np.maximum(1.0, strength))


def _strength(system: System, tolerance: Tolerance, hypothesis: Hypothesis) -> float:
    """Return how strong the motors are that bear a force with a tolerance, over their model.

    It is 1 for a tolerance of something else, such as a length or a mass.
    """
    location = tolerance.candidate.location
    if not tolerance.parameter.unit.startswith("N"):
        return 1.0
    moved = set(location.elements if location.kind == "actuator" else ())
    for joint in location.elements if location.kind == "joint" else ():
        moved.update(motors_of(system, joint))
    found = 1.0
    for one, values in hypothesis:
        if one.cause.id in STRENGTH and moved & set(one.location.elements):
            found *= 1.0 + values["excess"]
    return max(WEAKEST, found)


def _is_bent(old: Floats, new: Floats) -> bool:
    """Return whether any slope (n, p) differs much from the old one."""
    sizes = np.maximum(np.linalg.norm(old, axis=0), np.linalg.norm(new, axis=0))
    return bool(np.any(np.linalg.norm(new - old, axis=0) > BENT * sizes))
