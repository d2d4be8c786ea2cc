"""Suspects who are looked at only where simpler causes promise something.

A machine of many wires has thousands of suspects, and a replay of each takes minutes. Friction that
depends on the load or a wrapping that is missing show first as plain friction or as a shifted site
of the same wire, so that causes which are ``fine`` wait until those say where to look.
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
"""With so many wires, fine causes wait."""
CLOSER = 6
"""Wires and joints that are looked at more closely, at each step of a search."""


def locations_of(system: System, candidate: Candidate) -> frozenset[str]:
    """The tendons and joints where a suspect acts."""
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


def parted(
    system: System, chosen: Sequence[Candidate]
) -> tuple[tuple[Candidate, ...], tuple[Candidate, ...]]:
    """Whom to look at first, and who may wait: fine causes at one spot of a large machine."""
    if len(system.tendons) < MANY_TENDONS:
        return tuple(chosen), ()
    waits = [s.cause.fine and len(locations_of(system, s)) == 1 for s in chosen]
    first = tuple(s for s, wait in zip(chosen, waits, strict=True) if not wait)
    return first, tuple(s for s, wait in zip(chosen, waits, strict=True) if wait)


class Waiting:
    """Those who wait, and who is called.

    Args:
        bench: replays.
        null: (n,) residual of the study's model.
        suspects: who waits.
        visible: change of the readings that can be judged; see `Sensitivity.change` [noise].
    """

    def __init__(
        self, replayer: Replayer, null: Floats, candidates: Sequence[Candidate], visible: float
    ) -> None:
        self._replayer, self._null, self._visible = replayer, null, visible
        self._waiting = {s: locations_of(replayer.system, s) for s in candidates}

    def __len__(self) -> int:
        return len(self._waiting)

    def call(self, ranked: Ranked) -> tuple[Sensitivity, ...]:
        """Look at those who wait where the best of ``ranked`` act.

        Args:
            ranked: evidence [nats], sensitivity and size of everybody else, best first.
        """
        there: list[str] = []
        for evidence, sensitivity, _ in ranked:
            here = locations_of(self._replayer.system, sensitivity.candidate)
            if evidence > 0 and len(here) == 1 and not here & set(there):
                there += here
        called = [s for s, own in self._waiting.items() if own & set(there[:CLOSER])]
        for candidate in called:
            del self._waiting[candidate]
        found = screen(self._replayer, called, [], self._null) if called else ()
        return tuple(s for s in found if s.change > self._visible)
