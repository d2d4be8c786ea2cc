"""Rewiring: what is remembered, fitted again in the order of another wiring."""

from __future__ import annotations

import numpy as np

from jmm_agent.types import Floats
from jmm_agent.updaters.assignment import Assignment, ObservationRecord, step_between
from jmm_agent.updaters.model_choice import with_likeliest_model
from jmm_agent.updaters.observation_check import ObservationCheck
from jmm_agent.updaters.rest_fitter import FittedRests, RestFitter, RestMemory
from jmm_agent.updaters.vision_memory import VisionMemory
from jmm_agent.updaters.wiring_evidence import reordered
from jmm_agent.vision.length_drift import LengthDrift
from jmm_agent.vision.marker_observation import MarkerObservation

LEAST_REFUSED = 4
"""Least number of observations that were not believed for a search for misplaced joints."""
EXPLAINED = 0.7
"""Least share of them that misplaced joints must explain [1]."""


class Rewiring:
    """Fits all observations and rests again, with those that were not believed before.

    Args:
        fitter: fits observations together with other rests; it leaves out what the wiring does.
        check: of fitted observations.
        most: largest number of observations that are remembered.
    """

    def __init__(self, fitter: RestFitter, check: ObservationCheck, most: int) -> None:
        self._fitter, self._check, self._most = fitter, check, most

    def fitted(self, memory: VisionMemory, assignment: Assignment) -> VisionMemory:
        """What is remembered with another wiring; the pairs are those of before.

        Args:
            memory: with the wiring of before.
            assignment: the wiring.
        """
        muscles = memory.elongated.shape[1]
        order, ones = step_between(memory.assignment, assignment, muscles), np.ones(muscles)
        observed = [
            ObservationRecord(
                reordered(one.observation, order, ones), one.command[order], one.sound
            )
            for one in (*memory.records, *memory.assignment.refused)
        ][-self._most :]
        rests = tuple(reordered(rest, order, ones) for rest in memory.rests.rests)
        drift = LengthDrift(ages=np.zeros(len(observed)), time=memory.rests.drift.time)
        known = RestMemory(rests=rests, drift=drift)
        if not observed:
            return memory._replace(rests=known, assignment=assignment)
        zeroed = memory.elongated.min(axis=1, keepdims=True) + np.zeros(muscles)  # of all lengths
        none = np.vstack([zeroed, np.zeros((len(observed), muscles))])[: len(observed)]
        new = memory._replace(rests=known, assignment=assignment, start=None)
        return self._fit(new, observed, none)

    def with_misplaced(self, memory: VisionMemory) -> VisionMemory | None:
        """What is remembered with those observations, too, that misplaced joints explain.

        Bones that are far from the model's make looks at the hand impossible, so that these are not
        believed, and are no evidence. None if misplaced joints do not explain most of the newest,
        or if these are few or more were believed: single wrong looks are no sign of other bones.
        """
        refused, before = memory.assignment.refused, memory.observations
        if len(refused) < LEAST_REFUSED or len(refused) <= len(before):
            return None
        found = self.fitted(memory, memory.assignment)
        joints, more = found.rests.joints, len(found.observations) - len(before)
        if joints is None or not joints.enabled or more < EXPLAINED * len(refused):
            return None
        return found._replace(assignment=found.assignment._replace(refused=()))

    def _fit(
        self, memory: VisionMemory, observed: list[ObservationRecord], elongated: Floats
    ) -> VisionMemory:
        """Fit observations, and without those again that are far from their fitted postures."""
        known, observations = memory.rests, [one.observation for one in observed]
        guesses = [*memory.angles]
        guesses += [one.guess for one in observations[len(guesses) :]]
        start = np.array(guesses).reshape(-1, memory.angles.shape[1])
        found = self._fitted(known, observations, start, elongated)
        near = self._check.reached(found.observed)
        if not near.all() and near.any():
            observed = [one for one, reached in zip(observed, near, strict=True) if reached]
            observations, elongated = [one.observation for one in observed], elongated[near]
            start, drift = found.observed.angles[near], known.drift
            known = found.memory._replace(drift=drift._replace(ages=drift.ages[near]))
            found = self._fitted(known, observations, start, elongated)
        return memory._replace(
            observations=observations,
            commands=[one.command for one in observed],
            sound=[one.sound for one in observed],
            angles=found.observed.angles,
            elongated=found.elongated,
            rests=found.memory,
        )

    def _fitted(
        self,
        known: RestMemory,
        observations: list[MarkerObservation],
        start: Floats,
        elongated: Floats,
    ) -> FittedRests:
        """Fit observations, with what is then the likeliest to believe beside errors of the map."""
        found = self._fitter.fit_with_elongation(known, observations, start, elongated)
        return with_likeliest_model(self._fitter, found, observations)
