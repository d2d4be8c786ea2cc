"""Effects that are in nobody's catalogue.

Parameters and amplitudes:

* cogging_torque: ``torque`` [N m] times sin(``periods`` * angle + ``phase``).
* cogging_motor: ``force`` [N] times the sine of the encoder's length over ``pitch`` [m].
* tension_crosstalk: the first sensor adds ``share`` of the second [1]; length_crosstalk: [m/N].
* hard_stop: a stop at ``angle`` [rad] on the upper (``side`` 1) or lower side.
* catching_wire: a knot at ``length`` [m] that holds up to ``force`` [N].
* cover_stiffness: a cover that folds from ``corner`` [rad] on, ``stiffness`` [N m/rad^3].
"""

from __future__ import annotations

from math import copysign, sin, tau

from hidden_plants.machine import Machine
from hidden_plants.mechanisms.mechanism import (
    Mechanism,
    Shape,
    Structure,
    scaled,
    shapes_of,
)
from hidden_plants.robot import Readings, Robot, State
from hidden_plants.secret import Effect

STOP_STIFFNESS, STOP_DAMPING = 150.0, 2.0
"""Of a hard stop [N m/rad], [N m s/rad]."""
CATCH_STIFFNESS = 2e4
"""Of what holds a caught wire [N/m]."""


def _joint(robot: Robot, name: str) -> tuple[int, int]:
    joint = robot.model.joint(name)
    return int(joint.qposadr[0]), int(joint.dofadr[0])


def _cogging_joints(machine: Machine) -> list[Structure]:
    structures = []
    for joint in _moving(machine):
        rng = shapes_of("cogging_torque", joint)
        for _ in range(2):
            shape = {
                "periods": round(rng.uniform(18.0, 45.0), 2),
                "phase": round(rng.uniform(0.0, 6.28), 3),
            }
            structures.append(Structure("cogging_torque", (joint,), shape))
    return structures


def _moving(machine: Machine) -> tuple[str, ...]:
    return tuple(j for j in ("elbow", "sh_pitch", "sh_roll") if j in machine.joints)


def _tune_cogging_joint(robot: Robot, effect: Effect) -> None:
    torque, phase = effect.parameters["torque"], effect.parameters["phase"]
    periods = effect.parameters["periods"]
    address, dof = _joint(robot, effect.elements[0])

    def act(state: State) -> None:
        angle = float(state.data.qpos[address])
        state.data.qfrc_applied[dof] += torque * sin(periods * angle + phase)

    robot.body.append(lambda: act)


def _cogging_motors(machine: Machine) -> list[Structure]:
    structures = []
    for tendon in machine.tendons:
        rng = shapes_of("cogging_motor", tendon)
        shape = {
            "pitch": round(rng.uniform(0.004, 0.009), 5),
            "phase": round(rng.uniform(0.0, 6.28), 3),
        }
        structures.append(Structure("cogging_motor", (tendon,), shape))
    return structures


def _tune_cogging_motor(robot: Robot, effect: Effect) -> None:
    force, pitch = effect.parameters["force"], effect.parameters["pitch"]
    tendon, phase = robot.tendon(effect.elements[0]), effect.parameters["phase"]

    def act(state: State) -> None:
        state.motor[tendon] += force * sin(tau * float(state.encoder[tendon]) / pitch + phase)

    robot.drive.append(lambda: act)


def _neighbours(machine: Machine, id: str, listener: str) -> list[Structure]:
    tendons = machine.tendons
    return [
        Structure(id, (f"{listener}_{tendon}", f"tension_{tendons[(i + skip) % len(tendons)]}"), {})
        for i, tendon in enumerate(tendons)
        for skip in (1, 2)
    ]


def _tune_crosstalk(robot: Robot, effect: Effect) -> None:
    heard, spoken = effect.elements

    def sense(readings: Readings, robot: Robot) -> None:
        readings[heard] = readings[heard] + effect.parameters["share"] * readings[spoken]

    robot.senses.append(sense)


def _stops(machine: Machine) -> list[Structure]:
    """Stops on both sides of the elbow's motions."""
    ends = {1.0: 1.95, -1.0: 0.2} if machine.name == "elbow" else {1.0: 1.95, -1.0: 0.65}
    return [
        Structure("hard_stop", ("elbow",), {"side": side, "end": end}) for side, end in ends.items()
    ]


