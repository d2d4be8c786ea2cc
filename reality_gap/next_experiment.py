"""The next experiment: the feasible motion on which the remaining rivals part the most."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reality_gap.diagnosis import Experiment
from reality_gap.equivalence import Alternatives
from reality_gap.fitting import STEP, Fit, at
from reality_gap.measured import Measured, channel_noise, measured
from reality_gap.plant import build
from reality_gap.replay import replay
from reality_gap.study import Episode, Reading, Study
from reality_gap.system import System

Array = NDArray[np.float64]

SECONDS = 6.0
PERIOD = 0.02
RIVALS = 3


@dataclass(frozen=True)
class Motion:
    """A candidate: ``command`` (n, nu) every `PERIOD`, within what the study commanded."""

    title: str
    command: Array


def motions(study: Study, seed: int = 0) -> tuple[Motion, ...]:
    """Motions through commands that the study gave already, so that the machine can do them."""
    rng = np.random.default_rng(seed)
    rows = np.concatenate([episode.command for episode in study.episodes])
    spread = np.ptp(rows, axis=0)
    found = []
    for title, hold, travel in (
        ("slow sweeps", 0.0, 2.0),
        ("steps with rests", 0.7, 0.05),
        ("quick reversals", 0.0, 0.25),
        ("moves and rests", 0.4, 0.4),
    ):
        for tighter in (0.0, 0.15):
            points = _far_apart(rows, round(SECONDS / (hold + travel)) + 2, rng)
            command = _through(points, hold, travel)
            word = ", wires tighter" if tighter else ""
            low = rows.min(axis=0)
            found.append(Motion(title + word, np.maximum(command - tighter * spread, low)))
    return tuple(found)


def _far_apart(rows: Array, count: int, rng: np.random.Generator) -> Array:
    """Commands far from one another, in an order that makes every move long."""
    spread = np.ptp(rows, axis=0)
    scaled = rows / np.where(spread > 0, spread, 1.0)
    chosen = [int(rng.integers(len(rows)))]
    while len(chosen) < count:
        some = rng.integers(len(rows), size=40)
        gap = np.linalg.norm(scaled[some] - scaled[chosen[-1]], axis=1)
        chosen.append(int(some[np.argmax(gap)]))
    return rows[chosen]


def _through(points: Array, hold: float, travel: float) -> Array:
    """Smooth moves of ``travel`` s between points, ``hold`` s at each."""
    time = np.arange(0.0, SECONDS, PERIOD)
    index, phase = np.divmod(time, hold + travel)
    share = np.clip((phase - hold) / travel, 0.0, 1.0)
    share = share**3 * (10 - 15 * share + 6 * share**2)
    i = index.astype(int)
    return points[i] + share[:, None] * (points[i + 1] - points[i])


def next_experiment(system: System, rivals: Sequence[Alternatives]) -> Experiment | None:
    """The motion that best separates the two likeliest rivals of the least certain cause."""
    open_ = [a for a in rivals if len(a.tried) > 1]
    if not open_ or system.study.inverse:
        return None
    unsure = min(open_, key=lambda a: float(a.confidence.max()))
    order = np.argsort(-unsure.confidence)[:RIVALS]
    fits = [unsure.tried[i] for i in order]
    weights = unsure.confidence[order]
    before = _separation(system, system.study, measured(system.study), fits, weights)
    best: tuple[float, Motion] | None = None
    for motion in motions(system.study):
        trial = _as_study(system.study, motion)
        apart = _separation(system, trial, measured(trial), fits, weights)
        if best is None or apart > best[0]:
            best = (apart, motion)
    assert best is not None
    apart, motion = best
    one, two = (str(fits[i].suspects[-1]) for i in (0, 1))
    return Experiment(
        title=motion.title,
        sentence=f"Command {motion.title} for {SECONDS:.0f} s: it best tells {one} from {two}.",
        time=PERIOD * np.arange(len(motion.command), dtype=np.float64),
        command=motion.command,
        separation=apart,
        separation_before=before,
    )


def _as_study(study: Study, motion: Motion) -> Study:
    """The motion as an episode, read as often as the study's channels were."""
    time = PERIOD * np.arange(len(motion.command), dtype=np.float64)
    longest = max(study.episodes, key=lambda e: e.duration)
    readings = []
    for reading in longest.readings:
        period = float(np.median(np.diff(reading.time))) if len(reading.time) > 1 else SECONDS
        times = np.arange(0.0, time[-1], period)
        readings.append(Reading(times, np.zeros(len(times))))
    noise = [float(n) for n in channel_noise(study)]
    channels = tuple(replace(c, noise=n) for c, n in zip(study.channels, noise, strict=True))
    episode = Episode(motion.title, time, motion.command, tuple(readings), longest.joints)
    return replace(study, channels=channels, episodes=(episode,))


def _separation(
    system: System, study: Study, readings: Measured, fits: Sequence[Fit], weights: Array
) -> float:
    """Expected distance of the likeliest rival from the others, their parameters adapting."""
    first = _prediction(system, study, readings, fits[0])
    total, mass = 0.0, 0.0
    for fit, weight in zip(fits[1:], weights[1:], strict=True):
        gap = first - _prediction(system, study, readings, fit)
        slopes = _slopes(system, study, readings, fit)
        if not (np.all(np.isfinite(gap)) and np.all(np.isfinite(slopes))):
            return 0.0
        left = gap - slopes @ np.linalg.lstsq(slopes, gap, rcond=None)[0]
        total, mass = total + weight * float(np.linalg.norm(left)), mass + weight
    return total / max(mass, 1e-12)


def _prediction(system: System, study: Study, readings: Measured, fit: Fit) -> Array:
    found = replay(build(system, list(fit.hypothesis)), study, readings)
    return found.prediction / readings.noise


def _slopes(system: System, study: Study, readings: Measured, fit: Fit) -> Array:
    base = _prediction(system, study, readings, fit)
    columns = []
    for axis in np.eye(len(fit.theta)):
        moved = replace(fit, hypothesis=at(fit.hypothesis, fit.theta + STEP * axis))
        columns.append((_prediction(system, study, readings, moved) - base) / STEP)
    return np.column_stack(columns)
