"""Builds a robot from a nominal machine, a mismatch and hidden effects."""

from __future__ import annotations

import copy

import mujoco

from hidden_plants.machine import Machine
from hidden_plants.mechanisms import mechanism_of
from hidden_plants.nuisance import Mismatch
from hidden_plants.robot import STEP, Robot, assemble, bare_model, bare_spec
from hidden_plants.secret import Effect


def build(
    machine: Machine, mismatch: Mismatch, effects: tuple[Effect, ...] = (), step: float = STEP
) -> Robot:
    """Build the robot that the hidden effects act on.

    Args:
        machine: nominal model.
        mismatch: small differences between the robot and the nominal model.
        effects: hidden effects; those of amplitude 0 are skipped, so they change no bit.
        step: physics step [s].
    """
    acting = [effect for effect in effects if effect.amplitude != 0.0]
    reshaping = [
        (reshape, effect)
        for effect in acting
        if (reshape := mechanism_of(effect).reshape) is not None
    ]
    edited = bare_spec(machine, reshaping).compile() if reshaping else None
    model = edited or copy.copy(bare_model(machine))
    robot = assemble(machine, model, mismatch, step)
    for effect in acting:
        tune = mechanism_of(effect).tune
        if tune is not None:
            tune(robot, effect)
    mujoco.mj_setConst(robot.model, mujoco.MjData(robot.model))
    return robot
