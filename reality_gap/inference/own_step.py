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
from reality_gap.simulation.replayer import Discretisation
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
    about = _error_about(found)
    if has_own_step(found, about):
        found.problem.replayer.own_step = True
        return True
    return about is not None and _extrapolates_about(found, about)


def _error_about(found: Search) -> Discretisation | None:
    """Return the error of the time step about the causes; None if readings show no difference."""
    replayer, noise = found.problem.replayer, found.problem.measured.noise
    nominal = replayer.step_error
    if found.best.is_null or not _is_seen(nominal.drift / noise):
        return None
    error = replayer.step_error_of(found.best.hypothesis)
    return error if _is_seen((error.drift - nominal.drift) / noise) else None


def _extrapolates_about(found: Search, error: Discretisation) -> bool:
    """Take the error of the time step from the causes, if it is what they leave; return whether.

    Where they leave much else, as on a machine that sticks, the error about them is as wrong as
    that of the nominal model.
    """
    replayer = found.problem.replayer
    nominal, replayer.step_error = replayer.step_error, error
    about = Problem(replayer, replayer.residual([]), found.problem.noise_model)
    if _excess(fit(about, found.best.hypothesis)) < LEFT * _excess(found.best):
        return True
    replayer.step_error = nominal
    return False


def _likelihood_about(found: Search, error: Discretisation) -> float:
    """Return the log likelihood of the likeliest fit with an error of the time step [nats]."""
    replayer = found.problem.replayer
    nominal, replayer.step_error = replayer.step_error, error
    try:
        about = Problem(replayer, replayer.residual([]), found.problem.noise_model)
        fits = [fit_stepwise(about, one.hypothesis) for one in _likely(found)]
        return max(_likelihood(about, one) for one in run_together(replayer, fits))
    finally:
        replayer.step_error = nominal


def _likely(found: Search) -> list[Fit]:
    """Return the causes that were found, and their alternatives."""
    others = [one for step in found.steps[-2:] for one in step.tried[:OTHERS]]
    return [one for one in (found.best, *others) if not one.is_null]


def _is_seen(change: Floats) -> bool:
    """Return whether a change of residuals (n,) is seen beside the noise."""
    return 0.5 * _squares(change) > LIKELIER


def has_own_step(found: Search, about: Discretisation | None = None) -> bool:
    """Return whether the log is likelier with the model's own time step, or with soft friction.

    The likeliest causes are fitted again without the extrapolation. So are their alternatives,
    because the error of the step may be what made them less likely.

    Args:
        found: a search with the extrapolation about the nominal model.
        about: error of the time step about the causes, if it is another one. Large faults change it
            so much that a log of a machine may be nearer to none than to that of the model.
    """
    problem, replayer = found.problem, found.problem.replayer
    replayer.own_step = True
    try:
        null = replayer.residual([])
        if not _is_seen(null - problem.null_residual):
            return False
        own = Problem(replayer, null, problem.noise_model)
        fits = [fit_stepwise(own, one.hypothesis) for one in _likely(found)]
        found_own = [null_fit(own), *run_together(replayer, fits)]
    finally:
        replayer.own_step = False
    best = max(found_own, key=lambda one: one.evidence)
    bare = _squares(found.best.residual) - _squares(best.residual)
    if _squares(best.residual) > NOISE**2 * len(best.residual):
        return False
    likelihood = _likelihood(own, best)
    if likelihood <= _likelihood(problem, found.best) or 0.5 * bare <= LIKELIER:
        return False
    return about is None or likelihood > _likelihood_about(found, about)


def _excess(fitted: Fit) -> float:
    """Return the mean square of what a fit leaves, over that of noise."""
    return _squares(fitted.residual) / len(fitted.residual) - 1.0


def _likelihood(problem: Problem, fitted: Fit) -> float:
    """Return the log likelihood of the readings, except for a constant [nats]."""
    null = problem.noise_model.whiten(problem.null_residual)
    return fitted.evidence - 0.5 * _squares(null)


def _squares(values: Floats) -> float:
    return float(np.sum(values**2))
