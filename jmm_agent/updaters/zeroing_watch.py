"""Watch for a zeroing of all lengths that was not announced.

It is looked for at the start of each episode, and within one since a muscle seemed to be elongated.
"""

from __future__ import annotations

import numpy as np

from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.updaters.vision_memory import VisionMemory
from jmm_agent.updaters.vision_options import VisionOptions
from jmm_agent.updaters.zeroing import ZeroingTest
from jmm_agent.vision.camera_unknowns import camera_of, corrected_observations
from jmm_agent.vision.observation_fit import MarkerObservation, PoseResidual


class ZeroingWatch:
    """Decides whether the observations since a start show that lengths were zeroed anew.

    Args:
        marker_residual: residual of the marker's pose at a posture.
        limits: lowest and highest angle of each joint (n, 2) [rad].
        options: of the Vision Updater.
    """

    def __init__(
        self, marker_residual: PoseResidual, limits: Floats, options: VisionOptions
    ) -> None:
        self._marker_residual, self._limits, self._options = marker_residual, limits, options

    def judged(
        self, memory: VisionMemory, prior: MapPrior, observations: list[MarkerObservation]
    ) -> VisionMemory:
        """What is remembered then: with one zeroing more, if a new observation shows it.

        Args:
            memory: before the new observation.
            prior: of the map's error, by what is known from rests.
            observations: those that are remembered, and the new one.
        """
        start, options = memory.start, self._options.observations
        if start is None or self._options.fit == "alone":
            return memory
        before = len(observations) - 1 - start.newest
        if start.newest >= self._options.zeroing_recent or before < self._options.zeroing_least:
            return memory._replace(start=None)
        camera = camera_of(self._marker_residual)
        shown = corrected_observations(observations, memory.rests.camera, camera)
        # One more than before, if the oldest observation is forgotten.
        known = len(memory.angles) - start.newest
        drift = memory.rests.drift
        drift = drift._replace(ages=drift.ages[known - before : known])
        test = ZeroingTest(
            prior.with_drift(drift.covariance),
            self._marker_residual,
            self._limits,
            options,
            shown[:before],
            memory.angles[known - before : known],
            start.elongated[-before:],
        )
        new = shown[before:]
        parts = [new]
        if start.within:
            parts += [[*new[:number], *new[number + 1 :]] for number in range(len(new))]
        least = self._options.zeroing_evidence
        if any(not part or test.log_bayes_factor(part) < least for part in parts):
            return memory
        elongated = np.zeros_like(memory.elongated)
        elongated[known - before : known] = start.elongated[-before:] + prior.zeroing_share
        return memory._replace(elongated=elongated, start=None, zeroings=memory.zeroings + 1)
