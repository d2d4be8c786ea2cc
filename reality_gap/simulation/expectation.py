"""What the study's own model says of a log: forces with the wrong sign, motion far off."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.simulation.hypothesis import build
from reality_gap.simulation.replay import replay
from reality_gap.study.data import Study
from reality_gap.study.measurements import measured
from reality_gap.study.system import look_at
from reality_gap.types import Floats

FAR = 20.0
"""A channel that moves so many times more, or less, than the replay makes no fault of a machine."""
EDGE = 0.05
"""Share of an actuator's range by which a median may lie outside: noise and offsets."""


def surprises(study: Study) -> list[str]:
    """Sentences on channels that a replay of the model does not come near."""
    return [*_signs(study), *([] if study.inverse else _spreads(study))]


def _signs(study: Study) -> list[str]:
    """Forces that the model's actuators cannot give, but would if they were turned."""
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
        range_ = f"the model's actuator gives {low:.3g} to {high:.3g}"
        text = f"{channel.name} is {middle:.3g} {channel.unit} at its median, but {range_}"
        turned = low <= -middle <= high
        found.append(text + (": has it the wrong sign (scale: -1)?" if turned else ""))
    return found


def _spreads(study: Study) -> list[str]:
    """Channels that move far more, or far less, than in a replay of the model."""
    readings = measured(study)
    predicted = replay(build(look_at(study), []), study, readings).prediction
    found = []
    for e, episode in enumerate(study.episodes):
        if not np.isfinite(predicted[readings.episode == e]).all():
            found.append(
                f"the model's own replay of {episode.name} diverges; look at its initial state, "
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
                f"{channel.name} moves by {moved:.2g} {channel.unit}, in the model's replay by "
                f"{expected:.2g}: are its unit, its column and the commands right?"
            )
    return found


def _spread(values: Floats, episode: Floats) -> float:
    """Standard deviation about the mean of each episode."""
    parts = [values[episode == e] for e in np.unique(episode)]
    return float(np.std(np.concatenate([part - part.mean() for part in parts])))
