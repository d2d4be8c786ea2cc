"""Backlash: a gap between an element and its encoder, modelled by the play operator.

For positions ``x_k`` and a gap ``g``, the encoder reads

    y_k = min(max(y_{k-1}, x_k - g/2), x_k + g/2),    y_0 = x_0 + b g/2

The position b within the gap at the start of a log is unknown, from -1 to 1. The hook that acts on
servos has the same: while the machine settles, the error is constant, so that hook and reading have
the same state. A servo may have another encoder than the one that is read, or the gap may be
between the joint and that one: then it is in the reading only.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import (
    Cause,
    Effects,
    Hook,
    Location,
    Parameter,
    Record,
    SearchHints,
    Values,
)
from reality_gap.causes.support import elements, encoders, typical_scales
from reality_gap.causes.support.encoders import READING, Feedback
from reality_gap.study.data import ReadState
from reality_gap.study.system import System
from reality_gap.types import Floats

BEGIN = "begin"
"""Position within the gap at the start of each episode, in halves of the gap."""


def _locations(system: System) -> tuple[Location, ...]:
    joints = elements.each_joint(system)
    readings = encoders.readings_only(system, joints)
    found = (*elements.each_tendon(system), *joints)
    used = [p for p in found if encoders.is_used(*encoders.encoders(system, p))]
    return (*used, *readings)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    begin = Parameter(BEGIN, "1", 0.5, 0.0, -1.0, 1.0, hints=SearchHints(shape=True))
    if location.kind == "tendon":
        travel = typical_scales.tendon_travel(system)
        hints = SearchHints(secants=elements.secants(system, location, (0.03 * travel,)))
        tolerance = encoders.tolerance(location, 7e-5 * travel)
        sizes = (0.004 * travel, tolerance, 0.0, 0.4 * travel)
        return Parameter("gap", "m", *sizes, hints=hints), begin
    unit, size = typical_scales.joint_travel(system, location)
    hints = SearchHints(secants=elements.secants(system, location, (0.03 * size, 0.1 * size)))
    sizes = (0.005 * size, encoders.tolerance(location, 0.0001 * size), 0.0, 0.3 * size)
    return Parameter("gap", unit, *sizes, hints=hints), begin


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    chosen, half = encoders.encoders(system, location), values["gap"] / 2
    first = values[BEGIN] * half
    if not half:
        return

    def make(model: mujoco.MjModel) -> Hook:
        return _Play(model, chosen, half, first, system.study.initial.settle)

    def read(record: Record) -> None:
        for encoder in chosen:
            position = encoders.true_position(record, encoder)
            encoders.add_to_reading(record, encoder, played(position, half, first) - position)

    def start(states: dict[str, ReadState]) -> None:
        for name in location.elements:
            if name in states:
                states[name] = states[name]._replace(position=states[name].position - first)

    if location.kind == "joint" and first:
        effects.starts.append(start)
    if location.note != READING and any(encoder.actuator for encoder in chosen):
        effects.add_hook(make)
    effects.readings.append(read)


def played(position: Floats, half: float, first: float = 0.0) -> Floats:
    """Apply the play operator to positions.

    Args:
        position: shape (k,) [m or rad].
        half: half of the gap [m or rad].
        first: first reading less the first position [m or rad].

    Returns:
        Positions that the encoder reads, shape (k,).
    """
    out = np.empty_like(position)
    state = position[0] + first
    for i, here in enumerate(position):
        state = min(max(state, here - half), here + half)
        out[i] = state
    return out


class _Play:
    """Hook that applies the play operator to position feedback, from the end of settling on."""

    def __init__(
        self,
        model: mujoco.MjModel,
        chosen: tuple[encoders.Encoder, ...],
        half: float,
        first: float,
        settle: float,
    ) -> None:
        self._feedback, self._half, self._first = Feedback(model, chosen), half, first
        self._waits = round(settle / model.opt.timestep)
        self._state = np.zeros(len(chosen))

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Update the state, and feed it back to the actuators."""
        position = self._feedback.position(model, data)
        if self._waits >= 0:
            self._waits -= 1
            self._state = position + self._first
            self._feedback.set_error(self._state - position)
            return
        self._state = np.clip(self._state, position - self._half, position + self._half)
        self._feedback.set_error(self._state - position)


CAUSE = Cause(
    id="backlash",
    title="backlash",
    explanation="A gap between an element and its encoder delays the reading of reversals.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
