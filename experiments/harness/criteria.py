"""Criteria of a bench: numbers with 95 % intervals, and their thresholds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from experiments.harness.report import Table
from experiments.harness.statistics import interval
from jmm_agent.types import Floats

BINS = 10
"""Number of bins of confidences."""


class Row(NamedTuple):
    """A number by which the diagnosis is judged.

    Attributes:
        name: of the number.
        cases: number of cases.
        value, low, high: the number with its 95 % interval; None without a case.
        unit: "%", "mm", ...
        most, least: thresholds; None without a threshold.
    """

    name: str
    cases: int
    value: float | None
    low: float | None
    high: float | None
    unit: str
    most: float | None = None
    least: float | None = None

    @property
    def reached(self) -> bool | None:
        """Whether the thresholds are satisfied; None without a threshold or a case."""
        if self.value is None or (self.most is None and self.least is None):
            return None
        above = self.least is None or self.value >= self.least
        return above and (self.most is None or self.value <= self.most)

    @property
    def must(self) -> str:
        """The thresholds in words; empty without any."""
        least = "" if self.least is None else f"at least {self.least:g}"
        most = "" if self.most is None else f"at most {self.most:g}"
        return " and ".join(filter(None, (least, most)))

    def plain(self) -> dict[str, Any]:
        """Entries for JSON."""
        return self._asdict() | {"reached": self.reached}


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    low, high = binomtest(hits, count).proportion_ci(method="wilson")
    return float(low), float(high)


def share(name: str, right: Iterable[bool | None], **must: float) -> Row:
    """Share of cases [%], without those that are None."""
    known = [bool(x) for x in right if x is not None]
    if not known:
        return Row(name, 0, None, None, None, "%", **must)
    low, high = wilson(sum(known), len(known))
    return Row(name, len(known), 100 * float(np.mean(known)), 100 * low, 100 * high, "%", **must)


def middle(name: str, values: Iterable[float | None], unit: str, **must: float) -> Row:
    """Median of some numbers with its bootstrap interval."""
    known = [float(x) for x in values if x is not None]
    if not known:
        return Row(name, 0, None, None, None, unit, **must)
    return Row(name, len(known), *interval(known), unit, **must)


def criteria_table(rows: Sequence[Row]) -> Table:
    """Table of the criteria."""
    head = ("", "cases", "value", "95 % interval", "must", "reached")
    lines = []
    for r in rows:
        value = "" if r.value is None else f"{r.value:.3g} {r.unit}".strip()
        ends = "" if r.low is None or r.high is None else f"{r.low:.3g} to {r.high:.3g}"
        answer = {True: "yes", False: "NO", None: ""}[r.reached]
        lines.append((r.name, r.cases, value, ends, r.must, answer))
    note = "Shares with Wilson intervals, medians and means with bootstrap intervals over cases."
    return Table("Criteria", head, lines, note)


def bins(confidence: Floats) -> NDArray[np.int64]:
    """Index of the bin of each confidence, shape (k,), among `BINS` of equal width."""
    return np.minimum((confidence * BINS).astype(int), BINS - 1)


def expected_error(confidence: Floats, right: Floats) -> float:
    """Expected calibration error: mean of abs(share right - mean confidence) of the bins."""
    where = bins(confidence)
    gaps = [abs(np.sum(right[where == b] - confidence[where == b])) for b in range(BINS)]
    return float(np.sum(gaps) / len(confidence))
