"""Fit of all marker observations when one is new: the newest block first, then what it changes.

The cost is that of `jmm_agent.vision.observation_fit`. The K - 1 earlier observations are at its
minimum already, so

1. the newest posture is fitted while the others are held: of the kernel matrix only one row and
   column change, and with C = [[A, k], [k', c]] the cost of muscle m grows by its Schur complement

       (r_m - k' A^-1 a_m)^2 / (c - k' A^-1 k),

   with the residuals a_m of the others;
2. all postures take Gauss-Newton steps from there, as long as a step would lower the cost by more
   than `ObservationFitOptions.gain`; usually one or two, in place of four to seven.

Nothing is kept from fit to fit, so that the result is a function of the arguments to the bit, also
in another process.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.vision.incremental_problem import IncrementalProblem, NewestProblem, Rows
from jmm_agent.vision.marker_observation import MarkerObservation, PoseResidual
from jmm_agent.vision.observation_fit import (
    FitPoint,
    ObservationFit,
    ObservationFitOptions,
    descend,
)
from jmm_agent.vision.permanent_elongation import evidence_of_steps, with_likeliest_step

UNLIKELY = 2.0
"""Cost of the newest observation in its own minimum, for each of its numbers, from which on all
angles are also fitted from the guess: the minimum may be a local one, or others must move far."""


def fit_newest(
    observations: Sequence[MarkerObservation],
    prior: MapPrior,
    marker_residual: PoseResidual,
    limits: Floats,
    options: ObservationFitOptions,
    start: Floats,
    elongated: Floats,
) -> ObservationFit:
    """Fit the newest observation, while the others are held.

    Args:
        observations: K observations.
        prior: prior of the map's error.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: noise levels and limits of the fit.
        start: angles (K, n) [rad] to start from.
        elongated: number of elongations of each muscle since each observation (K, m).

    Returns:
        The fit; the others' angles are those of ``start``, their residuals are zero.
    """
    rows = Rows(prior, marker_residual)
    angles, end, converged, problem = _newest(
        observations, rows, prior, limits, options, start, elongated
    )
    norms = np.zeros((len(observations), 2))
    norms[-1] = problem.weights.norms(end.residuals)[0]
    return ObservationFit(angles, converged, norms)


def fit_incrementally(
    observations: Sequence[MarkerObservation],
    prior: MapPrior,
    marker_residual: PoseResidual,
    limits: Floats,
    options: ObservationFitOptions,
    start: Floats,
    elongated: Floats,
) -> tuple[ObservationFit, Floats]:
    """Fit all observations, of which the last is new, and find which muscles were elongated.

    Args:
        observations: K observations.
        prior: prior of the map's error and of elongations.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: noise levels and limits of the fit.
        start: angles (K, n) [rad] to start from: those of the last fit, and a guess.
        elongated: number of elongations of each muscle since each observation (K, m), as believed
            so far.

    Returns:
        As `fit_with_elongation`.
    """
    low, high = limits[:, 0] - options.limit_margin, limits[:, 1] + options.limit_margin
    rows = Rows(prior, marker_residual)
    angles, newest, *_ = _newest(observations, rows, prior, limits, options, start, elongated)
    starts = [np.clip(angles, low, high)]
    if newest.cost > UNLIKELY * (elongated.shape[1] + 6):
        starts.append(np.clip(start, low, high))
    recent = min(options.elongation_recent, len(observations) - 1)
    for _ in range(1 + elongated.shape[1]):
        problem = IncrementalProblem(observations, rows, prior, options, elongated)
        ends = [descend(problem, angles, low, high, options) for angles in starts]
        end, converged = min(ends, key=lambda found: found[0].cost)
        angles, starts = end.angles, [end.angles]
        if recent < 1 or options.elongation_evidence == np.inf:
            break
        evidence = evidence_of_steps(
            problem.normal_equations(angles),
            problem.kernels(angles),
            np.array([row.jacobian for row in problem.rows(angles)]),
            problem.missed(angles),
            prior.options.elongation,
            recent,
        )
        more = with_likeliest_step(evidence, elongated, options.elongation_evidence)
        if more is None:
            break
        elongated = more
    return ObservationFit(angles, converged, problem.weights.norms(end.residuals)), elongated


def _newest(
    observations: Sequence[MarkerObservation],
    rows: Rows,
    prior: MapPrior,
    limits: Floats,
    options: ObservationFitOptions,
    start: Floats,
    elongated: Floats,
) -> tuple[Floats, FitPoint, bool, IncrementalProblem | NewestProblem]:
    """Angles (K, n) [rad] with the newest fitted, its point, convergence and problem."""
    low, high = limits[:, 0] - options.limit_margin, limits[:, 1] + options.limit_margin
    problem: IncrementalProblem | NewestProblem
    if len(observations) == 1:
        problem = IncrementalProblem(observations, rows, prior, options, elongated)
    else:
        others = IncrementalProblem(observations[:-1], rows, prior, options, elongated[:-1])
        problem = NewestProblem(others, start[:-1], observations[-1], rows, prior, options)
    end, converged = descend(problem, np.clip(start[-1:], low, high), low, high, options)
    return np.vstack([start[:-1], end.angles]), end, converged, problem
