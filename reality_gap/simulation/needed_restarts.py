"""Needed restarts: how often replays begin again where a motion amplifies errors of its state.

What errors of initial states do to the readings is marginalised as far as it is linear. Where a
motion amplifies them until it is not, replays begin again from the readings; see
`reality_gap.study.restarts`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from reality_gap.study.data import ReadState, Study
from reality_gap.study.measurements import Measured, channel_noise
from reality_gap.study.restarts import (
    part_of_readings,
    position_channels,
    with_restarts,
    with_states,
)
from reality_gap.types import Floats

Predict = Callable[[Study], Floats]
"""Returns the nominal prediction of a study, shape (n,)."""
EVERY = (0.1, 0.25, 0.5, 0.75, 1.25, 2.25, 4.25)
"""Times between two restarts that are tried [s]."""
MUCH, LITTLE = 10.0, 3.0
"""Amplification of errors of positions over a log from which on replays begin again, and between
two restarts. It is about 1 where controllers, dry friction or damping hold a motion, and thousands
where a pendulum turns over. Where it is 4, causes are hardly linear: a friction of 0.1 N m in a
pendulum of 0.7 kg was not found, and left 430 noises for errors of the states to explain."""


def with_needed_restarts(study: Study, readings: Measured, predict: Predict) -> Study:
    """Return the study with as few restarts as it needs, unless it has some or states how many.

    Args:
        study: as it was loaded.
        readings: its readings.
        predict: replays the nominal model.
    """
    initial = study.initial
    if initial.restart is not None or initial.settle or study.restart:
        return study
    if not any(episode.states for episode in study.episodes):
        return study
    model = study.spec().compile()
    channels = position_channels(study, model)
    if _amplification(study, channels, readings, predict) <= MUCH:
        return study
    chosen = study
    for every in EVERY:
        longer = with_restarts(study, model, every)
        if every > EVERY[0] and _amplification(longer, channels, readings, predict) > LITTLE:
            break
        chosen = longer
    return chosen


def _amplification(
    study: Study, channels: Mapping[str, int], readings: Measured, predict: Predict
) -> float:
    """Return the RMS of the effect of errors of positions on positions, over that of the errors.

    It is that of the part between two restarts in which it is largest, and infinite where a replay
    diverges.
    """
    noise = channel_noise(study)
    errors = [
        [state.position_error / noise[channels[joint]] for joint, state in states.items()]
        for states in study.states
    ]
    change = (predict(with_states(study, _displaced)) - predict(study)) / readings.noise
    parts, position = (
        part_of_readings(study, readings),
        np.isin(readings.channel, [*channels.values()]),
    )
    found = [
        np.mean(change[position & (parts == part)] ** 2) / max(np.mean(np.square(own)), 1e-12)
        for part, own in enumerate(errors)
        if own and np.any(position & (parts == part))
    ]
    largest = float(np.sqrt(max(found, default=0.0)))
    return largest if np.isfinite(largest) else np.inf


def _displaced(state: ReadState, within: bool) -> ReadState:
    return state._replace(position=state.position + state.position_error)
