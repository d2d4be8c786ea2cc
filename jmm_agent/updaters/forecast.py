"""Forecasts of the Vision Updater: of a look before it is learned, and of what an update is worth.

An update is applied only if the error of the hand that is expected of the new map, over a fixed set
of postures, is below that of the map before it, both by all that is then known.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.updaters.rest_fitter import RestFitter, RestMemory
from jmm_agent.updaters.unexpected_poses import contradicted, is_unexpected
from jmm_agent.updaters.vision_memory import VisionMemory
from jmm_agent.updaters.vision_options import VisionOptions
from jmm_agent.vision.camera_unknowns import camera_of, corrected_observations
from jmm_agent.vision.hand_error import HandErrors, HandPostures
from jmm_agent.vision.map_posterior import MapPosterior
from jmm_agent.vision.marker_observation import MarkerObservation, PoseResidual
from jmm_agent.vision.observation_prediction import ObservationPrediction, compared, hidden
from jmm_agent.vision.rest_fit import fit_rests

REFUSED = "not applied: the expected error of the hand would rise"
"""Reason of an update that would make the map worse."""
NO_BETTER = "not applied: the expected error of the hand does not fall"
"""Reason of an update that would leave the map about as good as it is."""


def why_not_applied(error: HandErrors | None) -> str:
    """Why an update is not applied; empty if it is, or if it is not judged (None)."""
    if error is None or error.falls:
        return ""
    return REFUSED if error.rises else NO_BETTER


class Posterior(NamedTuple):
    """What a fit of K observations and R other rests tells.

    Attributes:
        unknown: joint angles of all, and the zero posture (K + R + 1, n) [rad].
        lengths: of the robot at any posture.
    """

    unknown: Floats
    lengths: MapPosterior


class Forecast:
    """Forecasts by the fit of all rests (module docstring).

    Args:
        fitter: fits the rests.
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: of the Vision Updater.
        judged: postures at which the hand's error is expected; None: updates are not judged.

    Attributes:
        judged: as given.
    """

    def __init__(
        self,
        fitter: RestFitter,
        marker_residual: PoseResidual,
        limits: Floats,
        options: VisionOptions,
        judged: HandPostures | None,
    ) -> None:
        self._fitter, self._marker_residual = fitter, marker_residual
        self._limits, self._options, self.judged = limits, options, judged

    @property
    def enabled(self) -> bool:
        """Whether the fit has a covariance: not if each observation is fitted alone."""
        return self._options.fit != "alone"

    @property
    def prior(self) -> MapPrior:
        """Prior of the map's error before anything was learned."""
        return self._fitter.nominal

    def posterior(self, memory: VisionMemory) -> Posterior:
        """Posterior by all that is remembered.

        Args:
            memory: of the Vision Updater.
        """
        rests = memory.rests if self._fitter.enabled else RestMemory()
        problem = self._fitter.problem(rests, memory.observations, memory.angles, memory.elongated)
        unknown = self._fitter.unknown(rests, memory.angles)
        return Posterior(unknown, MapPosterior(problem.prior, problem.linearised(unknown)))

    def predict(
        self, memory: VisionMemory, observations: Sequence[MarkerObservation]
    ) -> ObservationPrediction | None:
        """What is expected of a look, whose pose is hidden from the fit; None if nothing is.

        Args:
            memory: before the look.
            observations: those of before, and the look.
        """
        if not self.enabled:
            return None
        observation, options = observations[-1], self._options.observations
        before = len(observations) - 1
        rests = self._fitter.without(memory.rests, observation.lengths)
        rests = rests if self._fitter.enabled else RestMemory()
        rests = rests._replace(drift=rests.drift.observing(len(observations)))
        none = np.zeros(memory.elongated.shape[1])
        elongated = np.vstack([memory.elongated, none])[-before - 1 :]
        start = np.vstack([memory.angles, observation.guess])[-before - 1 :]
        problem = self._fitter.problem(
            rests, [*observations[:before], hidden(observation)], start, elongated
        )
        begin = self._fitter.unknown(rests, start)
        found = fit_rests(problem, begin, self._limits, options, before + 1, None)
        lengths = MapPosterior(problem.prior, problem.linearised(found.unknown))
        covariance = lengths.covariance_of_rest(before)
        angles = found.observed.angles[-1]
        camera = camera_of(self._marker_residual)
        (shown,) = corrected_observations([observation], rests.camera, camera)
        return compared(shown, self._marker_residual, options, angles, covariance)

    def contradicted(self, memory: VisionMemory) -> int | None:
        """Number of the remembered pose that all others contradict; None if there is none.

        Args:
            memory: of the Vision Updater.
        """
        probability = self._options.unexpected if self._options.hand == "seen" else 0.0
        if not (probability and self._fitter.enabled):
            return None
        camera, options = camera_of(self._marker_residual), self._options.observations
        shown = corrected_observations(memory.observations, memory.rests.camera, camera)
        posterior = self.posterior(memory).lengths
        known = memory.angles, posterior, self._marker_residual
        return contradicted(shown, *known, options, probability)

    def is_unexpected(self, predicted: ObservationPrediction | None) -> bool:
        """Whether a pose of a hand without a marker is far from its prediction.

        Args:
            predicted: the prediction; None if there is none.
        """
        seen = self._options.hand == "seen"
        return seen and is_unexpected(predicted, self._options.unexpected)

    def hand_error(
        self, memory: VisionMemory, before: JointMuscleMap, after: JointMuscleMap
    ) -> HandErrors | None:
        """Expected errors of the hand before and after an update; None if it is not judged.

        Only a map that holds the lengths of the robot can be judged. One that holds commands, as
        with min(l, l_target), is to differ from them.

        Args:
            memory: after the update.
            before: the map before the update.
            after: the map after it.
        """
        judged = self.judged
        if judged is None or not self.enabled or self._options.lengths != "l":
            return None
        nominal = self.prior
        rows = judged.rows(nominal.map, nominal.options.noise)
        errors = judged.expected(self.posterior(memory).lengths, rows, before, after)
        return HandErrors(*errors.tolist())
