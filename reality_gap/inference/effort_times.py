"""Effort times: to which part of a sample the time stamp of an effort belongs.

A torque that is commanded acts until the next sample, and one that is averaged is that of the
sample before. Compared with the motion, such an effort is early or late by half a sample, which is
no fault of the machine and cannot be distinguished from a delay of this length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reality_gap.causes.delay import CAUSE, EFFORTS
from reality_gap.diagnosis import Diagnosis
from reality_gap.log_findings import Estimate
from reality_gap.simulation.measured_motion import period_of
from reality_gap.simulation.prepared_episode import PreparedEpisode
from reality_gap.study.data import Study


def half_sample_late(study: Study, diagnosis: Diagnosis) -> float:
    """Return half a sample if efforts are late by that [s], negative if early, or else 0.

    Args:
        study: the study; one that is prepared has no samples of its own any more.
        diagnosis: its diagnosis, which may name a delay of all efforts.
    """
    delay = _delay_of_efforts(diagnosis)
    if delay is None or any(isinstance(episode, PreparedEpisode) for episode in study.episodes):
        return 0.0
    half = 0.5 * _period(study) * float(np.sign(delay.value))
    return half if delay.low <= half <= delay.high else 0.0


def with_efforts_earlier(study: Study, late: float) -> Study:
    """Return a study whose efforts have time stamps that are earlier.

    Args:
        study: a study with efforts that is not prepared.
        late: by how much they are late [s].
    """
    efforts = _efforts(study)
    episodes = []
    for episode in study.episodes:
        readings = list(episode.readings)
        for c in efforts:
            readings[c] = replace(readings[c], time=readings[c].time - late)
        episodes.append(replace(episode, readings=tuple(readings)))
    return replace(study, episodes=tuple(episodes))


def diagnosis_of_earlier(again: Diagnosis, late: float) -> Diagnosis:
    """Return a diagnosis of a study `with_efforts_earlier`, which says that they are."""
    when = "late" if late > 0.0 else "early"
    which = "are averaged over the sample before" if late > 0.0 else "act until the next sample"
    sentence = (
        f"{again.sentence} The efforts are {when} by half a sample, {1e3 * abs(late):.3g} ms, as "
        f"those are that {which}; a delay of this length cannot be distinguished from it."
    )
    return replace(again, sentence=sentence, measures={**again.measures, "efforts_late": late})


def _delay_of_efforts(diagnosis: Diagnosis) -> Estimate | None:
    """Return the delay of all efforts after the positions, if it is a named cause."""
    for cause in diagnosis.causes:
        if cause.candidate.cause.id == CAUSE.id and cause.candidate.location.note == EFFORTS:
            return cause.parameters["delay"]
    return None


def _efforts(study: Study) -> Sequence[int]:
    return [c for c, channel in enumerate(study.channels) if channel.kind == "effort"]


def _period(study: Study) -> float:
    """Return the usual time between two efforts [s]."""
    return max(period_of(e.readings[c]) for e in study.episodes for c in _efforts(study))
