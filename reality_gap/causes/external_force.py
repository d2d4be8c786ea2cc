"""External force: something outside pushes the last body of a limb for some time.

The force is constant in the world frame, acts at the body's centre of mass, and rises and falls
within about 0.1 s. It acts either once, at a time in the study, in which an episode begins where
the previous one ended; or in each episode at the same time after its begin, for example where the
machine touches an object in its way.
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
ODDS = -4.0
"""Log odds of an external force [nats]: it explains a little of anything for some time."""
EACH = "in each episode"
"""Note of a location where the force acts in each episode."""


def _locations(system: System) -> tuple[Location, ...]:
    found = [links.link(system, root).heaviest for root in links.end_links(system)]
    notes = ("", EACH) if len(system.study.episodes) > 1 else ("",)
    return tuple(Location("body", (name,), note) for name in found if name for note in notes)


def _durations(system: System, location: Location) -> list[float]:
    """Return the durations of the periods in each of which the force acts once [s]."""
    if location.note == EACH:
        return [episode.duration for episode in system.study.episodes]
    return [system.study.duration]


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    total = max(_durations(system, location))
    count = min(STARTS, max(1, round(2 * total)))
    starts = tuple(total * (i + 0.25) / count for i in range(count))
    duration = max(0.4, 0.75 * total / count)
    size = typical_scales.end_force(system, location.elements[0])
    return (
        *(Parameter(axis, "N", 0.15 * size, 0.0, -6 * size, 6 * size) for axis in ("x", "y", "z")),
        Parameter("start", "s", 0.2, 0.0, 0.0, total, null=starts[0], hints=SearchHints(starts)),
        Parameter(
            "duration", "s", 0.2, 0.0, 0.05, total, null=duration, hints=SearchHints((duration,))
        ),
    )


def _prior(location: Location) -> float:
    return ODDS


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    force = np.array([values["x"], values["y"], values["z"]])
    if not force.any():
        return
    body, origin = system.model.body(location.elements[0]).name, 0.0
    for duration in _durations(system, location):
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
        begin, end: time in the study [s].
    """

    body: str
    force: Floats
    begin: float
    end: float

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        data.xfrc_applied[:] += self.wrenches(model, np.array([data.time]))[0]

    def wrenches(self, model: mujoco.MjModel, time: Floats) -> Floats:
        """Return the wrenches on all bodies, shape (k, nbody, 6) [N, N m], at times (k,) [s]."""
        since, left = (time - self.begin) / EDGE, (time - self.end) / EDGE
        share = 0.5 * (np.tanh(since) - np.tanh(left))
        found = np.zeros((len(time), model.nbody, 6))
        found[:, model.body(self.body).id, :3] = share[:, None] * self.force
        return found


CAUSE = Cause(
    id="external_force",
    title="external force",
    explanation="Something outside the machine pushes or pulls a limb for some time.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
    event=True,
    prior=_prior,
)
