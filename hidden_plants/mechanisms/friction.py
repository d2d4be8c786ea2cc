"""Friction of tendons and joints: Coulomb, viscous, load-dependent, direction-dependent."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import copysign, exp

from hidden_plants.machine import Machine
from hidden_plants.mechanisms.mechanism import Mechanism, Shape, Structure, each_tendon, scaled
from hidden_plants.robot import Device, Robot, State
from hidden_plants.secret import Effect

JOINT_BRISTLE = 5e-4
"""Angle over which the dry friction of a joint builds up [rad]."""


def _each_tendon_and_joint(id: str) -> Callable[[Machine], list[Structure]]:
    """Structures that act on one tendon or one joint, for all of them."""

    def structures(machine: Machine) -> list[Structure]:
        tendons = each_tendon(id, ({"on_joint": 0.0},))(machine)
        return tendons + [Structure(id, (joint,), {"on_joint": 1.0}) for joint in machine.joints]

    return structures


def _tune_coulomb(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        if effect.parameters["on_joint"]:
            dof = int(robot.model.joint(name).dofadr[0])
            level = effect.parameters["force"]
            robot.body_devices.append(partial(JointFriction, dof, level))
        else:
            robot.friction_out[robot.tendon(name)] += effect.parameters["force"]
            robot.friction_in[robot.tendon(name)] += effect.parameters["force"]


class JointFriction:
    """Dry friction of a joint by Dahl's model of bristles that bend, then slide."""

    def __init__(self, dof: int, level: float) -> None:
        self.dof, self.level, self.torque = dof, level, 0.0

    def __call__(self, state: State) -> None:
        """Subtract the friction from the joint's torque."""
        speed = float(state.data.qvel[self.dof])
        end = copysign(self.level, speed)
        self.torque = end + (self.torque - end) * exp(-state.step * abs(speed) / JOINT_BRISTLE)
        state.data.qfrc_applied[self.dof] -= self.torque


def _tune_viscous(robot: Robot, effect: Effect) -> None:
    coefficient = effect.parameters["coefficient"]
    for name in effect.elements:
        if effect.parameters["on_joint"]:
            dof = int(robot.model.joint(name).dofadr[0])
            robot.body_devices.append(partial(_joint_drag, dof, coefficient))
        else:
            tendon = robot.tendon(name)
            robot.pull_devices.append(partial(_tendon_drag, tendon, coefficient))


def _tendon_drag(tendon: int, coefficient: float) -> Device:
    def act(state: State) -> None:
        state.pull[tendon] += coefficient * state.velocity[tendon]

    return act


def _joint_drag(dof: int, coefficient: float) -> Device:
    def act(state: State) -> None:
        state.data.qfrc_applied[dof] -= coefficient * state.data.qvel[dof]

    return act


def _tune_load_dependent(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.load_friction[robot.tendon(name)] += effect.parameters["share"]


def _tune_direction_dependent(robot: Robot, effect: Effect) -> None:
    for name in effect.elements:
        robot.friction_out[robot.tendon(name)] += effect.parameters["force_out"]
        robot.friction_in[robot.tendon(name)] += effect.parameters["force_in"]


def _two_levels(shape: Shape, amplitude: float) -> dict[str, float]:
    return {
        **shape,
        "force_out": amplitude * shape["share_out"],
        "force_in": amplitude * (1.0 - shape["share_out"]),
    }


COULOMB = Mechanism(
    id="coulomb_friction",
    unit="N or N m",
    typical=3.0,
    bound=20.0,
    structures=_each_tendon_and_joint("coulomb_friction"),
    parameters=scaled("force"),
    tune=_tune_coulomb,
)
"""``force``: of a tendon [N], or of a joint [N m] (``on_joint`` 1)."""

VISCOUS = Mechanism(
    id="viscous_friction",
    unit="N s/m or N m s/rad",
    typical=60.0,
    bound=600.0,
    structures=_each_tendon_and_joint("viscous_friction"),
    parameters=scaled("coefficient"),
    tune=_tune_viscous,
)
"""``coefficient``: of a tendon [N s/m], or of a joint [N m s/rad] (``on_joint`` 1)."""

LOAD_DEPENDENT = Mechanism(
    id="load_dependent_friction",
    unit="1",
    typical=0.03,
    bound=0.35,
    structures=each_tendon("load_dependent_friction"),
    parameters=scaled("share"),
    tune=_tune_load_dependent,
)
"""``share``: ratio of dry friction to tension, as at a guide of a fixed wrap angle [1]."""

DIRECTION_DEPENDENT = Mechanism(
    id="direction_dependent_friction",
    unit="N",
    typical=4.0,
    bound=20.0,
    structures=each_tendon(
        "direction_dependent_friction", ({"share_out": 0.9}, {"share_out": 0.1})
    ),
    parameters=_two_levels,
    tune=_tune_direction_dependent,
)
"""``force_out`` while the tendon lengthens, ``force_in`` while it shortens [N]."""

MECHANISMS = (COULOMB, VISCOUS, LOAD_DEPENDENT, DIRECTION_DEPENDENT)
