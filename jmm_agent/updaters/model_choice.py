"""Choice of what the fit of rests believes beside errors of the map: a drift, misplaced joints.

After an observation, fits with other beliefs are compared with the present one by the probability
of all that was measured,

    log p = -(cost - g' H^-1 g + log det C + log det H) / 2,

with the cost of the fit with another belief, where the present one ended, its gradient g, its
Gauss-Newton matrix H, and the covariance C of the errors of lengths and poses. One that is clearly
likelier is believed from then on.

Kawaharazuka et al. 2018 assume constant lengths and right bones; this choice is ours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jmm_agent.updaters.rest_fitter import FittedRests, RestFitter, RestMemory
from jmm_agent.vision.length_drift import near_speeds
from jmm_agent.vision.marker_observation import MarkerObservation

LEAST = 8
"""Number of observations from which on another belief may be chosen."""
DRIFT_EVIDENCE = 3.0
"""Least logarithm of the Bayes factor by which another speed of the drift must be likelier."""
JOINTS_EVIDENCE = 2.0
"""The same of the joints' errors. On robots with right bones (seeds 0 to 4, also with points
displaced by 10 mm) it was -2 or less after 27 observations; with bones that are 5 mm and axes that
are 3 deg off 2.4, with three times as much 26 [1]."""


def with_likeliest_model(
    fitter: RestFitter, found: FittedRests, observations: Sequence[MarkerObservation]
) -> FittedRests:
    """A fit with the likeliest drift and errors of the joints, if they are not those of a fit.

    Args:
        fitter: of rests.
        found: result of its fit.
        observations: its K observations.
    """
    if not fitter.enabled or len(observations) < LEAST:
        return found
    # The ages of rests without an observation are unknown.
    alone = found._replace(memory=found.memory._replace(rests=()))
    drift, noise = found.memory.drift, fitter.nominal.options.noise
    drifting = [
        alone.memory._replace(drift=drift._replace(speed=speed))
        for speed in near_speeds(drift.speed, noise)
    ]
    chosen = _likeliest(fitter, alone, drifting, observations, DRIFT_EVIDENCE)
    found = found if chosen is alone else chosen
    misplaced = [found.memory._replace(joints=one) for one in fitter.near_joints(found.memory)]
    return _likeliest(fitter, found, misplaced, observations, JOINTS_EVIDENCE)


def _likeliest(
    fitter: RestFitter,
    found: FittedRests,
    others: Sequence[RestMemory],
    observations: Sequence[MarkerObservation],
    least: float,
) -> FittedRests:
    """The fit, or that with the likeliest of other beliefs if it is clearly likelier."""
    angles, elongated = found.observed.angles, found.elongated
    unknown = fitter.unknown(found.memory, angles)
    evidence = [
        fitter.problem(memory, observations, angles, elongated).log_evidence(unknown, near=True)
        for memory in (found.memory, *others)
    ]
    best = int(np.argmax(evidence))
    if evidence[best] <= evidence[0] + least:
        return found
    return fitter.fit(others[best - 1], observations, angles, elongated)
