"""Channels that contradict the nominal model: forces of the wrong sign, motion far too large."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.simulation.hypothesis import build
from reality_gap.simulation.replay import replay
from reality_gap.study.data import Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import compile_system
from reality_gap.types import Floats

FAR = 20.0
"""Ratio of a channel's spread to that of its replay, or inverse, that no fault can cause."""
EDGE = 0.05
"""Share of an actuator's range by which a median may lie outside, due to noise and offsets."""


def implausible_channels(study: Study) -> list[str]:
    """Return a sentence on each channel that is far from a replay of the nominal model."""
    return [*_wrong_signs(study), *([] if study.inverse else _wrong_spreads(study))]


def _wrong_signs(study: Study) -> list[str]:
    """Return a sentence on each force that the model's actuator cannot exert."""
    model = study.spec().compile()
    actuator = int(mujoco.mjtSensor.mjSENS_ACTUATORFRC)
    found = []
    for i, channel in enumerate(study.channels):
        if channel.kind == "effort" or int(model.sensor(channel.sensor).type[0]) != actuator:
            continue
        target = int(model.sensor(channel.sensor).objid[0])
        low, high = model.actuator_forcerange[target]
        values = np.concatenate([episode.readings[i].value for episode in study.episodes])
        middle = float(np.median(values))
        slack = EDGE * (high - low)
        if not model.actuator_forcelimited[target] or low - slack <= middle <= high + slack:
            continue
        possible = f"the model's actuator exerts {low:.3g} to {high:.3g}"
        text = f"{channel.name} is {middle:.3g} {channel.unit} at its median, but {possible}"
        flipped = low <= -middle <= high
        found.append(text + (": is its sign wrong (scale: -1)?" if flipped else ""))
    return found


def _wrong_spreads(study: Study) -> list[str]:
    """Return a sentence on each channel that moves far more, or far less, than in a replay."""
    readings = measured(study)
    predicted = replay(build(compile_system(study), []), study, readings).prediction
    found = []
    for e, episode in enumerate(study.episodes):
        if not np.isfinite(predicted[readings.episode == e]).all():
            found.append(
                f"the model's own replay of {episode.name} diverges; check its initial state, "
                "its commands and its time step"
            )
    if found:
        return found
    for c, channel in enumerate(study.channels):
        at = readings.channel == c
        moved = _spread(readings.value[at], readings.episode[at])
        expected = _spread(predicted[at], readings.episode[at])
        if min(moved, expected) <= 0.0 or max(moved, expected) < 5.0 * readings.noise[at][0]:
            continue
        if not 1.0 / FAR < moved / expected < FAR:
            found.append(
                f"{channel.name} moves by {moved:.2g} {channel.unit}, but by {expected:.2g} in "
                "the model's replay: are its unit, its column and the commands right?"
            )
    return found


def _spread(values: Floats, episode: Floats) -> float:
    """Return the standard deviation about the mean of each episode."""
    parts = [values[episode == e] for e in np.unique(episode)]
    return float(np.std(np.concatenate([part - part.mean() for part in parts])))
