"""Sizes of the adaptation experiment, and names of its tests."""

from __future__ import annotations

from dataclasses import dataclass

BEFORE, EVENT, OFF = "before", "event", "off"
"""Tests: before the elongation, after it, and after further postures without learning."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        learned: number of postures that the agent learns from before the elongation.
        more: number of postures after it.
        every: number of these postures between two tests.
        tested: number of other postures in a test.
        move: duration of a movement [s].
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
        """Numbers of postures since the elongation after which there is a test."""
        return list(range(self.every, self.more + 1, self.every))
