"""A hinge with an encoder, and studies of its readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from reality_gap.study.data import Channel, Episode, Reading, Study
from reality_gap.types import Floats

MODEL = """<mujoco><worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody>
<sensor><jointpos name="angle" joint="j"/></sensor></mujoco>"""


def hinge(folder: Path) -> Path:
    """Write the model and return its file."""
    path = folder / "model.xml"
    path.write_text(MODEL)
    return path


def study(model: Path, values: Floats, noise: float | None = None) -> Study:
    """Study of angles (n,) [rad] at 1 kHz with a stated noise."""
    time = 0.001 * np.arange(len(values))
    channel = Channel("angle", "angle", unit="rad", noise=noise)
    episode = Episode("log", time, np.zeros((len(time), 0)), (Reading(time, values),))
    return Study("test", model, (channel,), (episode,))
