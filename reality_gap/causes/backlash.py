"""Backlash between an element and its encoder: what is read stays behind by half the gap.

The play operator: the reading moves only when the element has crossed the gap. Where the element
lies in its gap at the start of a log cannot be known; the operator starts in the middle then, and
not while the machine settles, so that hook and reading hold the same.
"""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Effects, Hook, Location, Parameter, Record, Values
from reality_gap.causes.support import elements, encoders, typical_scales
from reality_gap.causes.support.encoders import Feedback
from reality_gap.study.system import System
from reality_gap.types import Floats


def _locations(system: System) -> tuple[Location, ...]:
    found = elements.each_tendon(system) + elements.each_joint(system)
    return tuple(p for p in found if encoders.matters(*encoders.encoders(system, p)))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.kind == "tendon":
        return (Parameter("gap", "m", 0.0003, 5e-6, 0.0, 0.03),)
    unit, size = typical_scales.joint_travel(system, location)
    return (Parameter("gap", unit, 0.005 * size, 0.0001 * size, 0.0, 0.3 * size),)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    chosen, half = encoders.encoders(system, location), values["gap"] / 2
    if not half:
        return

    def make(model: mujoco.MjModel) -> Hook:
        return _Play(model, chosen, half, system.study.initial.settle)

    def sense(record: Record) -> None:
        for encoder in chosen:
            position = encoders.recorded(record, encoder)
            encoders.add_to_reading(record, encoder, played(position, half) - position)

    if any(encoder.actuator for encoder in chosen):
        effects.act(make)
    effects.readings.append(sense)


def played(position: Floats, half: float) -> Floats:
    """What comes out of a play of half the gap each way, along positions (k,)."""
    out = np.empty_like(position)
    state = position[0]
    for i, here in enumerate(position):
        state = min(max(state, here - half), here + half)
        out[i] = state
    return out


class _Play:
    """The play operator in front of a feedback, from the end of settling on."""

    def __init__(
        self,
        model: mujoco.MjModel,
        chosen: tuple[encoders.Encoder, ...],
        half: float,
        settle: float,
    ) -> None:
        self._feedback, self._half = Feedback(model, chosen), half
        self._waits = round(settle / model.opt.timestep)
        self._state = np.zeros(len(chosen))

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Move the state along, and let the actuators see it."""
        position = self._feedback.position(model, data)
        if self._waits >= 0:
            self._waits -= 1
            self._state = position.copy()
            return
        self._state = np.clip(self._state, position - self._half, position + self._half)
        self._feedback.falsify(self._state - position)


CAUSE = Cause(
    id="backlash",
    title="backlash",
    explanation="An element and its encoder have a gap between them, so that turns are read late.",
    locations=_locations,
    parameters=_parameters,
    attach=_attach,
)
