"""The rivals and their scores."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from reality_gap.diagnosis import FittedCandidate, NamedCause
from reality_gap.report.formatting import human, number, percent
from reality_gap.report.plots.canvas import AFTER, QUIET, figure, label_rows

MOST = 12


def by_step(fitted_candidates: tuple[FittedCandidate, ...]) -> list[list[FittedCandidate]]:
    """Rivals of each step of the search, the best first."""
    steps = sorted({fitted_candidate.step for fitted_candidate in fitted_candidates})
    return [
        sorted(
            (r for r in fitted_candidates if r.step == step),
            key=lambda r: (-_finite(r.score), str(r)),
        )
        for step in steps
    ]


def equivalents(step: list[FittedCandidate], causes: tuple[NamedCause, ...]) -> set[str]:
    """Ids of causes that cannot be told from the one that was chosen in a step."""
    chosen = {(r.candidate.cause.id, r.candidate.location) for r in step if r.chosen}
    return {
        id_
        for cause in causes
        if (cause.candidate.cause.id, cause.candidate.location) in chosen
        for id_ in cause.equivalent
    }


def candidate_scores(
    fitted_candidates: tuple[FittedCandidate, ...], causes: tuple[NamedCause, ...]
) -> Figure:
    """A bar for each rival's score, one chart for each step of the search."""
    steps = [step[:MOST] for step in by_step(fitted_candidates)]
    heights = [0.7 + 0.24 * max(len(step), 2) for step in steps]
    made, axes = figure(11, sum(heights) + 0.5, len(steps), 1, height_ratios=heights)
    for location, (ax, step) in enumerate(zip(axes[:, 0], steps, strict=True), 1):
        _bars(ax, step, equivalents(step, causes))
        if len(steps) > 1:
            title = f"in the place of cause {location}, the others being in the model"
            ax.set_title(title, loc="left", fontsize=10)
    axes[-1, 0].set_xlabel("score: log odds over your model, on held-out data [nats]", fontsize=9)
    alike = Patch(
        facecolor="white", edgecolor=AFTER, hatch="////", label="equivalent on these data"
    )
    patches = [
        Patch(color=AFTER, label="in the verdict" if causes else "the best of them"),
        *([alike] if any(equivalents(step, causes) for step in steps) else []),
        Patch(color=QUIET, label="rejected"),
    ]
    made.legend(handles=patches, loc="outside upper left", ncols=3, fontsize=8)
    return made


def _bars(ax: Axes, step: list[FittedCandidate], equivalent: set[str]) -> None:
    scores = [_finite(fitted_candidate.score) for fitted_candidate in step]
    widest = max(max(scores), 1.0)
    low = max(min(min(scores), 0.0), -0.15 * widest)
    for row, (fitted_candidate, score) in enumerate(zip(step, scores, strict=True)):
        width = max(score, low)
        if fitted_candidate.chosen:
            ax.barh(row, width, color=AFTER)
        elif fitted_candidate.candidate.cause.id in equivalent:
            ax.barh(row, width, color="white", edgecolor=AFTER, hatch="////")
        else:
            ax.barh(row, width, color=QUIET)
        told = (
            number(fitted_candidate.score) if math.isfinite(fitted_candidate.score) else "diverges"
        )
        ax.annotate(
            f" {told}   (confidence {percent(fitted_candidate.confidence)})",
            (max(width, 0.0), row),
            va="center",
            fontsize=8,
        )
    ax.axvline(0.0, color="black", lw=0.8)
    ax.set_xlim(low, 1.25 * widest)
    label_rows(ax, [_name(fitted_candidate) for fitted_candidate in step])
    ax.set_ylim(max(len(step), 2) - 0.4, -0.6)


def _name(fitted_candidate: FittedCandidate) -> str:
    location = str(fitted_candidate.candidate.location)
    short = (
        location
        if len(location) <= 40
        else f"{len(fitted_candidate.candidate.location.elements)} elements"
    )
    return f"{human(fitted_candidate.candidate.cause.id)} · {short}"


def _finite(score: float) -> float:
    return score if np.isfinite(score) else -np.finfo(float).max
