"""Deferral: candidates that are screened only where simpler causes explain something.

A machine with many tendons has thousands of candidates, and replays of each take minutes. Friction
that depends on the load or a missing wrapping show first as plain friction or as a shifted site of
the same tendon. Causes that are marked ``fine`` are therefore deferred until a simpler cause at the
same tendon or joint has evidence.
"""

from __future__ import annotations

from collections.abc import Sequence

from reality_gap.inference.ranking import Ranked
from reality_gap.inference.screening import Sensitivity, screen
from reality_gap.simulation.hypothesis import Candidate
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.system import System
from reality_gap.types import Floats

MANY_TENDONS = 8
"""Number of tendons from which on fine causes are deferred."""
CLOSER = 6
"""Number of tendons and joints whose deferred candidates are released at each step of a search."""


def tendons_and_joints(system: System, candidate: Candidate) -> frozenset[str]:
    """Return the names of the tendons and joints where a candidate acts."""
    elements = set(candidate.location.elements)
    found = elements & set(system.joints)
    for tendon in system.tendons:
        own = {
            tendon.name,
            tendon.actuator,
            *tendon.sites,
            *tendon.length_sensors,
            *tendon.tension_sensors,
        }
        if elements & own:
            found.add(tendon.name)
    return frozenset(found)


def split_deferred(
    system: System, candidates: Sequence[Candidate]
) -> tuple[tuple[Candidate, ...], tuple[Candidate, ...]]:
    """Return the candidates to screen first, and the deferred ones.

    In a machine with many tendons, fine causes at a single tendon or joint are deferred.
    """
    if len(system.tendons) < MANY_TENDONS:
        return tuple(candidates), ()
    fine = [s.cause.fine and len(tendons_and_joints(system, s)) == 1 for s in candidates]
    first = tuple(s for s, later in zip(candidates, fine, strict=True) if not later)
    return first, tuple(s for s, later in zip(candidates, fine, strict=True) if later)


class Deferred:
    """Deferred candidates, which are screened on demand.

    Args:
        replayer: replays hypotheses.
        null_residual: residual of the nominal model, shape (n,).
        candidates: the deferred candidates.
        visible: change of the readings from which on a candidate can be judged; see
            `Sensitivity.largest_change` [noise].
    """

    def __init__(
        self,
        replayer: Replayer,
        null_residual: Floats,
        candidates: Sequence[Candidate],
        visible: float,
    ) -> None:
        self._replayer, self._null_residual, self._visible = replayer, null_residual, visible
        self._locations = {s: tendons_and_joints(replayer.system, s) for s in candidates}

    def __len__(self) -> int:
        return len(self._locations)

    def release(self, ranked: Sequence[Ranked]) -> tuple[Sensitivity, ...]:
        """Screen the deferred candidates at the tendons and joints of the best candidates.

        Args:
            ranked: all other candidates, best first.

        Returns:
            Sensitivities of the released candidates that are visible.
        """
        best: list[str] = []
        for one in ranked:
            here = tendons_and_joints(self._replayer.system, one.sensitivity.candidate)
            if one.evidence > 0 and len(here) == 1 and not here & set(best):
                best += here
        released = [s for s, own in self._locations.items() if own & set(best[:CLOSER])]
        for candidate in released:
            del self._locations[candidate]
        if not released:
            return ()
        found = screen(self._replayer, released, self._null_residual)
        return tuple(s for s in found if s.largest_change > self._visible)
