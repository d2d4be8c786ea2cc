"""The panel shows the curves of a session."""

from __future__ import annotations

import numpy as np

from kengoro.viewer.history import Curves
from kengoro.viewer.panel import Panel


def test_the_panel_shows_the_curves() -> None:
    panel, none = Panel(), np.zeros(0)
    empty = panel.draw(Curves(none, none, none, none, none, none))
    times = np.linspace(0.0, 5.0, 20)
    full = panel.draw(Curves(times, 10 - times, 100 - times, times[:3], times[:3], times[:3]))
    assert empty.shape == full.shape == (600, 460, 3)
    assert (empty != full).any(axis=2).sum() > 500
