"""Tests of computations that run side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from reality_gap.inference.gauss_newton import Asking, together
from reality_gap.simulation.replayer import Hypothesis, Replayer


class Bench:
    """Answers every hypothesis with its length, and remembers what was asked at once."""

    def __init__(self) -> None:
        self.batches: list[list[Hypothesis]] = []

    def residuals(self, hypotheses: Sequence[Hypothesis]) -> list[Any]:
        self.batches.append(list(hypotheses))
        return [np.array([float(len(h))]) for h in hypotheses]


def of_size(size: int) -> Hypothesis:
    return cast(Hypothesis, [None] * size)


def asking(name: str, *rounds: list[int]) -> Asking[str]:
    """Asks for hypotheses of these sizes, round by round; checks that the answers are its own."""
    for sizes in rounds:
        answers = yield [of_size(size) for size in sizes]
        assert [float(a[0]) for a in answers] == sizes
    return name


def test_each_gets_its_own_answers_and_what_is_asked_next_is_replayed_at_once() -> None:
    replayer = Bench()

    found = together(
        cast(Replayer, replayer),
        [asking("one", [1], [2, 3]), asking("none"), asking("two", [4, 5], [6], [7])],
    )

    assert found == ["one", "none", "two"]
    assert [[len(h) for h in batch] for batch in replayer.batches] == [[1, 4, 5], [2, 3, 6], [7]]


def test_nothing_is_replayed_for_nobody() -> None:
    replayer = Bench()

    assert together(cast(Replayer, replayer), []) == []
    assert replayer.batches == []
