"""Statistics over robots: median, bootstrap interval of the median, worst robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.stats import bootstrap

from jmm_agent.types import Floats

RESAMPLES = 10_000
LEVEL = 0.95
"""Number of bootstrap samples, and confidence level of the interval."""

Good = Literal["low", "high"]
By = Literal["median", "worst", "high"]
"""Which number of a metric a threshold is for: the median, that of the worst robot, or the upper
end of the interval."""


class Interval(NamedTuple):
    """A median over robots with its bootstrap 95 % interval."""

    median: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.median:.3g} [{self.low:.3g}, {self.high:.3g}]"


def bootstrap_interval(
    statistic: Callable[..., Any], *samples: Floats, resamples: int = RESAMPLES
) -> tuple[float, float]:
    """Percentile bootstrap interval of ``statistic(*samples)``, of width 0 for a single case.

    The generator has a fixed seed, so equal samples have equal intervals.

    Args:
        statistic: of the samples; called with ``axis`` if it has such an argument.
        samples: numbers of each case, shape (k,) each, k > 0; cases are resampled as a whole.
        resamples: number of bootstrap samples.
    """
    if len(samples[0]) == 1:  # scipy needs two cases
        value = float(statistic(*samples))
        return value, value
    found = bootstrap(
        samples,
        statistic,
        paired=len(samples) > 1,
        n_resamples=resamples,
        confidence_level=LEVEL,
        method="percentile",
        rng=np.random.default_rng(0),
    )
    low, high = found.confidence_interval
    return float(low), float(high)


def interval(values: Sequence[float] | Floats) -> Interval:
    """Median over robots with its bootstrap interval.

    Args:
        values: one number a robot.

    Raises:
        ValueError: there is no value, or one is not finite.
    """
    numbers = np.asarray(values, dtype=float)
    if not numbers.size or not np.isfinite(numbers).all():
        raise ValueError(f"An interval needs finite numbers, at least one, not {numbers}.")
    return Interval(float(np.median(numbers)), *bootstrap_interval(np.median, numbers))


def median_cell(errors: Sequence[float] | Floats, digits: int = 1) -> str:
    """Cell of a table: median over robots, and the largest error in brackets.

    Args:
        errors: one number a robot.
        digits: after the decimal point.
    """
    return f"{np.median(errors):.{digits}f} ({np.max(errors):.{digits}f})"


def paired(one: Sequence[float] | Floats, other: Sequence[float] | Floats) -> Interval:
    """Median over robots of the difference one - other on the same robot, with its interval."""
    return interval(np.asarray(one, dtype=float) - np.asarray(other, dtype=float))


def metric(
    values: Mapping[int, float] | Sequence[float] | Floats,
    unit: str,
    must: float | None = None,
    paper: float | str | None = None,
    good: Good = "low",
    by: By = "median",
) -> dict[str, Any]:
    """One entry of ``metrics`` in a ``summary.json``.

    Args:
        values: one finite number a robot.
        unit: of the numbers, "" without a unit.
        must: threshold: an upper bound, or a lower bound if high numbers are good.
        paper: number or statement of the paper.
        good: whether low or high numbers are good; the worst robot has the opposite extreme.
        by: which number has to satisfy the threshold.

    Returns:
        ``unit``, ``paper``, ``median``, ``worst``, ``low`` and ``high`` (bootstrap 95 % interval of
        the median), ``must``, ``by``, and ``reached``: whether the number named by ``by`` satisfies
        ``must``, None without a threshold.
    """
    numbers = np.array(list(values.values()) if isinstance(values, Mapping) else values, float)
    found = interval(numbers)
    worst = float(numbers.max() if good == "low" else numbers.min())
    reached = None
    if must is not None:
        judged = {"median": found.median, "worst": worst, "high": found.high}[by]
        reached = bool(judged <= must if good == "low" else judged >= must)
    return {
        "unit": unit,
        "paper": paper,
        "median": _rounded(found.median),
        "worst": _rounded(worst),
        "low": _rounded(found.low),
        "high": _rounded(found.high),
        "must": must,
        "by": by,
        "reached": reached,
    }


def _rounded(number: float) -> float:
    """Round to four significant digits."""
    return float(f"{number:.4g}")
