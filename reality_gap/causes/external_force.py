"""External force: something outside pushes the last body of a limb for some time.

The force is constant in the world frame, acts at the body's centre of mass, and rises and falls
within about 0.1 s. It acts either once, at a time in the study, in which an episode begins where
the previous one ended; or in each episode at the same time after its begin, for example where the
machine touches an object in its way.

It may also repeat with a period, as when something strikes the machine at each turn: from
its start until the end of the study, or of each episode, if it begins again in each. Fewer than
`REPEATS` pushes are no train. The start is negative if a push had begun before the log.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import links, typical_scales
from reality_gap.study.system import System
from reality_gap.types import Floats

EDGE = 0.025
"""Time constant of the rise and the fall of the force [s]."""
STARTS = 48
"""Largest number of onsets from which fits start; there are two per second up to this number."""
ODDS = -5.7
"""Log odds of an external force [nats]: it explains a little of anything for some time, and about
six durations are tried with each start."""
EACH = "in each episode"
"""Note of a location where the force acts in each episode."""
REGULAR = "at regular intervals"
"""Beginning of the note of a location where the force acts again and again."""
REGULAR_EACH = f"{REGULAR} {EACH}"
"""Note of a location where a train of pushes begins in each episode."""
REPEATS = 3
"""Number of periods that a study has at least."""
SHORTEST = 0.25
"""Shortest period [s]; pushes have edges of 0.1 s."""
PERIODS = 500
"""Largest number of periods from which fits start; they resolve a quarter of a turn in the log."""
PHASES = 4
"""Number of starts within a period from which fits start."""


def _locations(system: System) -> tuple[Location, ...]:
    found = [links.link(system, root).heaviest for root in links.end_links(system)]
    several = len(system.study.episodes) > 1
    notes = ("", EACH, REGULAR, REGULAR_EACH) if several else ("", REGULAR)
    return tuple(
        Location("body", (name,), note)
        for name in found
        if name
        for note in notes
        if not _repeats(note) or max(_durations(system, note)) >= 2 * REPEATS * SHORTEST
    )


def _repeats(note: str) -> bool:
    """Return whether the force of a location with this note acts again and again."""
    return note.startswith(REGULAR)


def _durations(system: System, note: str) -> list[float]:
    """Return the durations of the parts of a study at whose starts the time of a push is 0 [s]."""
    if note.endswith(EACH):
        return [episode.duration for episode in system.study.episodes]
    return [system.study.duration]


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    total = max(_durations(system, location.note))
    if _repeats(location.note):
        return (*_force(system, location), *_times_of_train(total, location.note))
    count = min(STARTS, max(1, round(2 * total)))
    starts = tuple(total * (i + 0.25) / count for i in range(count))
    duration = total / count  # one push begins where another ends, so that they add up to long ones
    return (
        *_force(system, location),
        Parameter("start", "s", 0.2, 0.0, 0.0, total, null=starts[0], hints=SearchHints(starts)),
        Parameter(
            "duration", "s", 0.2, 0.0, 0.05, total, null=duration, hints=SearchHints((duration,))
        ),
    )


def _force(system: System, location: Location) -> tuple[Parameter, ...]:
    size = typical_scales.end_force(system, location.elements[0])
    return tuple(Parameter(axis, "N", 0.15 * size, 0.0, -6 * size, 6 * size) for axis in "xyz")


def _times_of_train(total: float, note: str) -> tuple[Parameter, ...]:
    """Return the times of a train of pushes in a study or an episode of a duration [s].

    One scale of the period moves the last push of a train of one a second by that of the start.
    """
    periods, longest = periods_of(total), total / REPEATS
    phases = SearchHints(tuple(longest * i / PHASES for i in range(PHASES)))
    length = longest / PHASES
    hints = SearchHints(periods, period="episode" if note.endswith(EACH) else "study")
    return (
        Parameter("start", "s", 0.2, 0.0, -longest, longest, hints=phases),
        Parameter(
            "duration", "s", 0.2, 0.0, 0.05, longest, null=length, hints=SearchHints((length,))
        ),
        Parameter("period", "s", 0.2 / total, 0.0, SHORTEST, longest, null=SHORTEST, hints=hints),
    )


def periods_of(total: float) -> tuple[float, ...]:
    """Return the periods of trains in a duration from which fits start, from long to short [s].

    Their rates lie at even distances, at which the last of all pushes moves by a quarter period.
    """
    first, step = REPEATS / total, 0.25 / total
    count = min(PERIODS, int((1.0 / SHORTEST - first) / step) + 1)
    return tuple(1.0 / (first + i * step) for i in range(count))


def _prior(location: Location) -> float:
    return ODDS


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    force = np.array([values["x"], values["y"], values["z"]])
    if not force.any():
        return
    body, origin = system.model.body(location.elements[0]).name, 0.0
    if _repeats(location.note):
        for episode in system.study.episodes:
            first = values["start"] + (origin if location.note.endswith(EACH) else 0.0)
            length = min(values["duration"], values["period"])
            train = _Push(body, force, first, first + length, values["period"])
            end = origin + episode.duration
            effects.add_hook(partial(_same_hook, train), origin, end, wrenches=train.wrenches)
            origin = end
        return
    for duration in _durations(system, location.note):
        begin = origin + values["start"]
        end = begin + values["duration"]
        hook = _Push(body, force, begin, end)
        first, last = begin - 15 * EDGE, end + 15 * EDGE
        if location.note == EACH:
            first, last = max(first, origin), min(last, origin + duration)
        effects.add_hook(partial(_same_hook, hook), first, last, wrenches=hook.wrenches)
        origin += duration


def _same_hook(push: _Push, model: mujoco.MjModel) -> _Push:
    """Return ``push``: it has no state, so that all episodes can share it."""
    return push


@dataclass(frozen=True)
class _Push:
    """Hook that applies a force to a body for some time.

    Attributes:
        body: name of the body.
        force: force in the world frame, shape (3,) [N].
        begin, end: time of the first push in the study [s].
        period: time from each push to the next [s]; 0 if there is one.
    """

    body: str
    force: Floats
    begin: float
    end: float
    period: float = 0.0

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.xfrc_applied[:] += self.wrenches(model, np.array([data.time]))[0]

    def wrenches(self, model: mujoco.MjModel, time: Floats) -> Floats:
        """Return the wrenches on all bodies, shape (k, nbody, 6) [N, N m], at times (k,) [s]."""
        share = self._share(time)
        found = np.zeros((len(time), model.nbody, 6))
        found[:, model.body(self.body).id, :3] = share[:, None] * self.force
        return found

    def _share(self, time: Floats) -> Floats:
        """Return the share of the force at times (k,) [s]."""
        if not self.period:
            return self._pulse(time)
        # Edges are so short that the pushes beside the nearest one are enough.
        middle = 0.5 * (self.begin + self.end)
        nearest = np.round((time - middle) / self.period)
        return np.sum(
            [
                np.where(k >= 0.0, self._pulse(time - k * self.period), 0.0)
                for k in (nearest - 1.0, nearest, nearest + 1.0)
            ],
            axis=0,
        )

    def _pulse(self, time: Floats) -> Floats:
        """Return the share of the force of the first push at times (k,) [s]."""
        since, left = (time - self.begin) / EDGE, (time - self.end) / EDGE
        return np.asarray(0.5 * (np.tanh(since) - np.tanh(left)))


CAUSE = Cause(
    id="external_force",
    title="external force",
    explanation="Something outside the machine pushes or pulls a limb, once or repeatedly.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
    event=True,
    prior=_prior,
)
