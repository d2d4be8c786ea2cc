"""Figure of the stiffness: errors by stiffness, and asked against measured stiffness."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.figure import Figure

from experiments.harness.experiment import Results
from experiments.harness.report import Picture, plain_ticks, png
from experiments.stiffness_and_load.tables import (
    AGENTS,
    MUST_STIFFNESS,
    OURS,
    SAG,
    TENDONS,
    numbers,
    pushed,
)

STYLES = {SAG: ("#777777", "v"), OURS: ("#c8452f", "o"), TENDONS: ("#3a6fb5", "s")}
"""Colour and marker of each agent."""


def pictures(results: Results, stiffness: Sequence[float]) -> list[Picture]:
    """All figures of the report."""
    return [
        Picture(
            "Errors by stiffness, and stiffness by pushes",
            png(_panels(results, stiffness)),
            "Left and middle: medians over robots, and each robot. Right: each push; the band is "
            "25 % of what was asked.",
        )
    ]


def _panels(results: Results, stiffness: Sequence[float]) -> Figure:
    figure = Figure(figsize=(12.5, 4.6), layout="constrained")
    errors, tensions, joints = figure.subplots(1, 3)
    for agent, (colour, marker) in STYLES.items():
        for axes, key in ((errors, "target_true_deg"), (tensions, "max_tension_N")):
            each = np.array([numbers(results, agent, value, key) for value in stiffness])
            axes.plot(stiffness, np.median(each, axis=1), color=colour, marker=marker,
                      label=AGENTS[agent])  # fmt: skip
            for robot in each.T:
                axes.plot(stiffness, robot, ".", color=colour, alpha=0.5, ms=4)
        if agent != SAG:
            asked, measured = (
                np.concatenate(pushed(results, agent, key)) for key in ("asked", "measured")
            )
            joints.plot(asked, measured, marker, color=colour, ms=5, alpha=0.8)
    for axes, label in ((errors, "joints, target - true [deg]"), (tensions, "largest tension [N]")):
        axes.set(xscale="log", xlabel="stiffness of the muscles [N/mm]", ylabel=label)
        axes.set_xticks(stiffness, [f"{value:g}" for value in stiffness])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
    errors.set_yscale("log")
    plain_ticks(errors.yaxis)
    tensions.set_ylim(0.0, None)
    most = 1.1 * max(float(np.max(part)) for part in pushed(results, OURS, "asked"))
    line = np.array([0.0, most])
    joints.plot(line, line, color="black", lw=1)
    joints.fill_between(
        line, (1.0 - MUST_STIFFNESS) * line, (1.0 + MUST_STIFFNESS) * line, color="black", alpha=0.1
    )
    joints.set(xlabel="stiffness asked of a joint [N m/rad]", ylabel="measured by a push [N m/rad]")
    joints.grid(alpha=0.3)
    figure.legend(*errors.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure
