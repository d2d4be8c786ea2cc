"""A push from outside on the last body of a limb, for a while.

The force is constant in the world frame, acts on the body's centre of mass, and comes and goes
over about 0.1 s. The time counts over all episodes laid end to end.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from reality_gap.cause import Cause, Effects, Parameter, Place, Values
from reality_gap.causes import links, sizes
from reality_gap.system import System

EDGE = 0.025
"""Time constant of a push's begin and end [s]."""

STARTS = 24
"""At most as many begins to start a fit from, else one a second."""


def _places(system: System) -> tuple[Place, ...]:
    found = (links.link(system, root).heaviest for root in links.ends(system))
    return tuple(Place("body", (name,)) for name in found if name)


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    total = sizes.study_duration(system)
    count = min(STARTS, max(1, round(total)))
    starts = tuple(total * (i + 0.25) / count for i in range(count))
    while_ = max(0.5, 0.75 * total / count)
    return (
        *(Parameter(axis, "N", 5.0, 0.0, -200.0, 200.0) for axis in ("x", "y", "z")),
        Parameter("start", "s", 0.2, 0.0, 0.0, total, null=starts[0], starts=starts),
        Parameter("duration", "s", 0.2, 0.0, 0.05, total, null=while_, starts=(while_,)),
    )


def _attach(effects: Effects, system: System, place: Place, values: Values) -> None:
    force = np.array([values["x"], values["y"], values["z"]])
    if not force.any():
        return
    begin, end = values["start"], values["start"] + values["duration"]
    body = system.model.body(place.elements[0]).name

    def push(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        rise = math.tanh((data.time - begin) / EDGE) - math.tanh((data.time - end) / EDGE)
        data.xfrc_applied[model.body(body).id, :3] += 0.5 * rise * force

    effects.act(lambda model: push, begin - 15 * EDGE, end + 15 * EDGE)


CAUSE = Cause(
    id="external_force",
    title="force from outside",
    explanation="Something pushes or pulls a limb for a while.",
    places=_places,
    parameters=_parameters,
    attach=_attach,
)
