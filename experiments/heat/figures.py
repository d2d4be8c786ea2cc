"""Figure of heat: the hottest motor of a robot, and when changes are named."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.figure import Figure

from experiments.harness.experiment import Results
from experiments.harness.report import Picture, png
from experiments.heat.tables import FAULTS, HEALTHY, MINUTES
from jmm_agent.heat.parameters import HeatOptions

COLOURS = {
    "housing_to_ambient": "#c8452f",
    "heat_per_tension": "#3a6fb5",
    "core_to_housing": "#8c6bb1",
}


def pictures(results: Results) -> list[Picture]:
    """All figures of the report."""
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    seed = max(results, key=lambda s: results[s][HEALTHY]["hottest"])
    curves = np.array(results[seed][HEALTHY]["curves"])
    hours = np.linspace(0.0, 1.0, len(curves)) * results[seed][HEALTHY]["hours"]
    true, mean, high, nominal = curves.T
    left.fill_between(hours, 2 * mean - high, high, color="#3a6fb5", alpha=0.2, lw=0)
    left.plot(hours, mean, color="#3a6fb5", lw=1, label="estimate, with its interval")
    left.plot(hours, nominal, color="#777777", lw=1, ls="--", label="by the data sheet alone")
    left.plot(hours, true, color="black", lw=1, label="true")
    left.axhline(HeatOptions().limit, color="#c8452f", lw=1, label="limit")
    left.set(xlabel="time [h]", ylabel="core temperature [degC]")
    left.set_title(f"the hottest motor of robot {seed}", loc="left")
    left.legend(fontsize=8, loc="lower right")
    for result in results.values():
        for change in result[FAULTS]["changes"]:
            minutes, up = change["minutes"], change["factor"] > 1.0
            right.plot(
                change["rise_K"],
                MINUTES * 1.6 if minutes is None else minutes,
                "^" if up else "v",
                color=COLOURS[change["parameter"]],
                mfc="none" if minutes is None else None,
                ms=6,
            )
    for parameter, colour in COLOURS.items():
        right.plot([], [], "^", color=colour, label=parameter)
    right.plot([], [], "^", color="black", label="up by 25 %")
    right.plot([], [], "v", color="black", label="down by 20 %")
    right.plot([], [], "^", color="black", mfc="none", label="not named")
    right.axhline(MINUTES, color="black", lw=0.8, ls=":")
    right.set(
        xlabel="rise of the housing over its surroundings [K]",
        ylabel="time until a change is named [min]",
        ylim=(0.0, MINUTES * 2.4),
    )
    right.legend(fontsize=8, ncols=2, loc="upper right")
    for axes in (left, right):
        axes.grid(alpha=0.3)
    caption = "Left: a plan with the limit. Right: each change of a parameter on each robot."
    return [Picture("Core temperature, and changes that are named", png(figure), caption)]
