"""Which muscle each channel of the robot is, as far as rests have shown that it is another one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jmm_agent.guard.faults import MUSCLE_ABSENT, MUSCLE_SNAPPED, MUSCLES_SWAPPED
from jmm_agent.types import Bools, Floats, Ints
from jmm_agent.updaters.wiring_evidence import Miswiring
from jmm_agent.vision.marker_observation import MarkerObservation

LOST = MUSCLE_SNAPPED, MUSCLE_ABSENT
"""Kinds of muscles that hold nothing."""
MOST_REFUSED = 8
"""Number of newest observations that were not believed, with which beliefs are compared, too."""


class ObservationRecord(NamedTuple):
    """An observation with what was commanded.

    Attributes:
        observation: the observation.
        command: lengths of its pair (m,) [m].
        sound: whether no muscle was saturated.
    """

    observation: MarkerObservation
    command: Floats
    sound: bool


class Assignment(NamedTuple):
    """What is known of the wiring.

    Attributes:
        order: channel of each of m muscles; empty: their own.
        left_out: muscles that are left out of map, estimate and commands.
        named: all that was found, in order; muscles are named as they were then.
        refused: newest observations that were not believed.
    """

    order: tuple[int, ...] = ()
    left_out: tuple[int, ...] = ()
    named: tuple[Miswiring, ...] = ()
    refused: tuple[ObservationRecord, ...] = ()

    def channels(self, muscles: int) -> Ints:
        """Channel of each muscle (m,).

        Args:
            muscles: number of muscles, m.
        """
        return np.array(self.order or range(muscles), dtype=np.intp)

    def factors(self, muscles: int) -> Floats | None:
        """Factors of the errors of muscles, see `MapPrior.factors`.

        Args:
            muscles: number of muscles, m.
        """
        if not self.left_out:
            return None
        factors = np.ones(muscles)
        factors[list(self.left_out)] = np.inf
        return factors

    def mask(self, muscles: int) -> Bools:
        """Which muscles are left out (m,).

        Args:
            muscles: number of muscles, m.
        """
        mask = np.zeros(muscles, dtype=bool)
        mask[list(self.left_out)] = True
        return mask

    def refusing(self, one: ObservationRecord) -> Assignment:
        """With an observation that was not believed."""
        return self._replace(refused=(*self.refused, one)[-MOST_REFUSED:])

    def losing(self, other: Assignment, muscles: int) -> Assignment:
        """With the muscles that have been lost by another wiring; itself if there are no more.

        Args:
            other: of the same robot, perhaps in another order.
            muscles: number of muscles, m.
        """
        lost = [one for one in other.named if one.kind in LOST]
        if not lost:
            return self
        now = np.argsort(self.channels(muscles))[other.channels(muscles)]
        moved = [Miswiring(one.kind, tuple(now[list(one.muscles)].tolist())) for one in lost]
        new = [one for one in moved if not {*one.muscles} <= {*self.left_out}]
        if not new:
            return self
        out = {*self.left_out, *(muscle for one in new for muscle in one.muscles)}
        return self._replace(left_out=tuple(sorted(out)), named=(*self.named, *new))

    def mended(self, muscle: int) -> Assignment:
        """Without what was found of a muscle; itself if nothing was.

        Args:
            muscle: its number.
        """
        if muscle not in self.left_out:
            return self
        out = tuple(one for one in self.left_out if one != muscle)
        named = tuple(one for one in self.named if one.muscles != (muscle,))
        return self._replace(left_out=out, named=named)

    def finding(self, found: Miswiring, muscles: int, leave_out: bool = True) -> Assignment:
        """With a muscle, or two, that is not the one of the nominal model.

        Args:
            found: what was found.
            muscles: number of muscles, m.
            leave_out: whether a muscle that is not exchanged may be left out.
        """
        named = (*self.named, found)
        if found.kind == MUSCLES_SWAPPED:
            order = self.channels(muscles)
            order[list(found.muscles)] = order[list(found.muscles)[::-1]]
            own = np.array_equal(order, np.arange(muscles))
            return Assignment(() if own else tuple(order.tolist()), self.left_out, named)
        more = found.muscles if leave_out else ()
        return Assignment(self.order, tuple(sorted({*self.left_out, *more})), named)


def step_between(before: Assignment, after: Assignment, muscles: int) -> Ints:
    """Index before of what is now each muscle (m,).

    Args:
        before: wiring by which values are ordered.
        after: wiring by which they are to be ordered.
        muscles: number of muscles, m.
    """
    return np.argsort(before.channels(muscles))[after.channels(muscles)]
