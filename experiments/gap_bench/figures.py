"""Figures of the diagnosis trials: confusion matrix, calibration of confidences, and gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.figure import Figure

from experiments.gap_bench.criteria import confidences
from experiments.gap_bench.scores import (
    NOTHING,
    UNEXPLAINED,
    Trial,
    gain_ratio,
    right_first,
)
from experiments.gap_bench.tables import NO_FAULT
from experiments.harness.criteria import BINS, bins, wilson
from experiments.harness.report import Picture, png
from hidden_plants import OUTSIDE

RIGHT, WRONG = "#3a6fb5", "#c8452f"


def pictures(trials: Sequence[Trial], matrix: Mapping[str, Mapping[str, int]]) -> list[Picture]:
    """All figures of the report."""
    found = []
    if matrix:
        note = "Single effects and fault-free logs. Framed: the right answer."
        found.append(Picture("Confusion matrix", _finished(_confusion(matrix)), note))
    note = "Named causes in ten bins of their confidence; bars: Wilson 95 % intervals."
    found.append(Picture("Calibration of confidences", _finished(_reliability(trials)), note))
    if any(t["true_model"] and gain_ratio(t) is not None for t in trials):
        note = "Both on readings that are used neither to fit nor to select."
        found.append(Picture("Gain of the named model", _finished(_gains(trials)), note))
    return found


def _finished(figure: Figure) -> bytes:
    data = png(figure)
    pyplot.close(figure)
    return data


def _confusion(matrix: Mapping[str, Mapping[str, int]]) -> Figure:
    rows = list(matrix)
    names = {name for answers in matrix.values() for name in answers}
    both = [row for row in rows if row not in (NO_FAULT, *OUTSIDE)]
    columns = [*both, *sorted(names - set(rows) - {NOTHING, UNEXPLAINED}), NOTHING, UNEXPLAINED]
    counts = np.array([[matrix[row].get(column, 0) for column in columns] for row in rows])
    shares = counts / counts.sum(axis=1, keepdims=True)
    figure, ax = pyplot.subplots(
        figsize=(4.2 + 0.36 * len(columns), 2.6 + 0.3 * len(rows)), layout="constrained"
    )
    image = ax.imshow(100 * shares, cmap="Blues", vmin=0, vmax=100, aspect="auto")
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            if counts[i, j]:
                colour = "white" if shares[i, j] > 0.6 else "black"
                ax.text(j, i, str(counts[i, j]), ha="center", va="center", color=colour, fontsize=8)
            if column == _right_answer(row):
                frame = pyplot.Rectangle((j - 0.5, i - 0.5), 1, 1, fill=False, edgecolor=WRONG)
                ax.add_patch(frame)
    ax.set_xticks(range(len(columns)), columns, rotation=60, ha="right", fontsize=8)
    ax.set_yticks(range(len(rows)), rows, fontsize=8)
    ax.set_xlabel("named first")
    ax.set_ylabel("hidden")
    figure.colorbar(image, label="share of the row [%]", shrink=0.8)
    return figure


def _right_answer(row: str) -> str:
    if row == NO_FAULT:
        return NOTHING
    return UNEXPLAINED if row in OUTSIDE else row


def _reliability(trials: Sequence[Trial]) -> Figure:
    figure, ax = pyplot.subplots(figsize=(6, 5.2), layout="constrained")
    ax.plot([0, 1], [0, 1], color="#999999", linestyle="--", label="calibrated")
    confidence, right = confidences(trials)
    where = bins(confidence)
    for b in range(BINS):
        own = where == b
        if own.any():
            x, share = float(confidence[own].mean()), float(right[own].mean())
            ax.plot([x, x], wilson(int(right[own].sum()), int(own.sum())), color=RIGHT)
            ax.plot(x, share, "o", color=RIGHT)
            ax.annotate(f"{own.sum()}", (x, share), xytext=(6, 2), textcoords="offset points")
    ax.set_xlabel("confidence, mean of its bin [1]")
    ax.set_ylabel("share of named causes that are true [1]")
    ax.set_xlim(-0.02, 1.1)  # room for the count at 1
    ax.set_ylim(-0.02, 1.04)
    ax.legend(loc="upper left")
    return figure


def _gains(trials: Sequence[Trial]) -> Figure:
    figure, ax = pyplot.subplots(figsize=(6, 5.2), layout="constrained")
    ax.plot([0, 1], [0, 1], color="#999999", linestyle="--")
    known = [t for t in trials if gain_ratio(t) is not None]
    single = [t for t in known if t["case"]["kind"] == "single"]
    rest = [t for t in known if t["case"]["kind"] != "single"]
    groups = (
        ("right cause first", [t for t in single if right_first(t)], RIGHT, "o"),
        ("another answer", [t for t in single if not right_first(t)], WRONG, "x"),
        ("two causes, or one outside", rest, "#777777", "."),
    )
    for label, own, colour, marker in groups:
        true = [t["true_model"]["gain"] for t in own]
        ax.plot(true, [t["gain"] for t in own], marker, color=colour, label=f"{label} ({len(own)})")
    ax.set_xlabel("gain of the true model [1]")
    ax.set_ylabel("gain of the diagnosed model [1]")
    ax.legend(loc="upper left")
    return figure