def _stop_angle(shape: Shape, amplitude: float) -> dict[str, float]:
    return {**shape, "angle": shape["end"] - shape["side"] * amplitude}


def _tune_stop(robot: Robot, effect: Effect) -> None:
    address, dof = _joint(robot, effect.elements[0])
    side, angle = effect.parameters["side"], effect.parameters["angle"]

    def act(state: State) -> None:
        depth = side * (float(state.data.qpos[address]) - angle)
        if depth > 0.0:
            speed = side * float(state.data.qvel[dof])
            torque = STOP_STIFFNESS * depth + STOP_DAMPING * speed * min(1.0, depth / 0.01)
            state.data.qfrc_applied[dof] -= side * max(0.0, torque)

    robot.body.append(lambda: act)


def _catches(machine: Machine) -> list[Structure]:
    zero = machine.lengths(machine.model.qpos0[None])[0]
    away = {"biceps": -0.03, "brachialis": -0.027, "triceps": 0.04}
    return [
        Structure("catching_tendon", (tendon,), {"length": round(float(zero[i]) + away[tendon], 4)})
        for i, tendon in enumerate(machine.tendons)
        if tendon in away
    ]


class Catch:
    """A knot that catches at a length, holds up to a force, and jumps free."""

    def __init__(self, tendon: int, length: float, force: float) -> None:
        self.tendon, self.length, self.force = tendon, length, force
        self.side, self.held = 0.0, False

    def __call__(self, state: State) -> None:
        """Hold the wire where it is caught."""
        beyond = float(state.length[self.tendon]) - self.length
        side = copysign(1.0, beyond)
        if not self.held and self.side and side != self.side:
            self.held = True
        if self.held and CATCH_STIFFNESS * abs(beyond) > self.force:
            self.held = False
        if self.held:
            state.pull[self.tendon] += CATCH_STIFFNESS * beyond
        self.side = side


def _tune_catch(robot: Robot, effect: Effect) -> None:
    tendon = robot.tendon(effect.elements[0])
    length, force = effect.parameters["length"], effect.parameters["force"]
    robot.tug.append(lambda: Catch(tendon, length, force))


def _covers(machine: Machine) -> list[Structure]:
    corners = {1.0: 1.0, -1.0: 1.1} if machine.name == "elbow" else {1.0: 1.2}
    return [
        Structure("cover_stiffness", ("elbow",), {"side": side, "corner": corner})
        for side, corner in corners.items()
    ]


def _tune_cover(robot: Robot, effect: Effect) -> None:
    address, dof = _joint(robot, effect.elements[0])
    side, corner = effect.parameters["side"], effect.parameters["corner"]

    def act(state: State) -> None:
        fold = side * (float(state.data.qpos[address]) - corner)
        if fold > 0.0:
            state.data.qfrc_applied[dof] -= side * effect.parameters["stiffness"] * fold**3

    robot.body.append(lambda: act)


MECHANISMS = (
    Mechanism(
        "cogging_torque",
        "N m",
        0.5,
        3.0,
        _cogging_joints,
        scaled("torque"),
        tune=_tune_cogging_joint,
    ),
    Mechanism(
        "cogging_motor",
        "N",
        5.0,
        60.0,
        _cogging_motors,
        scaled("force"),
        tune=_tune_cogging_motor,
    ),
    Mechanism(
        "tension_crosstalk",
        "1",
        0.03,
        0.4,
        lambda machine: _neighbours(machine, "tension_crosstalk", "tension"),
        scaled("share"),
        tune=_tune_crosstalk,
    ),
    Mechanism(
        "length_crosstalk",
        "m/N",
        5e-6,
        1e-4,
        lambda machine: _neighbours(machine, "length_crosstalk", "length"),
        scaled("share"),
        tune=_tune_crosstalk,
    ),
    Mechanism("hard_stop", "rad", 0.15, 0.8, _stops, _stop_angle, tune=_tune_stop),
    Mechanism("catching_tendon", "N", 30.0, 150.0, _catches, scaled("force"), tune=_tune_catch),
    Mechanism(
        "cover_stiffness",
        "N m/rad^3",
        2.0,
        60.0,
        _covers,
        scaled("stiffness"),
        tune=_tune_cover,
    ),
)
