"""How much the experiment does, and when it tests."""

from __future__ import annotations

from dataclasses import dataclass

BEFORE, EVENT, OFF = "before", "event", "off"
"""Tests: before the wires give, after, and after further postures without learning."""


@dataclass(frozen=True)
class Sizes:
    """How much is done.

    Attributes:
        learned: postures to learn from before the event.
        more: after it.
        every: a test after every so many of these.
        tested: other postures in a test.
        move: time for each movement [s].
        patience: longest wait for rest [s].
    """

    learned: int = 27
    more: int = 15
    every: int = 5
    tested: int = 6
    move: float = 1.5
    patience: float = 2.0

    @property
    def checks(self) -> list[int]:
        """Numbers of postures after the event at which it is tested."""
        return list(range(self.every, self.more + 1, self.every))
