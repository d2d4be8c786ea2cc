"""Record of predicted looks: errors beside predicted ones, and how far predictions can be believed.

The covariance of a prediction (`jmm_agent.vision.observation_prediction`) follows from prior widths
that hold for many robots, so on one robot it may be too large or too small by a factor, which
changes while the robot is learned. The factor is learned from the looks before: given it, the
squared distances d^2 have chi-squared distributions of m measured numbers each. The prior counts as
one look of `PRIOR` numbers with the factor 1; each look counts `FORGET` times as much as the one
after it, as in a discounted model of a variance (West and Harrison, Bayesian Forecasting and
Dynamic Models, 2nd ed., 1997). With the weighted sums

    nu = sum m,    factor = sum d^2 / nu,

d^2 / (m factor) of the next look has an F distribution of m and nu degrees of freedom. Its quantile
bounds the region in which the look is expected.
"""

from __future__ import annotations

import logging
from collections import deque
from typing import NamedTuple

import numpy as np

from jmm_agent.updaters.vision_memory import Seen
from jmm_agent.vision.observation_prediction import REGION, ObservationPrediction

PRIOR = 6.0
"""Number of measured numbers that the prior of the factor counts as."""
FORGET = 0.6
"""Weight of a look beside the one after it [1]. Over 162 looks of six actual robots (seeds 0 to 5)
regions of 95 % covered 97 % with 0.5, 98 % with 0.6 to 0.8, and all with 0.9."""
MOST = 1000
"""Number of newest looks that are kept."""

_log = logging.getLogger(__name__)


class PredictedObservation(NamedTuple):
    """One look.

    Attributes:
        predicted: what was expected of it before it was learned, by the looks before it.
        seen: the result.
    """

    predicted: ObservationPrediction
    seen: Seen


class PredictionRecord:
    """Looks that were predicted, the newest last; predictions are scaled by those before.

    Attributes:
        newest: the newest `MOST`.
        count: number of all.
        inside: number of those in the region in which they were expected.
    """

    def __init__(self) -> None:
        self.newest: deque[PredictedObservation] = deque(maxlen=MOST)
        self.count = self.inside = 0
        self._squares = self._measured = PRIOR

    @property
    def freedom(self) -> float:
        """Number of measured numbers by which the factor is known, nu."""
        return self._measured

    @property
    def factor(self) -> float:
        """By how much covariances of predictions are multiplied [1]."""
        return self._squares / self._measured

    @property
    def coverage(self) -> float:
        """Share of looks in the region of 95 % in which they were expected; NaN before any."""
        return self.inside / self.count if self.count else np.nan

    @property
    def sentence(self) -> str:
        """How many looks were as expected, in one sentence; empty before any."""
        if not self.count:
            return ""
        return (
            f"{self.inside} of {self.count} looks at the hand were in the region in which the "
            f"agent expected {REGION:.0%} of them."
        )

    def add(self, seen: Seen) -> None:
        """Add the result of a look; one that was not predicted changes nothing.

        Args:
            seen: the result.
        """
        raw = seen.predicted
        if raw is None:
            return
        predicted = raw.scaled(self.factor, self.freedom)
        self.count += 1
        self.inside += int(predicted.inside)
        self.newest.append(PredictedObservation(predicted, seen))
        self._squares = FORGET * self._squares + raw.distance
        self._measured = FORGET * self._measured + raw.measured
        _log.info("Look %d: %s.", self.count, predicted.sentence)
        if seen.hand_error is not None:
            _log.info("Look %d: %s.", self.count, seen.hand_error.sentence)
