"""Figures of the strangers' bench: calibration of confidences, and size of an effect."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure

from experiments.harness.criteria import BINS, bins, wilson
from experiments.harness.report import Picture, png
from experiments.strangers_bench.criteria import confidences, of_kind
from experiments.strangers_bench.scores import Trial, exact_set, right_first

EDGES = (2.0, 4.0, 8.0, 16.0, 32.0, 50.0)
"""Edges of the groups of amplitudes, over the oracle's floor."""
BLUE, RED = "#3a6fb5", "#c8452f"


def pictures(trials: Sequence[Trial]) -> list[Picture]:
    """All figures of the report."""
    found = []
    if len(confidences(trials)[0]):
        note = "Named causes in ten bins of their confidence; bars: Wilson 95 % intervals."
        found.append(Picture("Calibration of confidences", _png(_reliability(trials)), note))
    if any(t["truth"][0]["multiple"] for t in of_kind(trials, "single")):
        note = "Single effects by amplitude; bars: Wilson 95 % intervals."
        found.append(Picture("Right answers by amplitude", _png(_amplitudes(trials)), note))
    return found


def _png(figure: Figure) -> bytes:
    data = png(figure)
    pyplot.close(figure)
    return data


def _reliability(trials: Sequence[Trial]) -> Figure:
    figure, ax = pyplot.subplots(figsize=(6, 5.2), layout="constrained")
    ax.plot([0, 1], [0, 1], color="#999999", linestyle="--", label="calibrated")
    confidence, right = confidences(trials)
    where = bins(confidence)
    for b in range(BINS):
        own = where == b
        if own.any():
            x, share = float(confidence[own].mean()), float(right[own].mean())
            ax.plot([x, x], wilson(int(right[own].sum()), int(own.sum())), color=BLUE)
            ax.plot(x, share, "o", color=BLUE)
            ax.annotate(f"{own.sum()}", (x, share), xytext=(6, 2), textcoords="offset points")
    ax.set_xlabel("confidence, mean of its bin [1]")
    ax.set_ylabel("share of named causes that are true [1]")
    ax.set_xlim(-0.02, 1.1)  # room for the count at 1
    ax.set_ylim(-0.02, 1.04)
    ax.legend(loc="upper left")
    return figure


def _amplitudes(trials: Sequence[Trial]) -> Figure:
    figure, ax = pyplot.subplots(figsize=(6.4, 4.2), layout="constrained")
    single = [t for t in of_kind(trials, "single") if t["truth"][0]["multiple"]]
    multiple = np.array([t["truth"][0]["multiple"] for t in single])
    group = np.clip(np.searchsorted(EDGES, multiple, side="right") - 1, 0, len(EDGES) - 2)
    for test, label, colour, shift in (
        (right_first, "right cause first", BLUE, -0.08),
        (exact_set, "exactly the right set", RED, 0.08),
    ):
        for g in range(len(EDGES) - 1):
            own = [t for t, k in zip(single, group, strict=True) if k == g]
            if own:
                hits = sum(map(test, own))
                at = g + shift
                ax.plot([at, at], [100 * x for x in wilson(hits, len(own))], color=colour)
                ax.plot(at, 100 * hits / len(own), "o", color=colour, label=label if g == 0 else "")
    ticks = [f"{a:g} to {b:g}" for a, b in pairwise(EDGES)]
    ax.set_xticks(range(len(ticks)), ticks)
    ax.set_xlabel("amplitude over the oracle's floor [1]")
    ax.set_ylabel("share of single effects [%]")
    ax.set_ylim(-2, 102)
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        ax.legend(handles, labels, loc="lower right")
    return figure
