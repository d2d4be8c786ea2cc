"""Methods of the experiment, amounts of work, and errors in its results."""

from __future__ import annotations

from dataclasses import dataclass

from experiments.harness.experiment import Results

CHOSEN = "chosen"
"""Condition of our agent that chooses where to look."""
OURS, LENGTHS, CONSTANTS, PAPER = "rests", "lengths", "constants", "paper"
GAUSSIAN, POLYNOMIAL = "Gaussian process", "polynomial"
DRIVING = {
    OURS: "ours: looks, lengths and tensions of all rests, zero posture",
    LENGTHS: "looks and lengths only",
    CONSTANTS: "looks and lengths, one constant a muscle",
    PAPER: "the paper's rule",
}
"""Methods that drive a robot by themselves, and their titles."""
GIVEN = {
    GAUSSIAN: "Gaussian process, from our joint angles",
    POLYNOMIAL: "polynomial of degree 3, from our joint angles",
}
"""Methods that get the pairs of ours, and their titles."""
METHODS = DRIVING | GIVEN
BLIND = "blind"
"""Condition of the agent that sees nothing."""
BY_SOURCE = "sources"
"""Condition of the part on sources of information."""


@dataclass(frozen=True)
class Sizes:
    """Amount of work on each robot.

    Attributes:
        counts: numbers of looks after which a map is tested.
        tested: number of other postures in a test.
        blind: number of postures of the agent that sees nothing.
        move: duration of a movement while learning [s].
        patience: longest wait for rest and an observation while learning [s].
        test_move: duration of a movement in the test [s].
        test_hold: time to come to rest in the test [s].
    """

    counts: tuple[int, ...] = (1, 2, 3, 5, 10, 27)
    tested: int = 10
    blind: int = 10
    move: float = 1.5
    patience: float = 2.0
    test_move: float = 1.5
    test_hold: float = 1.2


def numbers(results: Results, method: str, count: int, key: str) -> list[float]:
    """An error of a method after some looks, of each robot."""
    source = OURS if method in GIVEN else method
    if count == 0:
        method = source
    return [result[source][method][str(count)][key] for result in results.values()]
