"""Wires that give for good, found among looks and allowed for.

A knot slips or a strand breaks, and from then on a wire's measured length differs by the same
amount at all postures. What earlier looks told of it is off by one number; the rest still holds:

    l_km = f_m(theta_k) + delta_m(theta_k) + d_km + e_km,

where d_km, how far wire m gave since look k, is a sum of steps of the prior's `give`. Whether a
wire gave just before look j is asked of the fit's residuals r_m. A step of size x adds x u to them,
u_k = 1 for k < j and 0 after; all joint angles may follow it. To first order the fit then holds

    I = u' C^-1 u - v' H^-1 v    and    b = u' C^-1 r_m + v' s

on x, with the wire's covariance C, the fit's Gauss-Newton matrix H and its remaining step -s, and
v = (C^-1 u)_k df_m/dtheta(theta_k) stacked over k. The Bayes factor for such a step is

    exp(b^2 / 2 (I + give^-2)) / sqrt(1 + give^2 I).

The step with the largest factor is taken if that is large enough, all angles are fitted anew, and
so on until none is. The paper's own rule forgets earlier pairs and so follows elongation (sec. I)
by itself; `RidgeRule` remembers them, and takes this to follow it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.vision.observation_fit import (
    MarkerObservation,
    ObservationFit,
    ObservationFitOptions,
    ObservationProblem,
    Sight,
    fit_observations,
)

HOLD = 1e-6
"""Added to the Gauss-Newton matrix, relative to its diagonal."""


def fit_with_elongation(
    observations: Sequence[MarkerObservation],
    prior: MapPrior,
    sight: Sight,
    limits: Floats,
    options: ObservationFitOptions,
    start: Floats,
    gave: Floats,
) -> tuple[ObservationFit, Floats]:
    """`fit_observations`, and which wires gave among the newest looks.

    Args:
        looks, prior, sight, limits, options, start: of `fit_observations`.
        gave: (K, m) how often each wire gave since each look, as believed so far.

    Returns:
        the fit, and how often each wire gave since each look (K, m).
    """
    fit = fit_observations(observations, prior, sight, limits, options, start, gave)
    recent = min(options.give_recent, len(observations) - 1)
    if recent < 1 or options.give_evidence == np.inf:
        return fit, gave
    for _ in range(gave.shape[1]):
        evidence = log_bayes_factors(observations, prior, sight, options, fit.angles, gave, recent)
        if evidence.max() < options.give_evidence:
            break
        look, muscle = np.unravel_index(evidence.argmax(), evidence.shape)
        gave = gave.copy()
        gave[: len(observations) - recent + look, muscle] += 1.0
        fit = fit_observations(observations, prior, sight, limits, options, fit.angles, gave)
    return fit, gave


def elongations(
    observations: Sequence[MarkerObservation], prior: MapPrior, angles: Floats, gave: Floats
) -> Floats:
    """By how much the length of each wire at each look (K, m) [m] exceeds what it would be now.

    Args:
        looks: K looks.
        prior: what is known of the map's error, and of how far a wire gives.
        angles: their joint angles (K, n) [rad].
        gave: (K, m) how often each wire gave since each look.
    """
    residual = np.array([look.lengths for look in observations]) - prior.map.lengths(angles)
    found = np.zeros_like(residual)
    if gave.any():
        for kernel in prior.groups(angles, gave=gave):
            found[:, kernel.muscles] = kernel.given @ kernel.whiten(residual[:, kernel.muscles])
    return found


def log_bayes_factors(
    observations: Sequence[MarkerObservation],
    prior: MapPrior,
    sight: Sight,
    options: ObservationFitOptions,
    angles: Floats,
    gave: Floats,
    recent: int,
) -> Floats:
    """Evidence that a wire gave just before each of the newest looks, (recent, m).

    Args:
        looks, prior, sight, options: of `fit_observations`.
        angles: joint angles of the looks (K, n) [rad], at or near the fit's.
        gave: (K, m) how often each wire gave since each look, as believed so far.
        recent: number of newest looks, below K.
    """
    count, give = len(observations), prior.options.give
    matrix, gradient = ObservationProblem(
        observations, prior, sight, options, gave
    ).normal_equations(angles)
    matrix[np.diag_indices_from(matrix)] *= 1.0 + HOLD
    factor = cho_factor(matrix)
    left = cho_solve(factor, gradient)
    expected, jacobian = prior.map.lengths_and_jacobian(angles)
    residual = np.array([look.lengths for look in observations]) - expected
    steps = np.tri(count, k=-1).T[:, count - recent :]  # u, a column each
    evidence = np.zeros((recent, gave.shape[1]))
    for kernel in prior.groups(angles, gave=gave):
        white = kernel.whiten(steps)
        alone = np.sum(steps * white, axis=0)
        for muscle in kernel.muscles:
            pull = (jacobian[:, muscle, :, None] * white[:, None, :]).reshape(left.size, recent)
            known = np.maximum(alone - np.sum(pull * cho_solve(factor, pull), axis=0), 0.0)
            slope = white.T @ residual[:, muscle] + pull.T @ left
            gain = slope**2 / (known + give**-2)
            evidence[:, muscle] = 0.5 * (gain - np.log1p(give**2 * known))
    return evidence
