"""Fit of all marker observations, as the options want it: joint angles and elongations."""

from __future__ import annotations

import numpy as np

from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.updaters.rest_fitter import FittedRests, RestFitter
from jmm_agent.updaters.vision_memory import VisionMemory
from jmm_agent.updaters.vision_options import VisionOptions
from jmm_agent.vision.camera_unknowns import camera_of, corrected_observations
from jmm_agent.vision.incremental_fit import fit_incrementally, fit_newest
from jmm_agent.vision.observation_fit import MarkerObservation, PoseResidual, fit_alone
from jmm_agent.vision.permanent_elongation import fit_with_elongation


class ObservationFitter:
    """Fits a new observation together with those that are remembered.

    Args:
        fitter: fits observations together with other rests.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: of the Vision Updater.
    """

    def __init__(
        self,
        fitter: RestFitter,
        marker_residual: PoseResidual,
        limits: Floats,
        options: VisionOptions,
    ) -> None:
        self._fitter, self._marker_residual = fitter, marker_residual
        self._limits, self._options = limits, options

    def fit(
        self, memory: VisionMemory, prior: MapPrior, observations: list[MarkerObservation]
    ) -> FittedRests:
        """Joint angles of all observations, and the elongations of each muscle since each.

        Args:
            memory: before the newest observation.
            prior: of the map's error, by what is known from rests.
            observations: those that are remembered, and the newest.
        """
        options, residual, limits = self._options.observations, self._marker_residual, self._limits
        start, elongated = self._start(memory, observations)
        if self._fitter.enabled:
            drift = memory.rests.drift.observing(len(observations))
            rests = memory.rests._replace(drift=drift)
            return self._fitter.fit_with_elongation(rests, observations, start, elongated)
        if self._options.fit == "alone":
            alone = fit_alone(observations[-1], residual, limits, options)
            angles = np.vstack([memory.angles, alone.angles])[-options.memory :]
            return FittedRests(alone._replace(angles=angles), elongated, memory.rests)
        fitted = fit_incrementally if self._options.fit == "incremental" else fit_with_elongation
        fit, elongated = fitted(observations, prior, residual, limits, options, start, elongated)
        return FittedRests(fit, elongated, memory.rests)

    def evaluate(
        self, memory: VisionMemory, prior: MapPrior, observations: list[MarkerObservation]
    ) -> FittedRests:
        """As `fit`, but all observations but the newest are held, unless all are fitted together.

        That takes a fraction of the time, and gives angles that are nearer to the estimate.
        """
        options, residual, limits = self._options.observations, self._marker_residual, self._limits
        held = self._fitter.enabled or self._options.fit == "incremental"
        if not held or len(observations) == 1:
            return self.fit(memory, prior, observations)
        start, elongated = self._start(memory, observations)
        shown = corrected_observations(observations, memory.rests.camera, camera_of(residual))
        drift = memory.rests.drift.observing(len(observations))
        prior = prior.with_drift(drift.covariance)
        fit = fit_newest(shown, prior, residual, limits, options, start, elongated)
        return FittedRests(fit, elongated, memory.rests)

    def _start(
        self, memory: VisionMemory, observations: list[MarkerObservation]
    ) -> tuple[Floats, Floats]:
        """Joint angles (K, n) [rad] and elongations (K, m) from which a fit begins."""
        most, none = self._options.observations.memory, np.zeros(memory.elongated.shape[1])
        start = np.vstack([memory.angles, observations[-1].guess])[-most:]
        return start, np.vstack([memory.elongated, none])[-most:]
