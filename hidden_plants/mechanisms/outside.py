"""Effects outside of the diagnosis's catalogue.

Parameters and amplitudes:

* cogging_torque: ``torque`` [N m] times sin(``periods`` angle + ``phase``) on a joint.
* cogging_motor: ``force`` [N] times sin(2 pi length / ``pitch`` + ``phase``) on a motor, with the
  encoder's length and ``pitch`` [m].
* tension_crosstalk, length_crosstalk: the first sensor's reading increases by ``share`` times the
  second's; ``share`` [1], [m/N].
* hard_stop: a stop at ``angle`` [rad] on the upper (``side`` 1) or lower (-1) side.
* catching_tendon: a knot catches at ``length`` [m] and holds up to ``force`` [N].
* cover_stiffness: the torque ``stiffness`` [N m/rad^3] (angle - ``corner``)^3 of a cover that folds
  beyond ``corner`` [rad].
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
"""Stiffness and damping of a hard stop [N m/rad], [N m s/rad]."""
CATCH_STIFFNESS = 2e4
"""Stiffness of the contact that holds a caught tendon [N/m]."""


def _joint(robot: Robot, name: str) -> tuple[int, int]:
    """Addresses of a joint in ``qpos`` and ``qvel``."""
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

    robot.body_devices.append(lambda: act)


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

    robot.motor_devices.append(lambda: act)


def _sensor_pairs(machine: Machine, id: str, receiver: str) -> list[Structure]:
    tendons = machine.tendons
    return [
        Structure(id, (f"{receiver}_{tendon}", f"tension_{tendons[(i + skip) % len(tendons)]}"), {})
        for i, tendon in enumerate(tendons)
        for skip in (1, 2)
    ]


def _tune_crosstalk(robot: Robot, effect: Effect) -> None:
    receiver, source = effect.elements

    def change(readings: Readings, robot: Robot) -> None:
        readings[receiver] = readings[receiver] + effect.parameters["share"] * readings[source]

    robot.sensor_effects.append(change)


def _stops(machine: Machine) -> list[Structure]:
    """Stops at both ends of the elbow's motions."""
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

    robot.body_devices.append(lambda: act)


def _catches(machine: Machine) -> list[Structure]:
    zero = machine.lengths(machine.model.qpos0[None])[0]
    from_zero = {"biceps": -0.03, "brachialis": -0.027, "triceps": 0.04}
    structures = []
    for tendon, length in zip(machine.tendons, zero, strict=True):
        if tendon in from_zero:
            shape = {"length": round(float(length) + from_zero[tendon], 4)}
            structures.append(Structure("catching_tendon", (tendon,), shape))
    return structures


class Catch:
    """A knot that catches when the tendon passes a length and slips above a force."""

    def __init__(self, tendon: int, length: float, force: float) -> None:
        self.tendon, self.length, self.force = tendon, length, force
        self.side, self.held = 0.0, False

    def __call__(self, state: State) -> None:
        """Add the force of the caught knot to the pull."""
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
    robot.pull_devices.append(lambda: Catch(tendon, length, force))


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

    robot.body_devices.append(lambda: act)


MECHANISMS = (
    Mechanism(
        id="cogging_torque",
        unit="N m",
        typical=0.5,
        bound=3.0,
        structures=_cogging_joints,
        parameters=scaled("torque"),
        tune=_tune_cogging_joint,
    ),
    Mechanism(
        id="cogging_motor",
        unit="N",
        typical=5.0,
        bound=60.0,
        structures=_cogging_motors,
        parameters=scaled("force"),
        tune=_tune_cogging_motor,
    ),
    Mechanism(
        id="tension_crosstalk",
        unit="1",
        typical=0.03,
        bound=0.4,
        structures=lambda machine: _sensor_pairs(machine, "tension_crosstalk", "tension"),
        parameters=scaled("share"),
        tune=_tune_crosstalk,
    ),
    Mechanism(
        id="length_crosstalk",
        unit="m/N",
        typical=5e-6,
        bound=1e-4,
        structures=lambda machine: _sensor_pairs(machine, "length_crosstalk", "length"),
        parameters=scaled("share"),
        tune=_tune_crosstalk,
    ),
    Mechanism(
        id="hard_stop",
        unit="rad",
        typical=0.15,
        bound=0.8,
        structures=_stops,
        parameters=_stop_angle,
        tune=_tune_stop,
    ),
    Mechanism(
        id="catching_tendon",
        unit="N",
        typical=30.0,
        bound=150.0,
        structures=_catches,
        parameters=scaled("force"),
        tune=_tune_catch,
    ),
    Mechanism(
        id="cover_stiffness",
        unit="N m/rad^3",
        typical=2.0,
        bound=60.0,
        structures=_covers,
        parameters=scaled("stiffness"),
        tune=_tune_cover,
    ),
)
