"""Posture at which the responses of a robot without faults are the likeliest.

Where the robot is, is known only roughly, and a wrong posture gives wrong responses, which may look
like a fault. So a robot without faults gets the posture that explains its responses best, near the
one that is given or elsewhere, before anything else is taken into consideration. A fault of one or
two muscles hardly moves it, because errors have long tails.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.commissioning.likelihood import Likelihood
from jmm_agent.commissioning.options import CommissionOptions
from jmm_agent.commissioning.prediction import Prediction
from jmm_agent.commissioning.pull_record import PullRecord
from jmm_agent.commissioning.wiring import Wiring
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Floats

WIDTHS = (0.5, 0.5, 0.25, 0.25, 0.15, 0.15, 0.1, 0.1)
"""Standard deviations of the sampled postures about the best one so far, as shares of the ranges of
the joints, in rounds [1]."""
TRIALS = 12
"""Number of postures in a round."""
SAMPLES = 16
"""Number of sampled moment arms at each."""


def likelihood_at_best(
    record: PullRecord,
    jmm: JointMuscleMap,
    joint_limits: Floats,
    posture: Floats,
    options: CommissionOptions,
) -> Likelihood:
    """Likelihood of wirings at the posture that a robot without faults is the likeliest to have.

    Args:
        record: of the pulls.
        jmm: the nominal map.
        joint_limits: lowest and highest angle of each joint (n, 2) [rad].
        posture: joint angles (n,) [rad] at which the robot is, about.
        options: uncertainty.
    """
    healthy, rng = Wiring.healthy(len(record.muscles)), np.random.default_rng(0)
    low, high = np.asarray(joint_limits, dtype=float).T

    def at(q: Floats, samples: int) -> Likelihood:
        return Likelihood(record, Prediction(jmm, joint_limits, q, options, samples), options)

    best = np.clip(posture, low, high)
    most = at(best, SAMPLES).of(healthy)
    for width in WIDTHS:
        about = best
        for noise in rng.standard_normal((TRIALS, len(low))):
            trial = np.clip(about + width * (high - low) * noise, low, high)
            found = at(trial, SAMPLES).of(healthy)
            if found > most:
                best, most = trial, found
    return at(best, 4 * SAMPLES)
