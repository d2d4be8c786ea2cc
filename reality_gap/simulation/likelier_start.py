"""Likelier start: whether a log begins in a motion or at rest.

A machine that starts from rest as its log begins may move sooner than its first readings follow,
which then show a velocity that it did not have. Replays of the nominal model tell.
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
    resting = replace(study, episodes=tuple(_at_rest(episode) for episode in study.episodes))
    moving, still = predict(study), predict(resting)
    decisive = np.abs(moving - still) > SEEN * readings.noise
    misfits = [
        float(np.sum(((readings.value - one) / readings.noise)[decisive] ** 2))
        for one in (moving, still)
    ]
    return study if not misfits[0] > misfits[1] else resting


def _at_rest(episode: Episode) -> Episode:
    """Return an episode whose joints begin at rest, or as fast as they seem to."""

    def resting(state: ReadState) -> ReadState:
        error = float(np.hypot(state.speed_error, state.speed))
        return state._replace(speed=0.0, speed_error=error)

    return replace(episode, states={joint: resting(s) for joint, s in episode.states.items()})
