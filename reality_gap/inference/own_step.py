"""Own step: whether a log comes from a simulation with the model's own time step.

Residuals are those of a machine in continuous time: the error of the time step is extrapolated away
(`Replayer.drift`). A log that was simulated with the same step has this error, too. Its causes are
found in either case, because a part of the error is tolerated; with them, the readings decide.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from reality_gap.inference.forward_selection import Search
from reality_gap.inference.gauss_newton import Fit, fit_stepwise, null_fit, run_together
from reality_gap.inference.problem import Problem
from reality_gap.inference.theta import prior_weights
from reality_gap.types import Floats

LIKELIER = 3.0
"""Log likelihood by which the model's own step must predict the readings better, if deviations
within tolerances are not counted [nats]; with them it must not be worse."""
NOISE = 3.0
"""RMS up to which the likeliest causes must explain a simulated log [noise]."""
OTHERS = 3
"""How many of the likeliest fits of each of the last two steps are fitted with it."""


def settle_step(found: Search) -> bool:
    """Choose what is done about the error of the time step, and return whether that changed.

    If the log does not have the error, it is extrapolated away about the causes that were found,
    because it depends on them: a weaker servo follows later, so that a step is a larger share.

    Args:
        found: a search with the error of the nominal model.
    """
    replayer = found.problem.replayer
    if has_own_step(found):
        replayer.own_step = True
        return True
    nominal = replayer.drift
    if found.best.is_null or not _is_seen(found.problem, nominal):
        return False
    error = replayer.step_error_of(found.best.hypothesis)
    if not _is_seen(found.problem, error.drift - nominal):
        return False
    replayer.step_error = error
    return True


def _is_seen(problem: Problem, change: Floats) -> bool:
    """Return whether a change of the predictions (n,) in SI units is seen beside the noise."""
    return 0.5 * _squares(change / problem.measured.noise) > LIKELIER


def has_own_step(found: Search) -> bool:
    """Return whether the log is likelier with the model's own time step.

    The likeliest causes are fitted again without the extrapolation. So are their alternatives,
    because the error of the step may be what made them less likely.

    Args:
        found: a search with the extrapolation.
    """
    problem, replayer = found.problem, found.problem.replayer
    if not _is_seen(problem, replayer.drift):
        return False
    others = [one for step in found.steps[-2:] for one in step.tried[:OTHERS]]
    likely = [one for one in (found.best, *others) if not one.is_null]
    change = replayer.drift / problem.measured.noise
    replayer.own_step = True
    try:
        own = Problem(replayer, problem.null_residual + change, problem.noise_model)
        fits = [fit_stepwise(own, one.hypothesis) for one in likely]
        found_own = [null_fit(own), *run_together(replayer, fits)]
    finally:
        replayer.own_step = False
    best = min(found_own, key=partial(_cost, own))
    bare = _squares(found.best.residual) - _squares(best.residual)
    if _squares(best.residual) > NOISE**2 * len(best.residual):
        return False
    return _cost(problem, found.best) > _cost(own, best) and 0.5 * bare > LIKELIER


def _cost(problem: Problem, fitted: Fit) -> float:
    """Return half the squares of the whitened residual and of the weighted theta [nats]."""
    weighted: Floats = prior_weights(fitted.hypothesis) * fitted.theta
    return 0.5 * (_squares(problem.noise_model.whiten(fitted.residual)) + _squares(weighted))


def _squares(values: Floats) -> float:
    return float(np.sum(values**2))
