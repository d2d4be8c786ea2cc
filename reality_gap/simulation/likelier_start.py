"""Likelier start: whether a log begins in a motion or at rest.

A machine that starts from rest as its log begins may move sooner than its first readings follow,
which then show a velocity that it did not have. Replays of the nominal model decide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from reality_gap.study.data import Episode, ReadState, Study
from reality_gap.study.measurements import Measured
from reality_gap.types import Floats

Predict = Callable[[Study], Floats]
"""Returns the nominal prediction of a study, shape (n,)."""
UNSURE = 4.0
"""Mean square of the misfit from which on neither is right, as with a fault [noise^2]."""
SEEN = 1.0
"""Difference of both predictions from which on a reading tells which one is right [noise]."""


def with_likelier_start(study: Study, readings: Measured, predict: Predict) -> Study:
    """Return the study, whose joints begin as fast as their readings show, or all of them at rest.

    Args:
        study: as it was loaded.
        readings: its readings.
        predict: replays the nominal model.
    """
    if study.initial.settle or not any(s.speed for e in study.episodes for s in e.states.values()):
        return study
    resting = _changed(study, 0.0)
    moving, still = predict(study), predict(resting)
    decisive = np.abs(moving - still) > SEEN * readings.noise
    misfits = [
        float(np.sum(((readings.value - one) / readings.noise)[decisive] ** 2))
        for one in (moving, still)
    ]
    if misfits[0] > misfits[1]:
        return resting
    return _changed(study, 1.0) if misfits[0] > UNSURE * np.count_nonzero(decisive) else study


def _changed(study: Study, share: float) -> Study:
    """Return a study that begins with a share of the read velocities, which are uncertain."""

    def change(state: ReadState) -> ReadState:
        error = float(np.hypot(state.speed_error, state.speed))
        return state._replace(speed=share * state.speed, speed_error=error)

    def begun(episode: Episode) -> Episode:
        return replace(episode, states={joint: change(s) for joint, s in episode.states.items()})

    return replace(study, episodes=tuple(begun(episode) for episode in study.episodes))
