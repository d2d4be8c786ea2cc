"""First readings: in which state the joints are when a log begins.

A log may begin in the middle of a motion. The state of a joint is that of a cubic through its first
readings, whose jerk is as large as the motion of the whole log suggests.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from reality_gap.study.data import Episode, ReadState, Study
from reality_gap.study.measurements import channel_noise
from reality_gap.types import Floats

SHARE = 0.35
"""Time of the first readings that are used, over the time constant of the motion."""
FEWEST, MOST = 4, 200
"""Smallest and largest number of readings that are used."""
PERIOD = 0.02
"""Shortest time over which velocities are measured, to find the time constant [s]."""
JERK = 3.0
"""Standard deviation of the jerk at the begin, over that of a motion of one frequency."""
FITS = 0.999
"""Probability up to which the squares that a cubic leaves are those of the noise."""
RESTS = 3.0
"""Speed in standard deviations up to which a joint is taken to be at rest."""


def with_read_states(study: Study, joints: Mapping[str, str]) -> Study:
    """Return a study whose episodes begin in the states that their first readings show.

    Args:
        study: with at least one reading of each of these joints in each episode.
        joints: name of the joint by that of the sensor of its position.
    """
    noise = channel_noise(study)
    used = [
        (c, joints[channel.sensor])
        for c, channel in enumerate(study.channels)
        if channel.kind == "sensor" and channel.sensor in joints
    ]

    def begun(episode: Episode) -> Episode:
        states = {
            joint: read_state(episode.readings[c].time, episode.readings[c].value, float(noise[c]))
            for c, joint in used
            if joint not in episode.joints
        }
        read = {joint: state.position for joint, state in states.items()}
        return replace(episode, joints=read | dict(episode.joints), states=states)

    return replace(study, episodes=tuple(begun(episode) for episode in study.episodes))


def read_state(time: Floats, value: Floats, noise: float) -> ReadState:
    """Return the state of a joint at the time 0, or at its first reading if that is late.

    Args:
        time: of its readings, shape (k,) [s].
        value: its positions, shape (k,) [rad or m].
        noise: standard deviation of one reading [rad or m].
    """
    if len(value) < FEWEST or noise <= 0.0 or time[FEWEST - 1] <= time[0]:
        return ReadState(float(value[0]), 0.0, noise, 0.0)
    if time[0] > time[1] - time[0]:  # a cubic that is extrapolated so far shows nothing
        time = time - time[0]
    rate, speed = rate_and_speed(time, value, noise)
    within = int(np.sum((time - time[0]) * rate <= SHARE)) if rate else MOST
    count = min(max(within, FEWEST), MOST, len(value))
    while True:
        state, misfit = _cubic(time[:count], value[:count], noise, JERK * rate**2 * speed)
        if misfit < chi2.ppf(FITS, count) or count == FEWEST:
            return state
        count = max(count // 2, FEWEST)


def rate_and_speed(time: Floats, value: Floats, noise: float) -> tuple[float, float]:
    """Return velocity over position [1/s] and velocity, RMS, of a whole log; 0 for one at rest."""
    stride = max(1, round(PERIOD * (len(time) - 1) / (time[-1] - time[0])))
    steps, moved = np.diff(time[::stride]), np.diff(value[::stride])
    if not len(steps):
        return 0.0, 0.0
    square = float(np.mean((moved / steps) ** 2 - 2.0 * (noise / steps) ** 2))
    spread = float(np.var(value)) - noise**2
    if square <= 0.0 or spread <= 0.0:
        return 0.0, 0.0
    return float(np.sqrt(square / spread)), float(np.sqrt(square))


def _cubic(time: Floats, value: Floats, noise: float, jerk: float) -> tuple[ReadState, float]:
    """Fit a cubic to readings (k,) with a jerk of about ``jerk``; return its misfit, too."""
    span = float(time[-1] - time[0])
    columns = np.vander(time / span, 4, increasing=True) / noise
    prior = np.zeros((1, 4))
    prior[0, 3] = 1.0 / max(jerk * span**3 / 6.0, 1e-3 * noise)
    weighted = np.vstack([columns, prior])
    inverse = np.linalg.inv(weighted.T @ weighted)
    solution = inverse @ columns.T @ (value / noise)
    errors = np.sqrt(np.diag(inverse))
    misfit = float(np.sum((value / noise - columns @ solution) ** 2))
    speed, error = float(solution[1] / span), float(errors[1] / span)
    if abs(speed) <= RESTS * error:  # at rest, or hardly moving
        speed, error = 0.0, float(np.hypot(error, speed))
    return ReadState(float(solution[0]), speed, float(errors[0]), error), misfit
