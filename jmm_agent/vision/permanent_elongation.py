"""Permanent elongations of muscles: found among marker observations, and allowed for.

When a knot slips or a strand breaks, the measured length of a muscle differs from then on by the
same amount at all postures. The lengths of earlier observations are then off by one number; all
else that they show still holds:

    l_km = f_m(theta_k) + delta_m(theta_k) + d_km + e_km,

where d_km, the elongation of muscle m since observation k, is a sum of steps whose standard
deviation is the prior's `elongation`, s below.

Whether muscle m was elongated just before observation j is tested on the fit's residuals r_m. A
step of size x adds x u to them, with u_k = 1 for k < j and 0 after; all joint angles may follow it.
To first order the fit then has on x the information I and the slope b,

    I = u' C^-1 u - v' H^-1 v    and    b = u' C^-1 r_m + v' z,

with the muscle's covariance C, the fit's Gauss-Newton matrix H and its remaining step -z, and
v = (C^-1 u)_k df_m/dtheta(theta_k) stacked over k. The Bayes factor for such a step is

    exp(b^2 / 2 (I + s^-2)) / sqrt(1 + s^2 I).

The step with the largest factor is accepted if that is large enough; then all angles are fitted
again, until no step is accepted. The update rule of Kawaharazuka et al. 2018 forgets earlier pairs
and so follows elongation (sec. I) by itself; `RidgeRule` remembers them, and needs this module.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from jmm_agent.mapping.prior import GroupKernel, MapPrior, without_unknown
from jmm_agent.types import Floats
from jmm_agent.vision.observation_fit import (
    MarkerObservation,
    ObservationFit,
    ObservationFitOptions,
    ObservationProblem,
    PoseResidual,
    fit_observations,
)

REGULARISATION = 1e-6
"""Added to the Gauss-Newton matrix, relative to its diagonal."""


def fit_with_elongation(
    observations: Sequence[MarkerObservation],
    prior: MapPrior,
    marker_residual: PoseResidual,
    limits: Floats,
    options: ObservationFitOptions,
    start: Floats,
    elongated: Floats,
) -> tuple[ObservationFit, Floats]:
    """Fit all observations, and find which muscles were elongated among the newest ones.

    Args:
        observations: K observations.
        prior: prior of the map's error and of elongations.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: noise levels and limits of the fit.
        start: angles (K, n) [rad] to start from.
        elongated: number of elongations of each muscle since each observation (K, m), as believed
            so far.

    Returns:
        The fit, and the number of elongations of each muscle since each observation (K, m).
    """
    fit = fit_observations(observations, prior, marker_residual, limits, options, start, elongated)
    recent = min(options.elongation_recent, len(observations) - 1)
    if recent < 1 or options.elongation_evidence == np.inf:
        return fit, elongated
    for _ in range(elongated.shape[1]):
        evidence = log_bayes_factors(
            observations, prior, marker_residual, options, fit.angles, elongated, recent
        )
        more = with_likeliest_step(evidence, elongated, options.elongation_evidence)
        if more is None:
            break
        elongated = more
        fit = fit_observations(
            observations, prior, marker_residual, limits, options, fit.angles, elongated
        )
    return fit, elongated


def elongations(
    observations: Sequence[MarkerObservation], prior: MapPrior, angles: Floats, elongated: Floats
) -> Floats:
    """Difference of each measured length from what it would be now, by elongations and drift.

    Args:
        observations: K observations.
        prior: prior of the map's error and of elongations.
        angles: joint angles of the observations (K, n) [rad].
        elongated: number of elongations of each muscle since each observation (K, m).

    Returns:
        Lengths (K, m) [m] to subtract from the measured ones.
    """
    measured, since = without_unknown(np.array([one.lengths for one in observations]), elongated)
    missed = measured - prior.map.lengths(angles)
    found = np.zeros_like(missed)
    if since is not None and (elongated.any() or prior.drifted is not None):
        for kernel in prior.groups(angles, elongated=since):
            found[:, kernel.muscles] = kernel.elongation @ kernel.whiten(missed[:, kernel.muscles])
    return found


def log_bayes_factors(
    observations: Sequence[MarkerObservation],
    prior: MapPrior,
    marker_residual: PoseResidual,
    options: ObservationFitOptions,
    angles: Floats,
    elongated: Floats,
    recent: int,
) -> Floats:
    """Evidence that a muscle was elongated just before each of the newest observations.

    Args:
        observations: K observations.
        prior: prior of the map's error and of elongations.
        marker_residual: residual of the marker's pose at a posture.
        options: noise levels.
        angles: joint angles of the observations (K, n) [rad], at or near the fit's.
        elongated: number of elongations of each muscle since each observation (K, m), as believed
            so far.
        recent: number of newest observations, below K.

    Returns:
        Logarithms of the Bayes factors (recent, m).
    """
    problem = ObservationProblem(observations, prior, marker_residual, options, elongated)
    expected, jacobian = prior.map.lengths_and_jacobian(angles)
    lengths, since = without_unknown(np.array([found.lengths for found in observations]), elongated)
    return evidence_of_steps(
        problem.normal_equations(angles),
        prior.groups(angles, elongated=since),
        jacobian,
        lengths - expected,
        prior.options.elongation,
        recent,
    )


def evidence_of_steps(
    normal_equations: tuple[Floats, Floats],
    kernels: Sequence[GroupKernel],
    jacobian: Floats,
    missed: Floats,
    size: float,
    recent: int,
) -> Floats:
    """Evidence of `log_bayes_factors`, from a fit that is already linearised.

    Args:
        normal_equations: Gauss-Newton matrix (K n, K n) and gradient (K n,) of the fit.
        kernels: of the lengths' errors, for each group of muscles.
        jacobian: of the lengths by the nominal map (K, m, n) [m/rad].
        missed: measured lengths minus those of the nominal map (K, m) [m].
        size: standard deviation of an elongation [m].
        recent: number of newest observations, below K.

    Returns:
        Logarithms of the Bayes factors (recent, m).
    """
    count, muscles = missed.shape
    matrix, gradient = normal_equations[0].copy(), normal_equations[1]
    matrix[np.diag_indices_from(matrix)] *= 1.0 + REGULARISATION
    factor = cho_factor(matrix, lower=True)
    left = cho_solve(factor, gradient)
    steps = np.tri(count, k=-1).T[:, count - recent :]  # u, a column each
    evidence = np.zeros((recent, muscles))
    for kernel in kernels:
        white = kernel.whiten(steps)
        alone = np.sum(steps * white, axis=0)
        arms = jacobian[:, kernel.muscles].transpose(0, 2, 1)  # (K, n, muscles)
        pull = (arms[..., None] * white[:, None, None, :]).reshape(left.size, -1)
        solved = solve_triangular(factor[0], pull, lower=True, check_finite=False)
        shape = len(kernel.muscles), recent
        known = np.maximum(alone - np.sum(solved**2, axis=0).reshape(shape), 0.0)
        slope = (white.T @ missed[:, kernel.muscles]).T + (pull.T @ left).reshape(shape)
        gain = slope**2 / (known + size**-2)
        evidence[:, kernel.muscles] = (0.5 * (gain - np.log1p(size**2 * known))).T
    return evidence


def with_likeliest_step(evidence: Floats, elongated: Floats, least: float) -> Floats | None:
    """Numbers of elongations with the step of the largest evidence added.

    Args:
        evidence: logarithms of the Bayes factors (recent, m).
        elongated: number of elongations of each muscle since each observation (K, m).
        least: logarithm from which on a step is believed.

    Returns:
        Numbers (K, m); None if no step is believed.
    """
    if evidence.max() < least:
        return None
    rank, muscle = np.unravel_index(evidence.argmax(), evidence.shape)
    more = elongated.copy()
    more[: len(elongated) - len(evidence) + rank, muscle] += 1.0
    return more
