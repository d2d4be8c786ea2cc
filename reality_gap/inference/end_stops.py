"""End stops: whether something in the way of a joint explains more than a cause does.

A joint that runs into something at one end of its motion has no cause in the catalogue, and many
causes explain a part of it: a spring, a motor that gets weaker, a push. Such a cause is compared
with a stop in its place: a spring that acts on one side of a position only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from reality_gap.causes.base import (
    Location,
    Parameter,
    Record,
    SearchHints,
    Values,
    unlisted_cause,
)
from reality_gap.causes.support import typical_scales
from reality_gap.causes.support.joint_motors import motors_of
from reality_gap.causes.support.new_elements import add_tendon
from reality_gap.inference.gauss_newton import Fit, fit_stepwise, run_together
from reality_gap.inference.motion_functions import moving_joints
from reality_gap.inference.problem import Problem
from reality_gap.inference.settling import settle, variance_left
from reality_gap.simulation.hypothesis import Candidate, Part
from reality_gap.simulation.replayer import Replayer
from reality_gap.study.system import System
from reality_gap.types import Floats

POSITIONS = (0.6, 0.75, 0.85, 0.92, 0.97)
"""Positions of a stop that are tried, as shares of the motion of the model."""
STIFF = 40.0
"""Stiffness at which all stops are tried, over the typical force and travel of their joint."""
OTHERS = (2.0, 400.0)
"""Stiffness at which the best ones of them are tried, too."""
TRIED = 2
"""Number of stops that are fitted."""
FREE = 1e6
"""Position beyond all others [m or rad]."""
UPPER, LOWER = "upper end", "lower end"
"""Notes of the location of a stop."""
MORE = 5.0
"""Evidence by which a stop must be better than a cause to refute it [nats]."""
SHARE = 0.5
"""Share of the variance that a stop leaves at most where a model is wrong by many noises. One that
leaves more of it is not what is wrong there, however much it explains."""


_Tried = tuple[float, Floats, Part]
"""The sum of squares that a stop leaves, its residual, and the stop."""


class Stop(NamedTuple):
    """A stop that was fitted in the place of a cause.

    Attributes:
        cause: the cause; None for a stop that stands alone.
        description: which joint it stops, and where.
        gain: what it explains more than the cause does [nats].
    """

    cause: Candidate | None
    description: str
    gain: float

    @property
    def objection(self) -> str:
        """What is said of the cause, as the end of a sentence."""
        return f"explains less than {self.description} would; no cause stands for that"


def refuting_stop(problem: Problem, rest: Fit, best: Fit | None) -> Stop | None:
    """Return a stop that surely explains more than the last cause of a hypothesis, if there is one.

    Stops are tried in the joint of the cause, or in all joints if it is one of links or of several
    joints. Causes of tendons, sensors and cameras are not mistaken for a stop.

    Args:
        problem: what is to be explained, with a noise model without inflation.
        rest: the other causes.
        best: these and the last one; None for a stop that is compared with no cause.
    """
    replayer = problem.replayer
    records = replayer.replay(rest.hypothesis).records
    moving = moving_joints(problem.system, records)
    own = moving if best is None else _joints(problem.system, best.candidates[-1].location)
    stops = [
        stop for joint in moving if joint in own for stop in _stops(problem.system, records, joint)
    ]
    tried = _best(replayer, rest, stops)
    tried = _best(replayer, rest, [part for _, _, part in tried for part in _others(part)], tried)
    if not tried:
        return None
    inflated = problem.inflated(tried[0][1])
    starts = [[*rest.hypothesis, part] for _, _, part in tried]
    fits = run_together(replayer, [fit_stepwise(inflated, start) for start in starts])
    fits.sort(key=lambda one: -one.evidence)
    settled = settle(problem, [*fits, *([] if best is None else [best])], rest)
    evidence = {one.candidates[-1].cause is CAUSE: one for one in reversed(settled.tried)}
    found, other = evidence[True], evidence.get(False, settled.base)
    chosen = np.log(len(stops) / len(POSITIONS))
    gain = found.evidence - float(chosen) - other.evidence
    if settled.problem.noise_model.is_far:
        before, after = (variance_left(problem.widened(f.residual)) for f in (rest, found))
        if after > SHARE * before:
            return None
    cause = None if best is None else best.candidates[-1]
    return Stop(cause, _description(found), gain) if gain > MORE else None


def _best(
    replayer: Replayer, rest: Fit, stops: Sequence[Part], others: Sequence[_Tried] = ()
) -> list[_Tried]:
    """Return the stops that leave least, among others that were tried before.

    Args:
        replayer: replays hypotheses.
        rest: the other causes.
        stops: the stops.
        others: stops that were tried before.
    """
    residuals = replayer.residuals([[*rest.hypothesis, part] for part in stops])
    tried = [(float(np.sum(r**2)), r, part) for r, part in zip(residuals, stops, strict=True)]
    found = [one for one in (*others, *tried) if np.isfinite(one[0])]
    return sorted(found, key=lambda one: one[0])[:TRIED]


def _others(stop: Part) -> list[Part]:
    """Return a stop with the other values of its stiffness."""
    candidate, values = stop
    return [
        (candidate, {**values, "stiffness": values["stiffness"] * factor / STIFF})
        for factor in OTHERS
    ]


def _joints(system: System, location: Location) -> Sequence[str]:
    """Return the joints in which a stop may be mistaken for a cause at a location."""
    if location.kind == "joint" and len(location.elements) == 1:
        return location.elements
    if location.kind == "actuator":
        return [n for n in system.joints if set(motors_of(system, n)) & set(location.elements)]
    return system.joints if location.kind in ("joint", "body", "model") else ()


def _description(fitted: Fit) -> str:
    """Return where the stop of a fit is, in words."""
    stop, values = fitted.hypothesis[-1]
    where = f"{values['position']:.3g} {stop.parameter('position').unit}"
    [joint], end = stop.location.elements, stop.location.note
    return f"an end stop of {joint} at {where}, at the {end} of its motion,"


def _stops(system: System, records: Sequence[Record], joint: str) -> list[Part]:
    """Return stops of a joint at both ends of its motion, each with values to start from."""
    column = records[0].model.joint(joint).qposadr[0]
    motion = np.concatenate([record.qpos[:, column] for record in records])
    low, high = float(motion.min()), float(motion.max())
    own = Location("joint", (joint,))
    unit, travel = typical_scales.joint_travel(system, own)
    force, size = typical_scales.joint_force(system, own)
    stiff = size / travel
    stiffness = Parameter("stiffness", f"{force}/{unit}", stiff, 0.0, 0.0, 1e4 * stiff)
    found: list[Part] = []
    for note, first, last in ((UPPER, low, high), (LOWER, high, low)):
        starts = tuple(first + share * (last - first) for share in POSITIONS)
        hints = SearchHints(starts)
        position = Parameter("position", unit, 0.05 * travel, 0.0, low, high, starts[0], hints)
        stop = Candidate(CAUSE, replace(own, note=note), (stiffness, position))
        found += [(stop, {"stiffness": STIFF * stiff, "position": at}) for at in starts]
    return found


def _add_spring(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    """Add a spring that acts beyond a position of a joint only."""
    [name] = location.elements
    position = values["position"]
    free = (-FREE, position) if location.note == UPPER else (position, FREE)
    tendon = add_tendon(
        spec,
        name=f"end stop of {name}, {location.note}",
        stiffness=np.array([values["stiffness"], 0.0, 0.0]),
        springlength=np.array(free),
    )
    tendon.wrap_joint(name, 1.0)


CAUSE = unlisted_cause("end_stop", _add_spring)
"""A stop of a joint; the note of its location is the end."""
