"""Log of the efforts of the screw's carriage, which are computed by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.types import Floats

MASS, DAMPING = 90.0, 200.0
"""Of the carriage [kg, N s/m]."""
Friction = Callable[[Floats, Floats], Floats]
"""Friction at speeds and loads, shape (k,) each."""


def carriage_study(model: Path, late: float = 0.0, friction: Friction | None = None) -> Study:
    """A log of the carriage, whose efforts are late and include a friction."""
    time = np.arange(0.0, 12.0, 0.005)
    motion = 0.1 * np.sin(4.0 * time) + 0.05 * np.sin(7.0 * time)
    then = time - late
    speed = 0.4 * np.cos(4.0 * then) + 0.35 * np.cos(7.0 * then)
    load = DAMPING * speed - MASS * (1.6 * np.sin(4.0 * then) + 2.45 * np.sin(7.0 * then))
    effort = load if friction is None else load + friction(speed, load)
    channels = (
        Channel("position", "position", unit="m", noise=1e-6),
        Channel("effort", "screw", unit="N", noise=0.1, kind="effort"),
    )
    readings = (Reading(time, motion), Reading(time, effort))
    episode = Episode("waves", time, np.zeros((len(time), 1)), readings)
    return Study("screw", model, channels, (episode,))
