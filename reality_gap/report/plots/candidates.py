"""Evidence of the fitted candidates."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from reality_gap.diagnosis import FittedCandidate, NamedCause
from reality_gap.report.formatting import human, number, probability
from reality_gap.report.plots.canvas import AFTER, QUIET, figure, label_rows

MOST = 12
"""Largest number of bars in a chart."""
CLOSE = 1.0
"""Evidence below that of the chosen candidate down to which another one is as likely [nats]."""
LONGEST = 40
"""Largest number of characters of a location that is written out."""


def by_step(fitted_candidates: tuple[FittedCandidate, ...]) -> list[list[FittedCandidate]]:
    """Return the candidates of each step of the search, the chosen one first, then the best."""
    steps = sorted({fitted.step for fitted in fitted_candidates})
    return [
        sorted(
            (r for r in fitted_candidates if r.step == step),
            key=lambda r: (not r.chosen, -r.evidence, str(r)),
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


def as_likely(fitted: FittedCandidate, step: list[FittedCandidate]) -> bool:
    """Return whether a candidate that was not chosen is about as likely as the chosen one.

    Args:
        fitted: a candidate.
        step: all candidates of its step.
    """
    chosen = [other.evidence for other in step if other.chosen]
    return bool(chosen) and not fitted.chosen and fitted.evidence >= chosen[0] - CLOSE


def candidate_evidence(
    fitted_candidates: tuple[FittedCandidate, ...], causes: tuple[NamedCause, ...]
) -> Figure:
    """Plot a bar for the evidence of each candidate, in one chart for each step of the search."""
    steps = [step[:MOST] for step in by_step(fitted_candidates)]
    heights = [0.7 + 0.24 * max(len(step), 2) for step in steps]
    made, axes = figure(11, sum(heights) + 0.5, len(steps), 1, height_ratios=heights)
    for rank, (ax, step) in enumerate(zip(axes[:, 0], steps, strict=True), 1):
        _bars(ax, step, equivalents(step, causes))
        if len(steps) > 1:
            title = f"instead of cause {rank}, with the others in the model"
            ax.set_title(title, loc="left", fontsize=10)
    axes[-1, 0].set_xlabel("evidence: log odds over the model without it [nats]", fontsize=9)
    alike = Patch(facecolor="white", edgecolor=AFTER, hatch="////", label="as likely on these data")
    patches = [
        Patch(color=AFTER, label="in the verdict" if causes else "best attempt"),
        *([alike] if any(_alike(step, causes) for step in steps) else []),
        Patch(color=QUIET, label="rejected"),
    ]
    made.legend(handles=patches, loc="outside upper left", ncols=3, fontsize=8)
    return made


def _alike(step: list[FittedCandidate], causes: tuple[NamedCause, ...]) -> bool:
    """Return whether a step has candidates that are as likely as the chosen one."""
    same = equivalents(step, causes)
    return any(as_likely(one, step) or one.candidate.cause.id in same for one in step)


def _bars(ax: Axes, step: list[FittedCandidate], equivalent: set[str]) -> None:
    widest = max(1.0, *(fitted.evidence for fitted in step))
    low = max(min(0.0, *(fitted.evidence for fitted in step)), -0.15 * widest)
    for row, fitted in enumerate(step):
        width = max(fitted.evidence, low)
        if fitted.chosen:
            ax.barh(row, width, color=AFTER)
        elif fitted.candidate.cause.id in equivalent or as_likely(fitted, step):
            ax.barh(row, width, color="white", edgecolor=AFTER, hatch="////")
        else:
            ax.barh(row, width, color=QUIET)
        text = number(fitted.evidence) if math.isfinite(fitted.score) else "diverges"
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
    note = f" ({location.note})" if location.note else ""
    short = text if len(text) <= LONGEST else f"{len(location.elements)} elements{note}"
    return f"{human(fitted.candidate.cause.id)} · {short}"
