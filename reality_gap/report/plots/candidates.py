"""Scores of the fitted candidates."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from reality_gap.diagnosis import FittedCandidate, NamedCause
from reality_gap.report.formatting import human, number, probability
from reality_gap.report.plots.canvas import AFTER, QUIET, figure, label_rows

MOST = 12
"""Largest number of bars in a chart."""
LONGEST = 40
"""Largest number of characters of a location that is written out."""


def by_step(fitted_candidates: tuple[FittedCandidate, ...]) -> list[list[FittedCandidate]]:
    """Return the candidates of each step of the search, the best first."""
    steps = sorted({fitted.step for fitted in fitted_candidates})
    return [
        sorted(
            (r for r in fitted_candidates if r.step == step),
            key=lambda r: (-_finite(r.score), str(r)),
        )
        for step in steps
    ]


def equivalents(step: list[FittedCandidate], causes: tuple[NamedCause, ...]) -> set[str]:
    """Return the ids of causes that the data cannot distinguish from the one chosen in a step."""
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
    """Plot a bar for the score of each candidate, in one chart for each step of the search."""
    steps = [step[:MOST] for step in by_step(fitted_candidates)]
    heights = [0.7 + 0.24 * max(len(step), 2) for step in steps]
    made, axes = figure(11, sum(heights) + 0.5, len(steps), 1, height_ratios=heights)
    for rank, (ax, step) in enumerate(zip(axes[:, 0], steps, strict=True), 1):
        _bars(ax, step, equivalents(step, causes))
        if len(steps) > 1:
            title = f"instead of cause {rank}, with the others in the model"
            ax.set_title(title, loc="left", fontsize=10)
    axes[-1, 0].set_xlabel("score: log odds over your model, on held-out data [nats]", fontsize=9)
    alike = Patch(
        facecolor="white", edgecolor=AFTER, hatch="////", label="equivalent on these data"
    )
    patches = [
        Patch(color=AFTER, label="in the verdict" if causes else "best"),
        *([alike] if any(equivalents(step, causes) for step in steps) else []),
        Patch(color=QUIET, label="rejected"),
    ]
    made.legend(handles=patches, loc="outside upper left", ncols=3, fontsize=8)
    return made


def _bars(ax: Axes, step: list[FittedCandidate], equivalent: set[str]) -> None:
    scores = [_finite(fitted.score) for fitted in step]
    widest = max(max(scores), 1.0)
    low = max(min(min(scores), 0.0), -0.15 * widest)
    for row, (fitted, score) in enumerate(zip(step, scores, strict=True)):
        width = max(score, low)
        if fitted.chosen:
            ax.barh(row, width, color=AFTER)
        elif fitted.candidate.cause.id in equivalent:
            ax.barh(row, width, color="white", edgecolor=AFTER, hatch="////")
        else:
            ax.barh(row, width, color=QUIET)
        text = number(fitted.score) if math.isfinite(fitted.score) else "diverges"
        ax.annotate(
            f" {text}   (confidence {probability(fitted.confidence)})",
            (max(width, 0.0), row),
            va="center",
            fontsize=8,
        )
    ax.axvline(0.0, color="black", lw=0.8)
    ax.set_xlim(low, 1.25 * widest)
    label_rows(ax, [_name(fitted) for fitted in step])
    ax.set_ylim(max(len(step), 2) - 0.4, -0.6)


def _name(fitted: FittedCandidate) -> str:
    location = fitted.candidate.location
    text = str(location)
    short = text if len(text) <= LONGEST else f"{len(location.elements)} elements"
    return f"{human(fitted.candidate.cause.id)} · {short}"


def _finite(score: float) -> float:
    return score if np.isfinite(score) else -np.finfo(float).max
