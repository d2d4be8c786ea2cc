"""Picture of a commissioning run: responses as predicted and as measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from jmm_agent.commissioning.commissioning import Commissioning
from jmm_agent.types import Floats

MOST = 0.6
"""Response at the end of the colour scale [1]."""


def draw_responses(result: Commissioning, path: Path) -> None:
    """Draw predicted and measured responses of the lengths, and their difference, as matrices.

    Args:
        result: of a run in which muscles were pulled.
        path: of the picture; its folder must exist.
    """
    count = len(result.muscles)
    side = max(3.2, 0.13 * count)
    figure = Figure(figsize=(3.0 * side + 2.6, side + 1.5), layout="constrained")
    titles = ("predicted", "measured", "measured - predicted")
    panels = (result.predicted, result.measured, result.measured - result.predicted)
    axes = figure.subplots(1, 3)
    for axis, title, panel in zip(axes, titles, panels, strict=True):
        image = _matrix(axis, panel, title, result)
    axes[0].set_yticks(range(count), result.muscles, fontsize=6)
    axes[0].set_ylabel("muscle whose length changes")
    bar = figure.colorbar(image, ax=list(axes), shrink=0.8, extend="both")
    bar.set_label("shortening over stroke [mm/mm]")
    named = "; ".join(
        f"{finding.kind.replace('_', ' ')}: {', '.join(finding.muscles)}"
        for finding in result.findings
    )
    stroke = 0.0
    if result.record is not None:
        stroke = 1e3 * float(np.abs(result.record.strokes).max(initial=0.0))
    figure.suptitle(f"Strokes of {stroke:.2g} mm.  {named or 'No fault found'}", fontsize=9)
    figure.savefig(path, dpi=130)


def _matrix(axis: Axes, values: Floats, title: str, result: Commissioning) -> AxesImage:
    """Draw one matrix; muscles of findings are marked at its edge."""
    image = axis.imshow(values, cmap="RdBu_r", vmin=-MOST, vmax=MOST, interpolation="nearest")
    axis.set_facecolor("0.75")  # where a muscle was not pulled enough
    axis.set_title(title, fontsize=9)
    axis.set_xticks(range(len(result.muscles)), result.muscles, rotation=90, fontsize=6)
    axis.set_yticks([])
    axis.set_xlabel("muscle that is pulled")
    for finding in result.findings:
        for muscle in finding.muscles:
            index = result.muscles.index(muscle)
            axis.axhline(index, color="k", linewidth=0.4, alpha=0.6)
            axis.axvline(index, color="k", linewidth=0.4, alpha=0.6)
    return image
