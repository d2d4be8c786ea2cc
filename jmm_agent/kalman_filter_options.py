"""How sure the estimator is of what."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jmm_agent.errors import AgentError


class EstimatorError(AgentError):
    """The estimator was given something unusable; its estimate is what it was before."""


@dataclass(frozen=True)
class EstimatorOptions:
    """How sure the filter is of what.

    Attributes:
        encoder_noise: standard deviation of a measured length, R [m].
        motion_noise: how far joints move, V [rad/sqrt(s)]; smaller averages more and lags more.
        process_noise: error of the state equation, mostly curvature, Q [rad/sqrt(s)].
        initial_std: of each joint at the start [rad].
        invalidation_std: added to each joint when the map has changed [rad].
        limit_margin: how far outside its limits an estimate may be [rad].
        window: number of updates over which consistency is judged.
        confidence: of the chi-squared band.
    """

    encoder_noise: float = 2e-4
    motion_noise: float = 3.0
    process_noise: float = 0.05
    initial_std: float = 0.5
    invalidation_std: float = 0.2
    limit_margin: float = 0.1
    window: int = 50
    confidence: float = 0.95

    def __post_init__(self) -> None:
        for name in ("encoder_noise", "motion_noise", "process_noise", "initial_std"):
            if not 0 < getattr(self, name) < np.inf:
                raise EstimatorError(f"Estimator: {name} is {getattr(self, name)}, not positive.")
        for name in ("invalidation_std", "limit_margin"):
            if not 0 <= getattr(self, name) < np.inf:
                raise EstimatorError(f"Estimator: {name} is {getattr(self, name)}, but negative.")
        if self.window < 1 or not 0 < self.confidence < 1:
            raise EstimatorError("Estimator: window must be 1 or more, confidence in (0, 1).")
