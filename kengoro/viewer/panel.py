"""Panel beside the scene: legend, colours of the muscles, and curves of the estimation error."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from kengoro.viewer.history import Curves
from kengoro.viewer.scene import ESTIMATED_COLOUR, FULL_TENSION, MUSCLE_COLOURS, SEEN_COLOUR
from kengoro_env.vision.rendering import Image

SIZE = (4.6, 6.0)
"""Width and height of the panel [inch]."""

DPI = 100
"""Resolution of the panel [pixels per inch]."""


class Panel:
    """Draws the panel; the axes are made once and reused for each picture."""

    def __init__(self) -> None:
        figure = Figure(figsize=SIZE, dpi=DPI)
        self._canvas = FigureCanvasAgg(figure)
        colours = figure.add_axes((0.15, 0.885, 0.8, 0.02))
        joints = figure.add_axes((0.15, 0.45, 0.8, 0.34))
        hand = figure.add_axes((0.15, 0.08, 0.8, 0.33))
        scale = ScalarMappable(Normalize(0.0, FULL_TENSION), MUSCLE_COLOURS)
        figure.colorbar(
            scale, colours, orientation="horizontal", extend="max", label="muscle tension [N]"
        )
        self._axes = joints, hand
        self._lines = [
            _empty_lines(joints, "joint angles: RMSE [deg]"),
            _empty_lines(hand, "grip point: distance [mm]"),
        ]
        hand.set_xlabel("simulated time [s]")
        estimated = Line2D(
            [], [], ls="", marker="s", ms=9, color=ESTIMATED_COLOUR, label="marker, estimated"
        )
        seen = Line2D([], [], marker="o", ms=9, color=SEEN_COLOUR, label="marker, last seen")
        handles = [estimated, seen, *self._lines[0]]
        figure.legend(handles=handles, loc="upper center", ncols=2, frameon=False)

    def draw(self, curves: Curves) -> Image:
        """Draw the panel, shape (600, 460, 3) uint8, RGB."""
        errors = (curves.true_deg, curves.seen_deg), (curves.true_mm, curves.seen_mm)
        for axes, (line, dots), (true, seen) in zip(self._axes, self._lines, errors, strict=True):
            line.set_data(curves.time, true)
            dots.set_data(curves.observation_time, seen)
            axes.set_ylim(0.0, 1.15 * max([1e-3, *true, *seen]))
            axes.set_xlim(0.0, 1.03 * max([1.0, *curves.time]))
        self._canvas.draw()
        return np.ascontiguousarray(np.asarray(self._canvas.buffer_rgba())[:, :, :3])


def _empty_lines(axes: Axes, label: str) -> tuple[Line2D, Line2D]:
    """Lines without points: a curve over time, and dots at the marker observations."""
    (line,) = axes.plot([], [], color="#444444", lw=1.5, label="estimate - true")
    (dots,) = axes.plot([], [], "o", color=SEEN_COLOUR, ms=4, label="estimate - seen")
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    return line, dots
