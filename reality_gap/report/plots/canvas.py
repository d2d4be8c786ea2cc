"""Canvas: colours, figures without a display, and PNG for all pictures."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

MEASURED, BEFORE, AFTER = "#333333", "#c8452f", "#3a6fb5"
FLOOR, LEARNED, QUIET = "#3f8f3f", "#d39a2a", "#b9b6ae"
SPLITS = (("fit", "#f1efe9"), ("choose", "#dfe3f3"), ("report", "#dcefdc"))
"""Name and colour of each part of the data, by the number in `Trace.split`."""


def figure(
    width: float, height: float, rows: int = 1, columns: int = 1, **options: Any
) -> tuple[Figure, NDArray[Any]]:
    """Create a figure without a window.

    Args:
        width, height: size [inches].
        rows, columns: numbers of axes.
        options: passed on to ``Figure.subplots``.

    Returns:
        The figure and its axes, shape (rows, columns).
    """
    made = Figure(figsize=(width, height), layout="constrained")
    axes = made.subplots(rows, columns, squeeze=False, **options)
    for ax in axes.flat:
        ax.tick_params(labelsize=8)
        ax.spines[["top", "right"]].set_visible(False)
    return made, axes


def png(made: Figure) -> str:
    """Return a figure as PNG in base64, for a data URL."""
    buffer = io.BytesIO()
    made.savefig(buffer, format="png", dpi=110)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def shade(
    ax: Axes, time: NDArray[np.float64], split: NDArray[np.int64], height: float = 1.0
) -> None:
    """Colour the background of axes by the parts of the data.

    Args:
        ax: axes with time on x.
        time: increasing times, shape (k,), in the unit of the axes.
        split: part of the data, shape (k,), as in `Trace`.
        height: height of the colour from the bottom, as a share of the axes.
    """
    change = np.flatnonzero(np.diff(split)) + 1
    edges = np.r_[time[0], (time[change - 1] + time[change]) / 2, time[-1]]
    roles = split[np.r_[0, change]]
    spans = np.column_stack([edges[:-1], np.diff(edges)])
    for role, (_, colour) in enumerate(SPLITS):
        ax.broken_barh(
            spans[roles == role],
            (0.0, height),
            color=colour,
            lw=0,
            zorder=0,
            transform=ax.get_xaxis_transform(),
        )


def label_rows(ax: Axes, names: Iterable[str]) -> None:
    """Label bars or rows with names, the first on top."""
    listed = list(names)
    ax.set_yticks(range(len(listed)), listed, fontsize=8)
    ax.set_ylim(len(listed) - 0.4, -0.6)
