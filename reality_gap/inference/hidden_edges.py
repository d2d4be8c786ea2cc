"""Hidden edges: begins and ends of events where no reading shows them to which causes are fitted.

An effort shows a push at that moment only, while positions remember it. An edge within a block of
the report split can therefore be anywhere in that block, and wherever the fit left it, the report
split has an error as large as the push. What the block shows of the edge is no more than a time, so
that it is moved there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reality_gap.causes.base import Parameter
from reality_gap.inference.gauss_newton import Fit, Objective, Point, rescore, run_together
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import begin_and_duration, to_theta
from reality_gap.inference.whitening import whitening
from reality_gap.simulation.hypothesis import Hypothesis
from reality_gap.study.data import Study
from reality_gap.study.measurements import BLOCK
from reality_gap.study.splits import hidden_block

STEPS = 20
"""Number of steps from one end of a block to the other."""
BESIDE = 0.1
"""Distance from a block at which the fit may put an edge that lies in it [s]: that of the rise of a
push, and of the filter of efforts."""


def with_hidden_edges(problem: Problem, fitted: Fit) -> Fit:
    """Return a fit whose events begin and end where all readings show it.

    Args:
        problem: what is explained; in studies of commands, nothing changes.
        fitted: causes. Of an event that happens once in a study of efforts, an edge within a block
            of the report split is moved within that block.
    """
    if not problem.system.study.inverse:
        return fitted
    for i, (candidate, _) in enumerate(fitted.hypothesis):
        times = begin_and_duration(candidate)
        if times is None or candidate.location.note:  # others have edges in several blocks
            continue
        for at_end in (False, True):
            fitted = _best(problem, fitted, _trials(problem, fitted.hypothesis, i, times, at_end))
    return fitted


def _trials(
    problem: Problem,
    hypothesis: Hypothesis,
    i: int,
    times: tuple[Parameter, Parameter],
    at_end: bool,
) -> list[Hypothesis]:
    """Return a hypothesis with one edge of an event elsewhere in its block, if that is hidden.

    Args:
        problem: what is explained.
        hypothesis: causes with their values.
        i: index of the event.
        times: its begin and its duration.
        at_end: whether the edge is the end of the event.
    """
    begin, duration = times
    candidate, values = hypothesis[i]
    start, end = values[begin.name], values[begin.name] + values[duration.name]
    study, length = problem.system.study, problem.measured.block
    moved = _hidden(study, end if at_end else start, length)
    found = list[Hypothesis]()
    for first, last in ((start, t) if at_end else (t, end) for t in moved):
        lasts = min(max(last - first, duration.low), duration.high)
        edges = {begin.name: min(max(first, begin.low), begin.high), duration.name: lasts}
        found.append([*hypothesis[:i], (candidate, {**values, **edges}), *hypothesis[i + 1 :]])
    return found


def _hidden(study: Study, time: float, length: float = BLOCK) -> list[float]:
    """Return times in the block of the report split at a time in the study, if there is one [s].

    Blocks have this length [s].
    """
    start = 0.0
    for e, episode in enumerate(study.episodes):
        if time < start + episode.duration:
            near = (
                hidden_block(e, time - start + change, length) for change in (0.0, -BESIDE, BESIDE)
            )
            block = next((one for one in near if one is not None), None)
            if block is None:
                return []
            times = np.linspace(*block, STEPS + 1)
            return (start + times[times <= episode.duration]).tolist()
        start += episode.duration
    return []


def _best(problem: Problem, fitted: Fit, trials: Sequence[Hypothesis]) -> Fit:
    """Return the fit with the best of some hypotheses, by all readings."""
    if not trials:
        return fitted
    model = problem.noise_model
    every = np.ones(len(model.inflation), dtype=bool)
    whiten = whitening(model.tolerances, model.inflation, every)
    residuals = [fitted.residual, *problem.replayer.residuals(trials)]
    powers = [float(np.sum(whiten(residual) ** 2)) for residual in residuals]
    best = int(np.nanargmin(powers))
    if best == 0:
        return fitted
    hypothesis, residual = trials[best - 1], residuals[best]
    theta = to_theta(hypothesis)
    slopes = Objective(problem, hypothesis).differences(Point(theta, residual))
    [jacobian] = run_together(problem.replayer, [slopes])
    return rescore(problem, Fit(hypothesis, residual, jacobian, theta, 0.0))
