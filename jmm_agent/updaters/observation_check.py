"""Check of a fitted observation of the hand: why it is not believed, and by how much it misses."""

from __future__ import annotations

import numpy as np

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.types import Bools, Floats
from jmm_agent.updaters.vision_options import VisionOptions
from jmm_agent.vision.marker_observation import (
    MarkerObservation,
    PoseResidual,
    adds_only_noise,
    contradicted_joint,
    residual_of,
)
from jmm_agent.vision.observation_fit import ObservationFit
from jmm_agent.vision.pose_covariance import measures_rotation

UNREACHED = "inverse kinematics did not converge"
"""The pose is far from that of the fitted posture."""
UNCERTAIN = "the pose's covariance is too large to improve the estimate, and both agree"
"""Only the noise of the pose would be learned."""
TOO_CLOSE = "too close to the last update"
"""The posture is known already."""
USUAL = UNCERTAIN, TOO_CLOSE
"""Reasons not to learn from an observation that is right."""


class ObservationCheck:
    """Checks whether an observation is believed.

    Args:
        nominal_map: the map before learning.
        marker_residual: residual of the marker's pose at a posture.
        options: largest residuals.
    """

    def __init__(
        self, nominal_map: JointMuscleMap, marker_residual: PoseResidual, options: VisionOptions
    ) -> None:
        self._map, self._marker_residual, self._options = nominal_map, marker_residual, options

    def doubt(self, fit: ObservationFit, observation: MarkerObservation, learned: Floats) -> str:
        """Why an observation is not believed; empty if it is.

        Args:
            fit: of all observations, the newest last.
            observation: the newest.
            learned: joint angles (K, n) [rad] of the observations that were learned from before.
        """
        options, angles, estimate = self._options, fit.angles[-1], observation.guess
        noise = options.observations
        position, rotation = fit.residual_norms[-1]
        missed = position > options.position_residual or rotation > options.rotation_residual
        joint = contradicted_joint(observation, angles, noise.joint_noise)
        if joint is not None:
            return f"the joint encoder of {self._map.joints[joint]} contradicts the hand's pose"
        if missed or not fit.converged:
            return UNREACHED
        if np.linalg.norm(angles - estimate) >= options.threshold:
            return "too far from the estimate"
        if adds_only_noise(
            observation, self._marker_residual, noise.position_noise, noise.rotation_noise
        ):
            return UNCERTAIN
        if len(learned) and (np.linalg.norm(angles - learned[-1]) < options.distance):
            return TOO_CLOSE
        return ""

    def reached(self, fit: ObservationFit) -> Bools:
        """Which observations are near their fitted postures (K,)."""
        position, rotation = fit.residual_norms.T
        options = self._options
        near = (position <= options.position_residual) & (rotation <= options.rotation_residual)
        return np.asarray(near)

    def detail(self, doubt: str, observation: MarkerObservation, angles: Floats) -> str:
        """How far an observation is from its fitted posture, in a sentence; empty if it is near.

        Args:
            doubt: why it is not believed.
            observation: the observation.
            angles: joint angles (n,) [rad] that were fitted to it.
        """
        if doubt != UNREACHED:
            return ""
        error = residual_of(observation, self._marker_residual, angles)[0]
        missed = f"{np.linalg.norm(error[:3]):.3g} m"
        if measures_rotation(observation.covariance):
            missed += f" and {np.degrees(np.linalg.norm(error[3:])):.0f} deg"
        return f"the last pose is {missed} from the fitted posture's; check its unit and its frame"
