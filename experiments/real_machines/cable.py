"""Part of the da Vinci log, as a study of a length that fits the comparison."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.davinci.log import RATE, read_runs
from experiments.davinci.study import make_study as make_whole
from reality_gap import Study

FILE = "davinci_cable/tool4_L4_freq5_load10.npz"
"""File of the log in the user's data."""


def make_study(data: Path, out: Path, seconds: float) -> Study:
    """Make the study of the shortest runs of the da Vinci study, up to ``seconds``.

    Raises:
        ExperimentError: the file cannot be used.
    """
    whole = make_whole(read_runs(data / FILE, RATE))
    order = sorted(whole.episodes, key=lambda episode: episode.duration)
    ends = np.cumsum([episode.duration for episode in order])
    count = max(int(np.sum(ends <= seconds)), 1)
    return replace(whole, episodes=tuple(order[:count]))
