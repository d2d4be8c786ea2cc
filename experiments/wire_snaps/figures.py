"""Figure of snapped muscles: errors before and after, and postures that can still be held."""

from __future__ import annotations

from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.figure import Figure

from experiments.harness.experiment import Results
from experiments.harness.report import Picture, plain_ticks, png
from experiments.robots.conditions import ACTUAL
from experiments.wire_snaps.tables import MUST_RATIO, held

STAGES = {
    "unnoticed": ("#777777", "v", "not noticed"),
    "after": ("#3a6fb5", "o", "right after"),
    "learned": ("#c8452f", "s", "after more postures"),
}
"""Colour, marker and title of each stage."""
ABOVE: dict[str, Any] = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "fontsize": 8}
"""Place of a legend that covers no data."""


def pictures(results: Results) -> list[Picture]:
    """All figures of the report."""
    figure = Figure(figsize=(10.5, 4.6), layout="constrained")
    errors, shares = figure.subplots(1, 2)
    muscles = [(result[ACTUAL], muscle) for result in results.values()
             for muscle in result[ACTUAL]["muscles"]]  # fmt: skip
    all_before = []
    for key, (colour, marker, title) in STAGES.items():
        for number, (robot, muscle) in enumerate(muscles):
            before, after = held(robot["before"], muscle[key])
            all_before += before
            errors.plot(before, after, marker, color=colour, ms=5, alpha=0.7,
                        label=title if number == 0 else None)  # fmt: skip
    line = np.array([0.9 * min(all_before, default=0.5), 1.1 * max(all_before, default=2.0)])
    errors.plot(line, line, color="black", lw=0.8)
    errors.plot(line, MUST_RATIO * line, color="black", lw=0.8, ls=":")
    errors.set(xlabel="error before the muscle snaps [deg]", ylabel="error without it [deg]")
    errors.set(xscale="log", yscale="log")
    plain_ticks(errors.xaxis)
    plain_ticks(errors.yaxis)
    errors.grid(alpha=0.3)
    errors.legend(**ABOVE, ncols=3)
    names = [f"{seed} {muscle['muscle']}" for seed, result in results.items()
             for muscle in result[ACTUAL]["muscles"]]  # fmt: skip
    rows = np.arange(len(names))
    for shift, key, colour, title in (
        (-0.2, "lost", "#c8452f", "by the agent's map"),
        (0.2, "lost_actual", "#777777", "on the actual robot"),
    ):
        kept = [100.0 * (1.0 - muscle[key]) for _, muscle in muscles]
        shares.barh(rows + shift, kept, 0.38, color=colour, label=title)
    shares.set_yticks(rows, names, fontsize=7)
    shares.set(xlabel="postures that can still be held [%]", xlim=(0.0, 100.0))
    shares.set_ylabel("robot and muscle")
    shares.legend(**ABOVE, ncols=2)
    return [
        Picture(
            "Errors with a snapped muscle, and postures that can be held",
            png(figure),
            "Left: each posture that can still be held by the balance; lines: once and twice the "
            "error before. Right: each robot and muscle.",
        )
    ]
