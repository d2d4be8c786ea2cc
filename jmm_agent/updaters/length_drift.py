"""Lengths that drift: their encoders slip, or wires creep or warm up, all the time.

The length of each muscle is then off by a random walk in time, which any number of looks never
averages out. Its variance grows by a rate that is the same for all muscles, and counts as that many
permanent elongations a second (`jmm_agent.mapping.prior`); the fit of all rests takes it from
there. The rate is the one of `STEPS` under which all that was measured is likeliest,

    log p(rate) = -(cost - g' H^-1 g + log det C + log det H) / 2,

with the cost of the fit, its gradient g and its Gauss-Newton matrix H where the fit ended with the
present rate, and the covariance C of the lengths' errors.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve

from jmm_agent.types import Floats
from jmm_agent.vision.rest_fit import RestProblem

STEPS = (0.0, 0.00002, 0.00004, 0.00008, 0.00016, 0.00032)
"""Standard deviations of the drift of a length in one second that are compared [m]."""
LEAST = 8
"""Number of observations from which on lengths may be found to drift."""
EVIDENCE = 3.0
"""Least logarithm of the Bayes factor by which another rate must be likelier."""
PAUSE = 600.0
"""Longest time between two looks for which lengths drift; they were at rest in a longer one [s]."""


class LengthDrift(NamedTuple):
    """Drift of all lengths, and how long ago each of K observations was.

    Attributes:
        rate: variance by which a length drifts, in permanent elongations a second [1/s].
        ages: of the observations (K,) [s], in time in which lengths were measured.
        time: of the newest observation [s]; NaN before the first one of an episode.
    """

    rate: float = 0.0
    ages: Floats = np.zeros(0)
    time: float = np.nan

    def at(self, time: float) -> LengthDrift:
        """The drift at the time [s] of another observation."""
        passed = min(max(time - self.time, 0.0), PAUSE) if np.isfinite(self.time - time) else 0.0
        return self._replace(ages=self.ages + passed, time=time)

    def observing(self, most: int) -> LengthDrift:
        """With an observation of now, of which at most so many are remembered."""
        return self._replace(ages=np.append(self.ages, 0.0)[-most:])


def log_evidence(problem: RestProblem, unknown: Floats) -> float:
    """Logarithm of the probability of all that was measured, near the most probable angles.

    Args:
        problem: cost of all rests.
        unknown: angles (K + R + 1, n) [rad], at the end of a fit of nearly this problem.
    """
    matrix, gradient = problem.normal_equations(unknown)
    gain = gradient @ solve(matrix, gradient, assume_a="pos")
    return problem.log_evidence(unknown) + 0.5 * float(gain)


def likeliest_rate(evidence: Callable[[float], float], present: float, elongation: float) -> float:
    """Rate of the drift that makes what was measured likeliest [1/s].

    Args:
        evidence: logarithm of the probability of what was measured, by the rate [1/s].
        present: rate that was believed so far [1/s].
        elongation: standard deviation of one permanent elongation [m].
    """
    rates = [(step / elongation) ** 2 for step in STEPS]
    found = {rate: evidence(rate) for rate in rates}
    best = max(rates, key=lambda rate: found[rate])
    known = found[present] if present in found else evidence(present)
    return best if found[best] > known + EVIDENCE else present
