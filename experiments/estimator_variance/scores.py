"""Scores: errors of the estimates of each machine over their lower bound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.harness.criteria import share
from experiments.harness.report import Table
from experiments.harness.statistics import metric

MUST = 2.0
"""Largest median over machines of the mean square error over the bound.

The variance alone has no threshold: that of a biased estimate may lie below the bound.
"""
AIM = 1.5
"""The same, as it should be."""

Trial = Mapping[str, Any]


@dataclass(frozen=True)
class Score:
    """Errors of the estimates of one machine.

    Attributes:
        error: mean square of the errors over the square of the oracle's bound.
        bias: mean error over the oracle's bound.
        variance: variance of the errors over the square of the bound of the readings.
        largest: largest absolute error over the oracle's bound.
        covered: for each estimate, whether its interval covers the true size.
    """

    error: float
    bias: float
    variance: float
    largest: float
    covered: tuple[bool, ...]


def score(trial: Trial) -> Score:
    """Compute the score of a machine from its truths and estimates."""
    truths = np.array(trial["truths"])
    errors = np.array(trial["estimates"]) - truths
    relative = errors / trial["bound"]
    inside = (np.array(trial["low"]) <= truths) & (truths <= np.array(trial["high"]))
    return Score(
        error=float(np.mean(relative**2)),
        bias=float(np.mean(relative)),
        variance=float(np.var(errors, ddof=1)) / trial["bound_of_readings"] ** 2,
        largest=float(np.max(np.abs(relative))),
        covered=tuple(inside.tolist()),
    )


def metrics(trials: Sequence[Trial]) -> dict[str, dict[str, Any]]:
    """Metrics of the summary: medians over machines, with thresholds."""
    scores = [score(one) for one in trials]
    found = {
        "mean_square_error_over_bound": metric([s.error for s in scores], "", MUST),
        "variance_over_bound": metric([s.variance for s in scores], ""),
        "bias_over_bound": metric([abs(s.bias) for s in scores], ""),
    }
    return {
        name: {**one, "value": one["median"]} | ({"aim": AIM} if one["must"] else {})
        for name, one in found.items()
    }


def machine_table(trials: Sequence[Trial]) -> Table:
    """Table of the effect, the bound and the errors of each machine."""
    rows = []
    for one in trials:
        s, m = score(one), one["machine"]
        size = f"{one['size']:.3g} {one['unit']}".removesuffix(" 1")
        rows.append(
            (
                one["seed"],
                f"{m['kind']}, {m['joints']} joints, {m['rate']:g} Hz, {m['position_bits']} bits",
                f"{one['effect']} at {one['location'] or 'all'}",
                size,
                f"{100 * abs(one['bound'] / one['size']):.2g}",
                f"{one['bound_of_readings'] / one['bound']:.2f}",
                f"{s.error:.3g}",
                f"{s.bias:.2f}",
                f"{s.variance:.3g}",
                f"{s.largest:.2f}",
                f"{sum(s.covered)} of {len(s.covered)}",
            )
        )
    head = (
        "seed", "machine", "hidden effect", "size", "bound [% of the size]",
        "bound of the readings", "mean square error", "bias", "variance", "largest error",
        "intervals that cover",
    )  # fmt: skip
    note = (
        "Errors are over the oracle's bound, mean squares over its square. The variance is over "
        "the square of the bound of the readings, which lacks the error of the nominal model's "
        "time step and friction, and which is given over the oracle's. Fits use three of four "
        "blocks of the readings, which alone costs 4/3."
    )
    return Table("Errors of the estimates", head, rows, note)


def coverage(trials: Sequence[Trial]) -> dict[str, Any]:
    """Share of all estimates whose 95 % interval covers the true size."""
    inside = [x for one in trials for x in score(one).covered]
    return share("interval covers the truth", inside).plain()
