"""Own step: whether a log comes from a simulation with the model's own time step.

Residuals are those of a machine in continuous time: the error of the time step is extrapolated away
(`Replayer.drift`). A log that was simulated with the same step has this error, too. Its causes are
found in either case, because a part of the error is tolerated; with them, the readings decide.
Where efforts are compared, nothing is integrated, but dry friction of a simulated log is softer
than that of a machine, and the readings decide about this.
"""

from __future__ import annotations

import numpy as np

from reality_gap.inference.forward_selection import Search
from reality_gap.inference.gauss_newton import Fit, fit, fit_stepwise, null_fit, run_together
from reality_gap.inference.problem import Problem
from reality_gap.types import Floats

LIKELIER = 3.0
"""Log likelihood by which the model's own step must predict the readings better, if deviations
within tolerances are not counted [nats]; with them it must not be worse."""
NOISE = 3.0
"""RMS up to which the likeliest causes must explain a simulated log [noise]."""
LEFT = 0.5
"""Share of what causes leave above the noise up to which it must fall if the error of the time step
about them was the reason."""
OTHERS = 3
"""How many of the likeliest fits of each of the last two steps are fitted with it."""


def settle_step(found: Search) -> bool:
    """Choose what is done about the error of the time step, and return whether that changed.

    If the log does not have the error, it is extrapolated away about the causes that were found,
    because it depends on them: a weaker servo follows later, so that a step is a larger share.

    Args:
        found: a search with the error of the nominal model.
    """
    if has_own_step(found):
        found.problem.replayer.own_step = True
        return True
    return not found.best.is_null and _extrapolates_about(found.problem, found.best)


def _extrapolates_about(problem: Problem, best: Fit) -> bool:
    """Take the error of the time step from the causes, if it is what they leave; return whether.

    Where they leave much else, as on a machine that sticks, the error about them is as wrong as
    that of the nominal model.
    """
    replayer, noise = problem.replayer, problem.measured.noise
    nominal = replayer.step_error
    if not _is_seen(nominal.drift / noise):
        return False
    error = replayer.step_error_of(best.hypothesis)
    if not _is_seen((error.drift - nominal.drift) / noise):
        return False
    replayer.step_error = error
    about = Problem(replayer, replayer.residual([]), problem.noise_model)
    if _excess(fit(about, best.hypothesis)) < LEFT * _excess(best):
        return True
    replayer.step_error = nominal
    return False


def _is_seen(change: Floats) -> bool:
    """Return whether a change of residuals (n,) is seen beside the noise."""
    return 0.5 * _squares(change) > LIKELIER


def has_own_step(found: Search) -> bool:
    """Return whether the log is likelier with the model's own time step, or with soft friction.

    The likeliest causes are fitted again without the extrapolation. So are their alternatives,
    because the error of the step may be what made them less likely.

    Args:
        found: a search with the extrapolation.
    """
    problem, replayer = found.problem, found.problem.replayer
    others = [one for step in found.steps[-2:] for one in step.tried[:OTHERS]]
    likely = [one for one in (found.best, *others) if not one.is_null]
    replayer.own_step = True
    try:
        null = replayer.residual([])
        if not _is_seen(null - problem.null_residual):
            return False
        own = Problem(replayer, null, problem.noise_model)
        fits = [fit_stepwise(own, one.hypothesis) for one in likely]
        found_own = [null_fit(own), *run_together(replayer, fits)]
    finally:
        replayer.own_step = False
    best = max(found_own, key=lambda one: one.evidence)
    bare = _squares(found.best.residual) - _squares(best.residual)
    if _squares(best.residual) > NOISE**2 * len(best.residual):
        return False
    likelier = _likelihood(own, best) > _likelihood(problem, found.best)
    return likelier and 0.5 * bare > LIKELIER


def _excess(fitted: Fit) -> float:
    """Return the mean square of what a fit leaves, over that of noise."""
    return _squares(fitted.residual) / len(fitted.residual) - 1.0


def _likelihood(problem: Problem, fitted: Fit) -> float:
    """Return the log likelihood of the readings, except for a constant [nats]."""
    null = problem.noise_model.whiten(problem.null_residual)
    return fitted.evidence - 0.5 * _squares(null)


def _squares(values: Floats) -> float:
    return float(np.sum(values**2))
