"""Wiring of a robot: which muscle each channel moves and reads, and with which factor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jmm_agent.types import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Wiring:
    """What channel k of the interface is connected to; all arrays are (m,).

    Attributes:
        commands: muscle that the command moves.
        lengths: muscle whose length is read.
        tensions: muscle whose tension is read.
        command_factors: stroke of the muscle over that of the command [1].
        length_factors: reading over length [1]; 0: stuck.
        tension_factors: reading over tension [1]; 0: dead.
        absent: muscles that hold nothing, while their motors may turn.
        dead: muscles whose motors do nothing.
        arms: moment arms of each muscle over the nominal ones [1], which are no fault.
    """

    commands: Ints
    lengths: Ints
    tensions: Ints
    command_factors: Floats
    length_factors: Floats
    tension_factors: Floats
    absent: Bools
    dead: Bools
    arms: Floats

    @classmethod
    def healthy(cls, count: int) -> Wiring:
        """Each channel is connected to its own muscle.

        Args:
            count: number of muscles m.
        """
        order, ones, none = np.arange(count), np.ones(count), np.zeros(count, dtype=bool)
        return cls(order, order, order, ones, ones, ones, none, none, ones)

    def swapped(self, first: int, second: int, parts: tuple[str, ...]) -> Wiring:
        """With two channels exchanged.

        Args:
            first: one channel.
            second: the other.
            parts: names of the attributes that are exchanged, such as ``commands``.
        """
        changes = {}
        for part in parts:
            order = getattr(self, part).copy()
            order[[first, second]] = order[[second, first]]
            changes[part] = order
        return replace(self, **changes)

    def scaled(self, channel: int, **factors: float) -> Wiring:
        """With other factors of a channel.

        Args:
            channel: the channel.
            factors: by the name of the attribute, such as ``length_factors``.
        """
        changes = {}
        for part, factor in factors.items():
            values = getattr(self, part).copy()
            values[channel] *= factor
            changes[part] = values
        return replace(self, **changes)

    @property
    def idle(self) -> Bools:
        """Muscles that no motor pulls (m,)."""
        return self.absent | self.dead

    def without(self, muscle: int, dead: bool = False) -> Wiring:
        """With a muscle that holds nothing.

        Args:
            muscle: its number.
            dead: whether it is mounted, and its motor does nothing.
        """
        field = "dead" if dead else "absent"
        muscles = getattr(self, field).copy()
        muscles[muscle] = True
        return replace(self, **{field: muscles})
