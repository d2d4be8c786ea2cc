"""Restarts: moments within a log at which replays begin again, as the readings show the state.

Where a motion amplifies errors of its state, as that of a pendulum that turns over does, no model
predicts a whole log from its begin: the smallest error decides where it ends. Replays of short
parts from read states explain the same readings. This is multiple shooting (Bock and Plitt, A
multiple shooting algorithm for direct solution of optimal control problems, IFAC 1984), with states
that are read, and have errors, in place of continuity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import mujoco
import numpy as np
from scipy.stats import chi2

from reality_gap.study.data import Episode, ReadState, Restart, Study
from reality_gap.study.first_readings import SHARE, rate_and_speed
from reality_gap.study.measurements import Measured, channel_noise
from reality_gap.types import Floats, Ints

DEGREE = 5
"""Degree of the polynomial through the readings around a restart."""
FEWEST, MOST = 10, 400
"""Smallest and largest number of readings around a restart that are used."""
GRID = 2
"""Restarts are at multiples of so many time steps, at which coarser replays begin a step, too."""
INEXACT = 2.0
"""Errors of a state over those by noise, because no motion is exactly a polynomial."""
FITS = 0.5
"""Probability up to which the squares that a polynomial leaves are those of the noise. A worse one
may be by chance, too, but fewer readings are then little loss."""
NEAR = 3.0
"""Time from a restart to the nearest reading, over the usual time between two, up to which a joint
begins again; in a gap of its readings it goes on as it was."""
LESS = 0.7
"""Share of the readings that are used next where a polynomial does not fit them."""


def position_channels(study: Study, model: mujoco.MjModel) -> dict[str, int]:
    """Return the channel of the position of each joint that is measured."""
    jointpos = int(mujoco.mjtSensor.mjSENS_JOINTPOS)
    return {
        model.joint(int(model.sensor(channel.sensor).objid[0])).name: i
        for i, channel in enumerate(study.channels)
        if channel.kind == "sensor" and int(model.sensor(channel.sensor).type[0]) == jointpos
    }


def with_restarts(study: Study, model: mujoco.MjModel, every: float) -> Study:
    """Return a study whose replays begin again and again.

    Joints begin again whose positions are measured. All parts of an episode are equally long but
    for a few steps, because they begin with a step of replays.

    Args:
        study: as it was loaded; earlier restarts are replaced.
        model: the study's model, compiled.
        every: longest time between two begins, but for a few steps; 0 for no restarts [s].
    """
    noise, channels, step = (
        channel_noise(study),
        position_channels(study, model),
        GRID * model.opt.timestep,
    )

    def restarted(episode: Episode) -> Episode:
        count = int(np.ceil(episode.duration / every - 1e-6)) if every else 1
        even = np.linspace(0.0, episode.duration, count + 1)[1:-1]
        times = [float(t) for t in step * np.round(even / step)]
        readings = {
            joint: (episode.readings[c].time, episode.readings[c].value, float(noise[c]))
            for joint, c in channels.items()
            if len(episode.readings[c].time) >= FEWEST and noise[c] > 0.0
        }
        restarts = [
            Restart(
                time,
                {
                    joint: state_within(t - time, values, error)
                    for joint, (t, values, error) in readings.items()
                    if np.abs(t - time).min() <= NEAR * np.median(np.diff(t))
                },
            )
            for time in times
        ]
        return replace(episode, restarts=tuple(restarts) if readings else ())

    return replace(study, episodes=tuple(restarted(episode) for episode in study.episodes))


def with_states(
    study: Study, change: Callable[[ReadState, bool], ReadState], only: str | None = None
) -> Study:
    """Return a study whose replays begin, and begin again, in other states.

    Args:
        study: the study.
        change: returns the state of a joint by its state, and by whether this is a restart.
        only: name of the joint that has another state; all by default.
    """

    def changed(states: Mapping[str, ReadState], within: bool) -> dict[str, ReadState]:
        chosen = states if only is None else {only} & states.keys()
        return {**states, **{joint: change(states[joint], within) for joint in chosen}}

    episodes = tuple(
        replace(
            episode,
            states=changed(episode.states, False),
            restarts=tuple(Restart(t, changed(states, True)) for t, states in episode.restarts),
        )
        for episode in study.episodes
    )
    return replace(study, episodes=episodes)


def part_of_readings(study: Study, measured: Measured) -> Ints:
    """Return the index of the states (see `Study.states`) before each reading, shape (n,)."""
    found, first = np.zeros(len(measured.time), dtype=np.int64), 0
    for e, episode in enumerate(study.episodes):
        own, times = measured.episode == e, [restart.time for restart in episode.restarts]
        found[own] = first + np.searchsorted(times, measured.time[own], side="right")
        first += 1 + len(times)
    return found


def state_within(time: Floats, value: Floats, noise: float) -> ReadState:
    """Return the state of a joint at the time 0 of a log that began before.

    Args:
        time: of at least `FEWEST` readings of its position, shape (k,) [s].
        value: its positions, shape (k,) [rad or m].
        noise: standard deviation of one reading [rad or m].
    """
    rate, _ = rate_and_speed(time, value, noise)
    nearest = np.argsort(np.abs(time), kind="stable")
    within = int(np.sum(np.abs(time) * rate <= SHARE)) if rate else MOST
    count = min(max(within, FEWEST), MOST, len(value))
    while True:
        rows = nearest[:count]
        state, misfit = _polynomial(time[rows], value[rows], noise)
        if misfit < chi2.ppf(FITS, count - DEGREE - 1) or count == FEWEST:
            return state
        count = max(int(LESS * count), FEWEST)


def _polynomial(time: Floats, value: Floats, noise: float) -> tuple[ReadState, float]:
    """Return the state at the time 0 by a polynomial through readings (k,), and its misfit."""
    span = float(np.abs(time).max())
    columns = np.vander(time / span, DEGREE + 1, increasing=True) / noise
    inverse = np.linalg.inv(columns.T @ columns)
    solution = inverse @ columns.T @ (value / noise)
    errors = np.sqrt(np.diag(inverse))
    misfit = float(np.sum((value / noise - columns @ solution) ** 2))
    position, speed = float(solution[0]), float(solution[1] / span)
    own, rate = INEXACT * float(errors[0]), INEXACT * float(errors[1] / span)
    return ReadState(position, speed, own, rate), misfit
