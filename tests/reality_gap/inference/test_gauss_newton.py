"""Gauss-Newton fits: stepwise computations that run side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from reality_gap.inference.gauss_newton import Stepwise, run_together
from reality_gap.simulation.hypothesis import Hypothesis
from reality_gap.simulation.replayer import Replayer


class RecordingReplayer:
    """Returns the length of each hypothesis as its residual, and records the batches."""

    def __init__(self) -> None:
        self.batches: list[list[Hypothesis]] = []

    def residuals(self, hypotheses: Sequence[Hypothesis]) -> list[Any]:
        self.batches.append(list(hypotheses))
        return [np.array([float(len(h))]) for h in hypotheses]


def of_size(size: int) -> Hypothesis:
    return cast(Hypothesis, [None] * size)


def computation(name: str, *rounds: list[int]) -> Stepwise[str]:
    """Yield hypotheses of these sizes, round by round; check that their residuals come back."""
    for sizes in rounds:
        residuals = yield [of_size(size) for size in sizes]
        assert [float(a[0]) for a in residuals] == sizes
    return name


def test_each_receives_its_own_residuals_and_all_next_hypotheses_are_replayed_at_once() -> None:
    replayer = RecordingReplayer()

    found = run_together(
        cast(Replayer, replayer),
        [
            computation("one", [1], [2, 3]),
            computation("none"),
            computation("two", [4, 5], [6], [7]),
        ],
    )

    assert found == ["one", "none", "two"]
    assert [[len(h) for h in batch] for batch in replayer.batches] == [[1, 4, 5], [2, 3, 6], [7]]


def test_without_computations_nothing_is_replayed() -> None:
    replayer = RecordingReplayer()

    assert run_together(cast(Replayer, replayer), []) == []
    assert replayer.batches == []
