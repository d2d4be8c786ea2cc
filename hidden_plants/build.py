"""From a drawing, mismatches and hidden effects to a machine that runs."""

from __future__ import annotations

import copy

import mujoco

from hidden_plants.machine import Machine
from hidden_plants.mechanisms import mechanism_of
from hidden_plants.nuisance import Mismatch
from hidden_plants.robot import STEP, Robot, assemble, bare_model, bare_spec
from hidden_plants.secret import Effect


def build(
    machine: Machine, slip: Mismatch, effects: tuple[Effect, ...] = (), step: float = STEP
) -> Robot:
    """The machine with its mismatches and ``effects``; an amplitude of 0 does nothing at all."""
    acting = [effect for effect in effects if effect.amplitude != 0.0]
    reshaping = [
        (reshape, effect)
        for effect in acting
        if (reshape := mechanism_of(effect).reshape) is not None
    ]
    own = copy.copy(bare_model(machine))
    model = bare_spec(machine, reshaping).compile() if reshaping else own
    robot = assemble(machine, model, slip, step)
    for effect in acting:
        tune = mechanism_of(effect).tune
        if tune is not None:
            tune(robot, effect)
    mujoco.mj_setConst(robot.model, mujoco.MjData(robot.model))
    return robot
