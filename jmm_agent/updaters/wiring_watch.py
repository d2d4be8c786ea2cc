"""Watch for muscles that are not those of the nominal model, during learning.

After an observation of the hand the hypotheses of `updaters.wiring_evidence` are compared.
A muscle that was elongated again and again is left out, too: what it reads cannot be explained.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from jmm_agent.guard.faults import MUSCLE_UNSTABLE
from jmm_agent.mapping.prior import MapPrior
from jmm_agent.types import Floats
from jmm_agent.updaters.assignment import Assignment
from jmm_agent.updaters.wiring_evidence import Miswiring, RestData, WiringEvidence
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.rest_fit import Rest

LEAST = 7.0
"""Least evidence [nat] for a name; there are some hundreds of hypotheses, and e^7 is 1100."""
LEAST_WITHOUT = 3.0
"""Least evidence with any one observation left out [nat]."""
RECENT, OTHERS, REFUSED = 8, 4, 4
"""Newest observations, other rests, and observations that were not believed, which are compared."""
OFTEN, EVERY = 10, 5
"""Observations after each of which wirings are compared, and after which of the later ones."""
EVENTS = 2
"""Most permanent elongations of one muscle that are believed."""
ENOUGH = 8
"""Observations from which on more are named; fewer may show why the muscle seems to elongate."""
MOST = 0.25
"""Largest share of muscles that are left out [1]."""
ARMS_LEFT = 0.2
"""Least share of the squared moment arms of a joint that other muscles must have [1]."""


class WiringWatch:
    """Decides what is named.

    Args:
        evidence: makes the comparison, with a prior.
        prior: of the nominal model's errors.
        limits: lowest and highest angle of each joint (n, 2) [rad].
    """

    def __init__(
        self, evidence: Callable[[MapPrior], WiringEvidence], prior: MapPrior, limits: Floats
    ) -> None:
        self._evidence, self._prior = evidence, prior
        middle = np.vstack([np.zeros(len(limits)), limits.mean(axis=1)])
        self._arms = np.mean(prior.map.jacobian(middle) ** 2, axis=0)

    def found(
        self,
        assignment: Assignment,
        observations: Sequence[MarkerObservation],
        rests: Sequence[Rest],
        elongated: Floats,
    ) -> Miswiring | None:
        """What is to be named after an observation; None if nothing is.

        Args:
            assignment: what is known of the wiring.
            observations: that were learned from, the newest last.
            rests: others.
            elongated: number of permanent elongations since each observation (K, m).
        """
        steps = RestData(observations, (), elongated).steps
        steps[list(assignment.left_out)] = 0.0
        count = len(observations)
        if count <= OFTEN or count % EVERY == 0 or steps.max(initial=0.0) > EVENTS:
            found = self._unlike(assignment, observations, rests, elongated)
            if found is not None:
                return found
        unstable = np.flatnonzero(steps > EVENTS) if count >= ENOUGH else np.arange(0)
        for muscle in unstable.tolist():
            again = Miswiring(MUSCLE_UNSTABLE, (muscle,))
            if again not in assignment.named:
                return again
        return None

    def may_leave_out(self, assignment: Assignment, muscles: Sequence[int]) -> bool:
        """Whether the others still move and show all joints.

        Args:
            assignment: what is known of the wiring.
            muscles: that are to be left out, too.
        """
        out = {*assignment.left_out, *muscles}
        left = np.delete(self._arms, sorted(out), axis=0)
        shares = left.sum(axis=0) / np.maximum(self._arms.sum(axis=0), 1e-300)
        enough = bool((shares >= ARMS_LEFT).all()) and len(left) >= self._arms.shape[1]
        return enough and len(out) <= MOST * len(self._arms)

    def _unlike(
        self,
        assignment: Assignment,
        observations: Sequence[MarkerObservation],
        rests: Sequence[Rest],
        elongated: Floats,
    ) -> Miswiring | None:
        """A muscle whose lengths are not those of the nominal model."""
        refused = [one.observation for one in assignment.refused[-REFUSED:]]
        observed = [*observations[-RECENT:], *refused]
        none = np.zeros((len(refused), elongated.shape[1]))
        history = np.vstack([elongated[-RECENT:], none])
        if len(observed) < 2:
            return None
        prior = self._prior.with_factors(assignment.factors(len(self._arms)))
        suspicion = self._evidence(prior).likeliest(
            RestData(observed, rests[-OTHERS:], history), LEAST
        )
        if suspicion is None or suspicion.without_one < LEAST_WITHOUT:
            return None
        return suspicion.miswiring
