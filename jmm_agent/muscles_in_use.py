"""Muscles in use: the one record of which muscles of a robot an agent relies on.

A muscle that has snapped tells nothing of the joints and moves none of them. It is left out until
somebody says that it was repaired:

* its length is in doubt for the estimate, and the agent calculates with the map's in its stead,
* it is NaN in all that is learned (`jmm_agent.mapping.prior.without_unknown`),
* its tension is 0 in balances, loads, stiffness and heat, and no tension is asked of it
  (`TensionDistribution.in_use`), so that the others pull more,
* its motor is commanded the length that it has, so that it does not pull with more than T_bias.

A repaired muscle was mounted anew, so its length is off by an unknown number. It is learned from
again at once, but stays out of estimate and commands until a marker observation has shown how long
it is (`returning`). What was learned of its shape holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.guard.faults import MUSCLE_LEFT_OUT, MUSCLE_SNAPPED, Fault
from jmm_agent.types import Bools, Floats

SURE = 0.5
"""Time for which a muscle must have been found snapped before it is left out for good [s]."""


class MusclesInUse:
    """Which of m muscles an agent uses.

    Args:
        muscles: their names.
    """

    def __init__(self, muscles: Sequence[str]) -> None:
        self._muscles = tuple(muscles)
        self._out: dict[int, Fault] = {}
        self._returning: frozenset[int] = frozenset()
        self._update()

    def _update(self) -> None:
        # New arrays, so that others see by identity that something has changed.
        self._mask = np.ones(len(self._muscles), dtype=bool)
        self._learned = self._mask.copy()
        self._learned[list(self._out)] = False
        self._mask[[*self._out, *self._returning]] = False

    @property
    def mask(self) -> Bools:
        """Which muscles estimate, commands and tensions use (m,); not to be changed."""
        return self._mask

    @property
    def learned(self) -> Bools:
        """Which muscles are learned from (m,): those in use, and repaired ones."""
        return self._learned

    @property
    def all(self) -> bool:
        """Whether every muscle is in use."""
        return not self._out and not self._returning

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the muscles that are left out, in the order of the map."""
        return tuple(self._muscles[index] for index in sorted(self._out))

    @property
    def returning(self) -> tuple[str, ...]:
        """Names of repaired muscles whose length is not known yet."""
        return tuple(self._muscles[index] for index in sorted(self._returning))

    @property
    def faults(self) -> list[Fault]:
        """A fault for each muscle that is left out, or returning."""
        back = "it was repaired, and is used after the next marker observation has shown its length"
        returning = [Fault(MUSCLE_LEFT_OUT, name, 0.0, back) for name in self.returning]
        return [*self._out.values(), *returning]

    def index(self, muscle: str) -> int:
        """Number of a muscle.

        Args:
            muscle: its name.

        Raises:
            AgentError: there is no such muscle.
        """
        if muscle not in self._muscles:
            raise AgentError(
                f"There is no muscle {muscle!r}; muscles are {', '.join(self._muscles)}."
            )
        return self._muscles.index(muscle)

    def leave_out(self, muscle: str, time: float, why: str, kind: str = MUSCLE_SNAPPED) -> bool:
        """Use a muscle no longer.

        Args:
            muscle: its name.
            time: since when it is known [s].
            why: in some words.
            kind: of the fault, see `jmm_agent.guard.faults`.

        Returns:
            Whether it was in use until now, or returning.

        Raises:
            AgentError: there is no such muscle, or no other one is in use.
        """
        index = self.index(muscle)
        if index in self._out:
            return False
        if self._learned.sum() < 2:
            raise AgentError(f"Muscle {muscle!r} is the last one in use, and cannot be left out.")
        detail = f"{why}; it is left out until Agent.repaired({muscle!r}) is called"
        self._out[index] = Fault(kind, muscle, time, detail)
        self._returning -= {index}
        self._update()
        return True

    def snapped(self, faults: Iterable[Fault], time: float) -> bool:
        """Leave out muscles that have been found snapped for `SURE`, but never the last one.

        Args:
            faults: that a guard finds now.
            time: now [s].

        Returns:
            Whether a muscle was left out that was in use.
        """
        sure = [
            fault
            for fault in faults
            if fault.kind == MUSCLE_SNAPPED and time - fault.since >= SURE - 1e-9
        ]
        left = False
        for fault in sure:
            if self._learned.sum() > 1:
                left |= self.leave_out(fault.where, fault.since, "it has snapped")
        return left

    def repaired(self, muscle: str, offset_is_open: bool) -> bool:
        """Use a muscle again.

        Args:
            muscle: its name.
            offset_is_open: whether a marker observation is to show first how long it is.

        Returns:
            Whether it was left out until now.

        Raises:
            AgentError: there is no such muscle.
        """
        index = self.index(muscle)
        if index not in self._out:
            return False
        del self._out[index]
        if offset_is_open:
            self._returning |= {index}
        self._update()
        return True

    def observed(self, known: Bools) -> bool:
        """Use repaired muscles again whose lengths are known.

        Args:
            known: whose length a marker observation has shown since the repair (m,).

        Returns:
            Whether some muscle is in use again.
        """
        back = {index for index in self._returning if known[index]}
        if not back:
            return False
        self._returning -= back
        self._update()
        return True

    def state(self) -> Floats:
        """The record as numbers (m,) for a file: 1 in use, 0.5 returning, 0 left out."""
        return np.asarray(0.5 * self._mask + 0.5 * self._learned)

    def recall(self, state: Floats) -> None:
        """Set the record to an earlier `state`; when muscles were left out is not in it.

        Args:
            state: as `state` (m,).
        """
        kept = {index: fault for index, fault in self._out.items() if state[index] == 0.0}
        self._out, self._returning = {}, frozenset(np.flatnonzero(state == 0.5).tolist())
        self._update()
        for index in np.flatnonzero(state == 0.0).tolist():
            muscle = self._muscles[index]
            why = "it was left out when this was saved"
            self.leave_out(muscle, 0.0, why, MUSCLE_LEFT_OUT)
            self._out[index] = kept.get(index, self._out[index])

    def usable(self, lengths: Floats, expected: Floats) -> Floats:
        """Lengths (m,) [m] to calculate with: the expected ones of muscles that are not in use.

        Args:
            lengths: measured (m,) [m].
            expected: by the map at the estimate (m,) [m].
        """
        return lengths if self.all else np.where(self._mask, lengths, expected)

    def pulling(self, tensions: Floats) -> Floats:
        """Tensions (m,) [N]: 0 of muscles that are left out.

        Args:
            tensions: measured (m,) [N].
        """
        return tensions if self.all else np.where(self._learned, tensions, 0.0)

    def demanded(self, tensions: Floats) -> Floats:
        """Tensions (m,) [N] that commands demand: NaN of muscles that are not in use.

        Args:
            tensions: measured (m,) [N].
        """
        return tensions if self.all else np.where(self._mask, tensions, np.nan)

    def commanded(self, target_lengths: Floats, measured: Floats) -> Floats:
        """Command (m,) [m]: the length that it has, of a muscle that is not in use.

        Args:
            target_lengths: wanted (m,) [m].
            measured: lengths (m,) [m].
        """
        return target_lengths if self.all else np.where(self._mask, target_lengths, measured)

    def known(self, usable: Floats, measured: Floats) -> Floats:
        """Lengths (m,) [m] to learn from: NaN of muscles that are left out.

        Args:
            usable: as `usable`, at the reference tension (m,) [m].
            measured: measured (m,) [m], of repaired muscles that are not in use yet.
        """
        if self.all:
            return usable
        return np.where(self._learned, np.where(self._mask, usable, measured), np.nan)
