"""What is said of numbers over robots: medians, the worst robot, bootstrap intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from jmm_agent.types import Floats

RESAMPLES = 10_000
LEVEL = 0.95

Good = Literal["low", "high"]


class Interval(NamedTuple):
    """A median over robots with its bootstrap 95 % interval."""

    median: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.median:.3g} [{self.low:.3g}, {self.high:.3g}]"


def interval(values: Sequence[float] | Floats) -> Interval:
    """Median of one number a robot, with the percentile bootstrap over robots.

    The same numbers give the same interval.

    Raises:
        ValueError: there is no number, or one is not finite.
    """
    numbers = np.asarray(values, dtype=float)
    if not numbers.size or not np.isfinite(numbers).all():
        raise ValueError(f"An interval needs finite numbers, at least one, not {numbers}.")
    drawn = np.random.default_rng(0).integers(numbers.size, size=(RESAMPLES, numbers.size))
    medians = np.median(numbers[drawn], axis=1)
    low, high = np.quantile(medians, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(float(np.median(numbers)), float(low), float(high))


def paired(one: Sequence[float] | Floats, other: Sequence[float] | Floats) -> Interval:
    """Median over robots of one - other on the same robot, with its interval."""
    return interval(np.asarray(one, dtype=float) - np.asarray(other, dtype=float))


def metric(
    values: Mapping[int, float] | Sequence[float] | Floats,
    unit: str,
    must: float | None = None,
    paper: float | str | None = None,
    good: Good = "low",
) -> dict[str, Any]:
    """One entry of ``metrics`` in a ``summary.json``.

    Args:
        values: one finite number a robot.
        unit: of the number, "" for a pure one.
        must: what the median must reach: at most this, or at least this if high is good.
        paper: what the paper tells.
        good: whether low or high numbers are good; decides which robot is the worst.

    Returns:
        unit, paper, median, worst, low and high (bootstrap 95 % interval of the median over
        robots), must, and reached: whether the median does, None without ``must``.
    """
    numbers = np.array(list(values.values()) if isinstance(values, Mapping) else values, float)
    found = interval(numbers)
    worst = numbers.max() if good == "low" else numbers.min()
    reached = None
    if must is not None:
        reached = bool(found.median <= must if good == "low" else found.median >= must)
    return {
        "unit": unit,
        "paper": paper,
        "median": _rounded(found.median),
        "worst": _rounded(float(worst)),
        "low": _rounded(found.low),
        "high": _rounded(found.high),
        "must": must,
        "reached": reached,
    }


def _rounded(number: float) -> float:
    """Four significant digits: what is compared by eye."""
    return float(f"{number:.4g}")
