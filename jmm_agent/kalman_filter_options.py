"""Noise levels and limits of the joint estimator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jmm_agent.errors import AgentError


class EstimatorError(AgentError):
    """Input that the estimator cannot use; its estimate is unchanged."""


@dataclass(frozen=True)
class EstimatorOptions:
    """Noise levels and limits of the filter.

    Attributes:
        encoder_noise: standard deviation of a measured length, sqrt(R) [m].
        motion_noise: how far joints move, sqrt(V) [rad/sqrt(s)]; a smaller value averages more and
            lags more.
        process_noise: error of the state equation, mostly by curvature, sqrt(Q) [rad/sqrt(s)].
        initial_std: standard deviation of each joint at the start [rad].
        invalidation_std: standard deviation added to each joint when the map has changed [rad].
        limit_margin: how far outside its limits a joint angle may be [rad].
        window: number of updates over which consistency is judged.
        confidence: probability that a consistent filter is inside the chi-squared band.
        joint_noise: standard deviation of a measured joint angle [rad].
        joint_tolerance: mean difference over the window from which on a measured joint angle
            contradicts the muscle lengths [rad].
    """

    encoder_noise: float = 2e-4
    motion_noise: float = 3.0
    process_noise: float = 0.05
    initial_std: float = 0.5
    invalidation_std: float = 0.2
    limit_margin: float = 0.1
    window: int = 50
    confidence: float = 0.95
    joint_noise: float = 0.001
    joint_tolerance: float = 0.05

    def __post_init__(self) -> None:
        positive = "encoder_noise motion_noise process_noise initial_std joint_noise"
        for name in (*positive.split(), "joint_tolerance"):
            if not 0 < getattr(self, name) < np.inf:
                raise EstimatorError(f"Estimator: {name} is {getattr(self, name)}, not positive.")
        for name in ("invalidation_std", "limit_margin"):
            if not 0 <= getattr(self, name) < np.inf:
                raise EstimatorError(f"Estimator: {name} is {getattr(self, name)}, but negative.")
        if self.window < 1 or not 0 < self.confidence < 1:
            raise EstimatorError("Estimator: window must be 1 or more, confidence in (0, 1).")
