"""Pictures of the measured machines: measured and predicted signals on held-out readings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from experiments.harness.report import Picture, png
from experiments.real_machines.trial import EXTENDED, NOMINAL
from jmm_agent.types import Floats

MEASURED, COLOURS = "#222222", ("#999999", "#D55E00", "#0072B2")
"""Colours of the measured signal, and of the nominal, the extended and the baseline's."""
WIDTHS = (3.0, 1.2, 1.2)
"""Widths of their lines; the nominal model equals the extended one if nothing is named."""
MOST = 4
"""Largest number of signals in a picture."""


def pictures(done: Mapping[str, Any]) -> list[Picture]:
    """A picture of each machine."""
    return [
        Picture(
            result["title"],
            _picture(result),
            "Above: measured and predicted signals. Below: their errors, where readings were held "
            "out; in between they were fitted.",
        )
        for result in done.values()
    ]


def best_baseline(result: Mapping[str, Any]) -> str:
    """Name of the baseline with the least held-out error."""
    return min(result["baselines"], key=lambda title: float(result["errors"][title]["all"]))


def _picture(result: Mapping[str, Any]) -> bytes:
    some = result["signals"][:MOST]
    keys = (NOMINAL, EXTENDED, best_baseline(result))
    figure, axes = pyplot.subplots(
        2,
        len(some),
        figsize=(5.2 * len(some) if len(some) > 1 else 11, 6),
        sharex="col",
        sharey="row" if len({s["channel"] for s in some}) == 1 else "none",
        squeeze=False,
        layout="constrained",
    )
    for (above, below), signal in zip(axes.T, some, strict=True):
        time = np.array(signal["time"])
        held_out = np.array(signal["held_out"])
        measured = np.array(signal["measured"])
        above.plot(time, measured, color=MEASURED, lw=1.8, label="measured")
        for key, colour, width in zip(keys, COLOURS, WIDTHS, strict=True):
            predicted = np.array(signal["predicted"][key])
            above.plot(time, predicted, color=colour, lw=width, label=key)
            error = np.where(held_out, measured - predicted, np.nan)
            below.plot(time, error, color=colour, lw=width)
        _mark(below, time, held_out)
        above.set_title(signal["episode"], fontsize=10)
        above.set_ylabel(f"{signal['channel']} [{signal['unit']}]")
        below.set_ylabel(f"measured - predicted [{signal['unit']}]")
        below.set_xlabel("time [s]")
        below.axhline(0.0, color="#cccccc", lw=1, zorder=0)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    data = png(figure)
    pyplot.close(figure)
    return data


def _mark(axis: Axes, time: Floats, held_out: Floats) -> None:
    """Shade the times of the readings that were held out."""
    axis.fill_between(
        time,
        0,
        1,
        where=held_out.astype(bool).tolist(),
        transform=axis.get_xaxis_transform(),
        color="#f0f0f0",
        lw=0,
        zorder=0,
    )
