"""Replay warnings: a time step that is too coarse, and parts of the model that touch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from reality_gap.simulation.inverse_dynamics import ensure_prepared
from reality_gap.simulation.prepared_episode import prepared_episodes
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.data import Episode, Study
from reality_gap.types import Floats

SECONDS, EPISODES = 5.0, 3
"""How much of an episode is replayed [s], and of how many episodes."""
COARSE, UNKNOWN = 10.0, 0.3
"""RMS effect of the time step on a channel, of which a tenth is tolerated, and of what is uncertain
after extrapolation, from which on the step is too coarse [noise]."""
FINEST = 1e-4
"""Smallest time step that is advised [s]."""
SAMPLES = 100
"""Number of moments of an episode at which contacts are counted."""
OFTEN = 0.02
"""Share of these moments from which on a contact is reported."""
MOST = 3
"""Largest number of pairs that are reported."""


class _Touch(NamedTuple):
    """A pair of bodies that touch in a share of a motion, and what this means."""

    one: str
    other: str
    share: float
    reason: str

    def sentence(self, motion: str) -> str:
        """Return the sentence that says so of a motion."""
        pair, share = f"{self.one} and {self.other} of the model", 100.0 * self.share
        return f"{pair} touch in {share:.0f} % of {motion}; {self.reason}"


def replay_warnings(study: Study) -> list[str]:
    """Return sentences on the time step, restarts and contacts in replays of the nominal model.

    Of a study of efforts, those are said that touch in the measured motion.
    """
    if study.inverse:
        return _touches_of_measured_motion(study)
    with Replayer(_shortened(study)) as replayer:
        replay = replayer.replay([])
        if not np.isfinite(replay.prediction).all():
            return []
        motions = [record.qpos for record in replay.records]
        touches = _touches(replayer.system.model, motions)
        restarts = _restarts(replayer.system.study)
        return [*_coarse_step(replayer), *restarts, *map(_exclude, touches)]


def _restarts(study: Study) -> list[str]:
    """Return a sentence if replays need restarts that the study does not state."""
    if not study.restart or study.initial.restart is not None:
        return []
    return [
        "the motion amplifies errors of its state, so that no model predicts it for long: replays "
        f"begin again from the readings every {study.restart:.2g} s. 'restart:' under initial "
        "sets this time, and 0 replays each log from its begin only"
    ]


def _exclude(touch: _Touch) -> str:
    """Return the sentence on a pair that touches in a replay."""
    pair = f'<exclude body1="{touch.one}" body2="{touch.other}"/>'
    return f"{touch.sentence('its replay')}. If the machine does not touch there, add {pair}"


def _touches_of_measured_motion(study: Study) -> list[str]:
    """Return a sentence on each pair of bodies that touch where efforts were measured."""
    episodes = prepared_episodes(ensure_prepared(study))
    motions = [episode.motion.qpos[episode.motion.is_read] for episode in episodes]
    return [
        f"{touch.sentence('the measured motion')}. Positions do not show how firmly, and efforts "
        "are compared without the forces of contacts"
        for touch in _touches(study.spec().compile(), motions)
    ]


def _shortened(study: Study) -> Study:
    """Return the first seconds of the first episodes, or of all if the others have no readings."""
    episodes = tuple(_first_seconds(episode) for episode in study.episodes[:EPISODES])
    counts = zip(*([len(r.time) for r in episode.readings] for episode in episodes), strict=True)
    return replace(study, episodes=episodes) if all(map(any, counts)) else study


def _first_seconds(episode: Episode) -> Episode:
    rows = episode.time <= SECONDS
    readings = tuple(
        replace(r, time=r.time[r.time <= SECONDS], value=r.value[r.time <= SECONDS])
        for r in episode.readings
    )
    return replace(
        episode, time=episode.time[rows], command=episode.command[rows], readings=readings
    )


def _coarse_step(replayer: Replayer) -> list[str]:
    """Return a sentence if the time step changes a channel by more than its noise."""
    study, measured = replayer.system.study, replayer.measured
    found = replayer.model_error or replayer.step_error
    worst = (0.0, 0.0, "")
    for c, channel in enumerate(study.channels):
        at = measured.channel == c
        effect, error = (
            float(np.sqrt(np.mean((x[at] / measured.noise[at]) ** 2)))
            for x in (found.drift, found.last)
        )
        if effect > COARSE or error > UNKNOWN:
            worst = max(worst, (effect, error, channel.name))
    effect, error, name = worst
    step = float(study.spec().option.timestep)
    replayed = f"replays have {1e3 * step * replayer.step:.3g} ms"
    if not name:
        diverged = f"the model diverges with its time step of {1e3 * step:.3g} ms; {replayed}"
        return [] if replayer.model_error is None else [diverged]
    # The effect is of first order, and what extrapolation leaves is of second order.
    share = 0.5 * min(COARSE / max(effect, COARSE), np.sqrt(UNKNOWN / max(error, UNKNOWN)))
    finer = _rounded(step * share)
    advice = f", such as timestep={finer:g}" if finer >= FINEST else " or integrator=RK4"
    text = (
        f"the model's time step of {1e3 * step:.3g} ms changes {name} by {effect:.2g} times its "
        f"noise, and by {error:.2g} times after extrapolation to finer steps, so that smaller "
        f"errors of the model do not show; use a finer step{advice}"
    )
    if replayer.model_error is not None:
        text += f" ({replayed})"
    return [text]


def _rounded(step: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten up to a step."""
    power = 10.0 ** np.floor(np.log10(step))
    return float(max(x * power for x in (1.0, 2.0, 5.0) if x * power <= step * (1 + 1e-9)))


def _touches(model: mujoco.MjModel, motions: Sequence[Floats]) -> list[_Touch]:
    """Return the pairs of bodies that touch often, the most frequent first.

    Args:
        model: the model.
        motions: positions of the joints in each episode, shape (k, nq) each.
    """
    counts, moments, data = Counter[tuple[int, int]](), 0, mujoco.MjData(model)
    for qpos in motions:
        rows = np.unique(np.linspace(0, len(qpos) - 1, SAMPLES).astype(int))
        moments += len(rows)
        for row in rows:
            data.qpos[:] = qpos[row]
            counts.update(set(_touching(model, data)))
    return [
        _touch(model, pair, count / moments)
        for pair, count in counts.most_common(MOST)
        if count > OFTEN * moments
    ]


def _touching(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[tuple[int, int]]:
    """Yield pairs of bodies that touch in the posture of the data."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    for contact in data.contact:
        if contact.dist < 0.0 and min(contact.geom1, contact.geom2) >= 0:
            one, other = (int(model.geom_bodyid[g]) for g in (contact.geom1, contact.geom2))
            yield (one, other) if one < other else (other, one)


def _touch(model: mujoco.MjModel, pair: tuple[int, int], share: float) -> _Touch:
    one, other = (model.body(i).name or f"body {i}" for i in pair)
    if model.body_weldid[pair[0]] == 0:
        what = f"{one} is fixed to the world" if pair[0] else "this is the world"
        reason = f"{what}, with which MuJoCo lets every link collide, also the next one"
    else:
        reason = "both are links of the machine"
    return _Touch(one, other, share, reason)
