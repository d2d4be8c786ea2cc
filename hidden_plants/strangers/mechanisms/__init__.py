"""Mechanisms of hidden effects that act on a machine of any kind and size."""

from __future__ import annotations

import mujoco

from hidden_plants.secret import Effect
from hidden_plants.strangers.mechanisms import (
    clocks,
    drives,
    encoders,
    friction,
    gears,
    joints,
    loads,
    motor_limits,
    outside,
    readings,
    tendons,
)
from hidden_plants.strangers.mechanisms.mechanism import Mechanism, Structure
from hidden_plants.strangers.mismatch import Mismatch
from hidden_plants.strangers.plant import Plant, assemble
from hidden_plants.strangers.stranger import Stranger

_INSIDE = (friction, joints, loads, drives, encoders, tendons, readings)

_ADDED = (motor_limits, gears, clocks)

MECHANISMS: dict[str, Mechanism] = {
    mechanism.id: mechanism
    for module in (*_INSIDE, outside, *_ADDED)
    for mechanism in module.MECHANISMS
}
OUTSIDE = tuple(mechanism.id for mechanism in outside.MECHANISMS)
"""Effects that no single cause of a catalogue expresses."""
ADDED = tuple(mechanism.id for module in _ADDED for mechanism in module.MECHANISMS)
"""Effects that were added later. They are sampled with random numbers of their own, so that trials
in which no such effect is sampled hide what they hid before."""


def mechanism_of(effect: Effect | Structure) -> Mechanism:
    """Return the mechanism of an effect.

    Raises:
        ValueError: the id is unknown.
    """
    if effect.id not in MECHANISMS:
        raise ValueError(f"unknown effect {effect.id!r}; valid are: {', '.join(MECHANISMS)}")
    return MECHANISMS[effect.id]


def build(
    stranger: Stranger, mismatch: Mismatch, effects: tuple[Effect, ...], step: float
) -> Plant:
    """Build the real machine that hidden effects act on.

    Args:
        stranger: nominal machine.
        mismatch: small differences from it.
        effects: hidden effects; those of amplitude 0 change nothing.
        step: physics step [s].
    """
    plant = assemble(stranger, mismatch, step)
    # An elastic gear takes the rotor's inertia out of the model, with that of other effects.
    for effect in sorted(effects, key=lambda one: one.id == "joint_elasticity"):
        if effect.amplitude != 0.0:
            mechanism_of(effect).tune(plant, effect)
    mujoco.mj_setConst(plant.model, mujoco.MjData(plant.model))
    return plant
