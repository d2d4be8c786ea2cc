"""Channels that contradict the nominal model: wrong signs, units and columns, absurd residuals."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.simulation.column_errors import column_errors
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Study
from reality_gap.study.measurements import Measured
from reality_gap.types import Floats

FAR = 20.0
"""Ratio of a channel's spread to that of its replay, or inverse, that no fault can cause."""
ABSURD = 3000.0
"""RMS of a channel's residual that no fault causes, but a noise that is stated wrongly [noise]."""
EDGE = 0.05
"""Share of an actuator's range by which a median may lie outside, due to noise and offsets."""


def implausible_channels(study: Study) -> list[str]:
    """Return a sentence on each channel that is far from a replay of the nominal model."""
    found = _wrong_signs(study)
    with Replayer(study) as replayer:
        readings, prediction = replayer.measured, replayer.replay([]).prediction
        prepared = replayer.system.study
    if not np.isfinite(prediction).all():
        return [*found, *_diverged(prepared, readings, prediction)]
    errors = column_errors(prepared, readings, prediction)
    found += [error.sentence for error in errors]
    wrong = {error.channel for error in errors}
    if not study.inverse:
        found += _wrong_spreads(prepared, readings, prediction, wrong)
    return [*found, *_absurd_residuals(prepared, readings, prediction, wrong)]


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


def _diverged(study: Study, readings: Measured, predicted: Floats) -> list[str]:
    """Return a sentence on each episode whose replay diverged."""
    return [
        f"the model's own replay of {episode.name} diverges; check its initial state, its commands "
        "and its time step"
        for e, episode in enumerate(study.episodes)
        if not np.isfinite(predicted[readings.episode == e]).all()
    ]


def _absurd_residuals(
    study: Study, readings: Measured, predicted: Floats, known: set[int]
) -> list[str]:
    """Return a sentence on each channel whose residual is far above all that its noise allows."""
    found = []
    for c, channel in enumerate(study.channels):
        at = readings.channel == c
        residual = (readings.value[at] - predicted[at]) / readings.noise[at]
        size = float(np.sqrt(np.mean(residual**2))) if at.any() else 0.0
        if size > ABSURD and c not in known:
            found.append(
                f"{channel.name} differs from the model's replay by {size:.2g} times the noise "
                f"used here (at least {readings.noise[at].min():.2g} {channel.unit}); in most "
                f"machines gaps are below {ABSURD:g} times the noise: if that is not the true "
                "noise, state it (noise: ...)"
            )
    return found


def _wrong_spreads(
    study: Study, readings: Measured, predicted: Floats, known: set[int]
) -> list[str]:
    """Return a sentence on each channel that moves far more, or far less, than in a replay."""
    found = []
    for c, channel in enumerate(study.channels):
        if c in known:
            continue
        at = readings.channel == c
        moved = _spread(readings.value[at], readings.episode[at])
        expected = _spread(predicted[at], readings.episode[at])
        if min(moved, expected) <= 0.0 or max(moved, expected) < 5.0 * readings.noise[at].min():
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
