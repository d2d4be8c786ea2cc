"""Figures and tables of the learnability experiment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.harness.common import Summary
from experiments.harness.report import Picture, Table, png, write_report
from jmm_agent.types import Floats
from mjcf_sandbox.files import write_bytes

OFF, NOMINAL, FLOOR, BEST = "off", "nominal", "floor", "2-together"
LABELS = {
    "off": "no learning",
    "1-ridge-min": "ridge, min(l, l_target)",
    "1-ridge-l_target": "ridge, l_target",
    "1-ridge-l": "ridge, l",
    "1-minibatch-min": "minibatch, min(l, l_target)",
    "1-minibatch-l_target": "minibatch, l_target (paper)",
    "1-minibatch-output-min": "minibatch, output layer, min(l, l_target)",
    "2-together": "observations and lengths together, ridge",
    "2-one-observation": "each observation alone, ridge",
    "2-paper": "each observation alone, minibatch, l_target (paper)",
    "floor": "lower bound: best command found",
    "nominal": "drawing(), no learning",
}
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
GREY = "#777777"
GROUPS = ("all", "neck", "scapula", "shoulder", "forearm")
ERRORS = {
    "target_true": "|target - true|",
    "estimate_true": "|estimate - true|",
    "estimate_target": "|estimate - target|",
}

INTRODUCTION = (
    "Each robot has all departures from the nominal model at once. It visits postures, learns at "
    "each, and is then tested on other postures of the same set. Stage 1 replaces vision by the "
    "true joint angles with 0.5 deg of noise; stage 2 uses the exact pose of the marker, 6 numbers "
    "for 14 joints; stage 3 is the best command, found with the true angles. Errors are root mean "
    "squares over joints, medians over postures; then median and worst over robots."
)


def report(summary: Summary, out: Path) -> None:
    """Write figures as PNG and report.html with all of them to ``out``."""
    figures = {
        "learning": (
            "Error at each posture before learning from it",
            learning_figure(summary),
            "Line: median over robots; band: quartiles; each posture is new. Dashed: lower bound.",
        ),
        "joints": (
            "Errors by joint",
            joints_figure(summary),
            "Medians over robots of the root mean square over postures. Below: joint angles by "
            "vision in the later half of learning.",
        ),
        "observability": (
            "Observability from the hand",
            observability_figure(summary),
            "Left: share of each joint's movement that one observation does not determine. Right: "
            "constant errors of the joints that move the marker least over many observations.",
        ),
    }
    pictures = []
    for name, (title, figure, note) in figures.items():
        pictures.append(Picture(title, png(figure), note))
        write_bytes(out / f"{name}.png", pictures[-1].png)
    tables = [stage_table(summary), group_table(summary), observability_table(summary)]
    write_report(out / "report.html", "Learnability", INTRODUCTION, summary, tables, pictures)


def stage_table(summary: Summary) -> Table:
    """Table of error, hand, vision and tension by trial; median and worst over robots."""
    rows = []
    for trial, label in LABELS.items():
        row = summary["over_seeds"][trial]
        seen = row.get("seen_true_deg")
        tension = row.get("max_tension_N")
        rows.append(
            (
                _staged(trial, label),
                _both(row["target_true_deg"]["all"]),
                _both(row["target_true_deg"]["worst"]),
                _both(row["target_true_hand_mm"], 0),
                _both(seen) if seen else "",
                _both(tension, 0) if tension else "",
                f"{row['pairs']['median']:.0f}" if "pairs" in row else "",
            )
        )
    head = (
        "trial",
        "|target - true| deg",
        "at the worst posture deg",
        "hand mm",
        "|vision - true| deg",
        "largest tension N",
        "pairs",
    )
    return Table(
        "Test postures: median over robots (worst robot)",
        head,
        rows,
        f"After {summary['sizes']['learned']} postures. Vision: later half of learning.",
    )


def group_table(summary: Summary) -> Table:
    """Table of the three errors by group: before and after learning, lower bound, drawing()."""
    columns = {"before": OFF, "after": BEST, "lower bound": FLOOR, "drawing()": NOMINAL}
    rows = []
    for key, label in ERRORS.items():
        for group in GROUPS:
            cells = [
                _both(summary["over_seeds"][trial][f"{key}_deg"][group])
                if f"{key}_deg" in summary["over_seeds"][trial]
                else ""
                for trial in columns.values()
            ]
            rows.append((f"{label} {group}, deg", *cells))
        hands = [
            _both(summary["over_seeds"][trial][f"{key}_hand_mm"], 0)
            if f"{key}_hand_mm" in summary["over_seeds"][trial]
            else ""
            for trial in columns.values()
        ]
        rows.append((f"{label} hand, mm", *hands))
    return Table(
        "The three errors by group: median over robots (worst robot)",
        ("error", *columns),
        rows,
        f"After: {LABELS[BEST]}.",
    )


def observability_table(summary: Summary) -> Table:
    """Table of constant errors that are poorly observable in many observations."""
    rows = [
        (
            " ".join(f"{share:+.2f} {joint}" for joint, share in direction["joints"].items()),
            f"{direction['mm_per_deg']:.2f}",
            f"{direction['deg_per_deg']:.2f}",
        )
        for direction in summary["observability"]["many_observations"]
    ]
    low, high = summary["observability"]["one_observation_dimensions"]
    return Table(
        "Poorly observable constant errors of the joints",
        ("direction (unit length; joints below 0.2 left out)", "mm per deg", "deg per deg"),
        rows,
        f"One observation does not determine {low if low == high else f'{low} to {high}'} of "
        f"{len(summary['joints'])} dimensions. Many observations determine all directions, these "
        "least. Columns: movement of the marker in the camera's frame for one degree.",
    )


def learning_figure(summary: Summary) -> Figure:
    """Error over the number of learned postures, by stage, with the lower bound."""
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    best = summary["over_seeds"][FLOOR]["target_true_deg"]["all"]["median"]
    for axes, stage, title in zip(
        panels, "12", ("Stage 1: true angles + 0.5 deg", "Stage 2: exact marker pose"), strict=True
    ):
        _curve(axes, summary, OFF, GREY)
        trials = [trial for trial in LABELS if trial.startswith(stage)]
        for trial, colour in zip(trials, COLOURS, strict=False):
            _curve(axes, summary, trial, colour)
        axes.axhline(best, color="black", ls="--", lw=1, label=f"{LABELS[FLOOR]} ({best:.2f} deg)")
        axes.set_title(title, loc="left")
        axes.set_xlabel("number of learned postures")
        axes.grid(alpha=0.3)
        axes.margins(x=0)
        axes.legend(fontsize=8, framealpha=0.9, loc="upper center", bbox_to_anchor=(0.5, -0.16))
    panels[0].set_ylabel("|target - true| [deg]")
    panels[0].set_ylim(-0.5, None)  # the lower bound may be zero
    return figure


def joints_figure(summary: Summary) -> Figure:
    """Bars by joint: errors before and after, and errors of vision by both kinds of fit."""
    figure = Figure(figsize=(11, 6.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    shown = {OFF: "before", BEST: "after", FLOOR: "lower bound", NOMINAL: "drawing()"}
    key = "target_true_joints_deg"
    _bars(above, summary, {label: (trial, key) for trial, label in shown.items()})
    above.set_ylabel("|target - true| [deg]")
    key = "seen_true_joints_deg"
    observations = {
        "each observation alone": ("2-one-observation", key),
        "all observations together": ("2-together", key),
    }
    _bars(below, summary, observations)
    below.set_ylabel("|vision - true| [deg]")
    below.set_xticks(range(len(summary["joints"])), summary["joints"], rotation=35, ha="right")
    return figure


def observability_figure(summary: Summary) -> Figure:
    """Undetermined share of each joint in one observation; weakest directions of many."""
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    share = summary["observability"]["one_observation_share"]
    left.barh(list(share), list(share.values()), color=COLOURS[0])
    left.invert_yaxis()
    left.set_xlim(0, 1)
    left.set_xlabel("share not determined by one observation (mean over postures)")
    directions = summary["observability"]["many_observations"]
    names = [
        "\n".join(
            " ".join(f"{x:+.1f} {joint}" for joint, x in pair)
            for pair in _chunks(list(direction["joints"].items())[:4], 2)
        )
        for direction in directions
    ]
    right.barh(names, [direction["mm_per_deg"] for direction in directions], color=COLOURS[1])
    right.invert_yaxis()
    right.tick_params(axis="y", labelsize=8)
    right.set_xlabel("marker's movement for 1 deg [mm]")
    for axes in (left, right):
        axes.grid(axis="x", alpha=0.3)
    return figure


def _curve(axes: Axes, summary: Summary, trial: str, colour: str) -> None:
    runs = [seed[trial]["online"]["target_true_deg"] for seed in summary["per_seed"].values()]
    low, middle, high = np.percentile(np.array(runs), [25, 50, 75], axis=0)
    postures = np.arange(len(middle))
    axes.plot(postures, middle, color=colour, lw=1.8, label=LABELS[trial])
    axes.fill_between(postures, low, high, color=colour, alpha=0.12, lw=0)


def _bars(axes: Axes, summary: Summary, series: dict[str, tuple[str, str]]) -> None:
    width = 0.8 / len(series)
    colours = (GREY, *COLOURS) if len(series) > 2 else COLOURS
    for rank, ((label, (trial, key)), colour) in enumerate(
        zip(series.items(), colours, strict=False)
    ):
        values = _median_over_seeds(summary, trial, key)
        locations = np.arange(len(values)) + width * (rank - (len(series) - 1) / 2)
        axes.bar(locations, values, width, color=colour, label=label)
    axes.legend(fontsize=9, ncols=len(series))
    axes.grid(axis="y", alpha=0.3)


def _median_over_seeds(summary: Summary, trial: str, key: str) -> Floats:
    rows: list[Any] = [seed[trial][key] for seed in summary["per_seed"].values()]
    return np.asarray(np.median(np.array(rows), axis=0))


def _both(value: dict[str, float], digits: int = 1) -> str:
    return f"{value['median']:.{digits}f} ({value['worst']:.{digits}f})"


def _staged(trial: str, label: str) -> str:
    return f"stage {trial[0]}: {label}" if trial[0].isdigit() else label


def _chunks(items: list[Any], size: int) -> list[list[Any]]:
    return [items[start : start + size] for start in range(0, len(items), size)]
