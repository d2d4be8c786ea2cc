"""Sensors of lengths and tensions: offsets and scales.

Parameters and amplitudes:

* length_offset: the encoder reads ``length`` [m] too much, also for the controller.
* length_scale: the encoder's change from the length at ``qpos0`` is (1 + ``excess``) [1] times the
  true one, also for the controller.
* tension_offset, tension_scale: ``force`` [N] is added, or the factor is (1 + ``excess``) [1]; the
  reading changes, the tension does not.
* joint_offset: every encoder reads l(angle) - l(0) too much, as if it had been zeroed with the
  joint at -``angle`` [rad].
"""

from __future__ import annotations

import numpy as np

from hidden_plants.machine import Machine
from hidden_plants.mechanisms.mechanism import (
    BOTH_SIGNS,
    Mechanism,
    Structure,
    each_tendon,
    signed,
)
from hidden_plants.robot import Robot, path_lengths
from hidden_plants.secret import Effect


def _tune_length_offset(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.offset[robot.tendon(name)] += effect.parameters["length"]


def _tune_length_scale(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.scale[robot.tendon(name)] *= 1.0 + effect.parameters["excess"]


def _tune_tension_offset(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.tension_offset[robot.tendon(name)] += effect.parameters["force"]


def _tune_tension_scale(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.tension_scale[robot.tendon(name)] *= 1.0 + effect.parameters["excess"]


def _joint_offsets(machine: Machine) -> list[Structure]:
    return [
        Structure("joint_offset", (joint,), {"sign": sign})
        for joint in machine.joints
        for sign in (1.0, -1.0)
    ]


def _tune_joint_offset(robot: Robot, effect: Effect) -> None:
    zero = np.array(robot.model.qpos0)
    turned = zero.copy()
    for name in effect.elements:
        turned[int(robot.model.joint(name).qposadr[0])] += effect.parameters["angle"]
    robot.offset += path_lengths(robot.model, turned) - path_lengths(robot.model, zero)


MECHANISMS = (
    Mechanism(
        id="length_offset",
        unit="m",
        typical=5e-4,
        bound=0.01,
        structures=each_tendon("length_offset", BOTH_SIGNS),
        parameters=signed("length"),
        tune=_tune_length_offset,
    ),
    Mechanism(
        id="length_scale",
        unit="1",
        typical=0.01,
        bound=0.2,
        structures=each_tendon("length_scale", BOTH_SIGNS),
        parameters=signed("excess"),
        tune=_tune_length_scale,
    ),
    Mechanism(
        id="tension_offset",
        unit="N",
        typical=3.0,
        bound=40.0,
        structures=each_tendon("tension_offset", BOTH_SIGNS),
        parameters=signed("force"),
        tune=_tune_tension_offset,
    ),
    Mechanism(
        id="tension_scale",
        unit="1",
        typical=0.03,
        bound=0.4,
        structures=each_tendon("tension_scale", BOTH_SIGNS),
        parameters=signed("excess"),
        tune=_tune_tension_scale,
    ),
    Mechanism(
        id="joint_offset",
        unit="rad",
        typical=0.02,
        bound=0.25,
        structures=_joint_offsets,
        parameters=signed("angle"),
        tune=_tune_joint_offset,
    ),
)
