"""Methods of the experiment, amounts of work, and errors in its results."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.harness.experiment import Results

CHOSEN = "chosen"
"""Condition of our agent that chooses where to look."""
OURS, LENGTHS, CONSTANTS, PAPER = "rests", "lengths", "constants", "paper"
OFFSETS, GAUSSIAN, POLYNOMIAL = "offsets", "Gaussian process", "polynomial"
ROUTE_CHANGE, AUTOENCODER, PHYSICS = "route change", "autoencoder", "physics-informed"
DRIVING = {
    OURS: "ours: looks, lengths and tensions of all rests, zero posture",
    LENGTHS: "looks and lengths only",
    CONSTANTS: "looks and lengths, one constant a muscle",
    PAPER: "the paper's rule",
}
"""Methods that drive a robot by themselves, and their titles."""
FROM_OURS = ", from our looks"
GIVEN = {
    OFFSETS: f"one constant a muscle{FROM_OURS}",
    GAUSSIAN: f"Gaussian process{FROM_OURS}",
    POLYNOMIAL: f"polynomial of degree 3{FROM_OURS}",
    ROUTE_CHANGE: f"f(theta) + g(theta, T), networks{FROM_OURS}",
    AUTOENCODER: f"autoencoder of (theta, T, l){FROM_OURS}",
    PHYSICS: f"physics-informed network{FROM_OURS}",
}
"""Methods that get joint angles, tensions and lengths of all looks of ours, and their titles."""
METHODS = DRIVING | GIVEN
NOT_OURS = tuple(name for name in METHODS if name != OURS)
BLIND = "blind"
"""Condition of the agent that sees nothing."""
BY_SOURCE = "sources"
"""Condition of the part on sources of information."""


COUNTS = (1, 2, 3, 5, 10, 27, 81)
"""Numbers of looks after which maps are tested, as far as a robot has so many."""


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
        initial: steps of the autoencoder's initial training, once for all robots.
    """

    counts: tuple[int, ...] = COUNTS[:-1]
    tested: int = 10
    blind: int = 10
    move: float = 1.5
    patience: float = 2.0
    test_move: float = 1.5
    test_hold: float = 1.2
    initial: int = 8000


def numbers(results: Results, method: str, count: int, key: str) -> list[float]:
    """An error of a method after some looks, of each robot."""
    source = OURS if method in GIVEN else method
    if count == 0:
        method = source
    return [result[source][method][str(count)][key] for result in results.values()]


def best_other(results: Results, count: int, key: str) -> str:
    """The method but ours with the lowest median of an error after some looks."""
    return min(NOT_OURS, key=lambda name: float(np.median(numbers(results, name, count, key))))
