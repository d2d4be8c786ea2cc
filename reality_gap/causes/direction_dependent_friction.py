"""Friction that depends on the direction of the motion: of a wire, or of a joint such as a screw's.

The size of the dry friction (and, of joints, of the viscous one) changes with the direction of the
motion; at rest, the dry one's with the direction in which its bristles are bent. Forward is the way
in which a wire gets longer, or the joint's position grows. MuJoCo's frictions know no direction:
the model gets their mean, and a hook adds what the direction changes.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from reality_gap.cause import Cause, Effects, Hook, Parameter, Place, Values
from reality_gap.causes import bristles, places, sizes
from reality_gap.causes.extra import Extra
from reality_gap.system import System

Array = NDArray[np.float64]

PERIOD = 0.004
"""Time between changes of the friction [s]."""

CREEP = 2e-3
"""Share of a typical velocity below which the direction is not clear."""


def _places(system: System) -> tuple[Place, ...]:
    return places.each_wire(system) + places.each_joint(system)


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    bend = (bristles.bend(system, place),) if bristles.possible(system) else ()
    if place.kind == "tendon":
        ways = ("forward", "backward")
        return tuple(Parameter(way, "N", 3.0, 0.05, 0.0, 200.0) for way in ways) + bend
    unit, size = sizes.joint_force(system, place)
    dry = (unit, 0.02 * size, 0.0002 * size, 0.0, 2.0 * size)
    unit, size = sizes.joint_damping(system, place)
    viscous = (unit, 0.02 * size, 0.0002 * size, 0.0, 2.0 * size)
    return (
        Parameter("forward", *dry),
        Parameter("backward", *dry),
        Parameter("forward_viscous", *viscous),
        Parameter("backward_viscous", *viscous),
        *bend,
    )


def _mean(values: Values, kind: str = "") -> float:
    return 0.5 * (values[f"forward{kind}"] + values[f"backward{kind}"])


def _half(values: Values, kind: str = "") -> float:
    return 0.5 * (values[f"forward{kind}"] - values[f"backward{kind}"])


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    if _mean(values):
        bend = bristles.bend_in(values, system, place)
        bristles.brake(spec, system, CAUSE.id, place, _mean(values), bend)
    if place.kind == "joint":
        spec.joint(place.elements[0]).damping[0] += _mean(values, "_viscous")


def _attach(effects: Effects, system: System, place: Place, values: Values) -> None:
    add = _on_wire if place.kind == "tendon" else _on_joint
    if any(values[p.name] for p in _parameters(system, place) if p.name != "presliding"):
        effects.act(lambda model: add(model, system, place, values), period=PERIOD)


def _on_wire(model: mujoco.MjModel, system: System, place: Place, values: Values) -> Hook:
    wire, creep = model.tendon(place.elements[0]).id, CREEP * sizes.WIRE_SPEED
    turn = _turning(model, system, place, values)

    def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        turn(data, data.ten_velocity[[wire]], creep)

    return hook


def _on_joint(model: mujoco.MjModel, system: System, place: Place, values: Values) -> Hook:
    dof, drag = int(model.joint(place.elements[0]).dofadr[0]), _half(values, "_viscous")
    damping, creep = Extra(model.dof_damping, dof), CREEP * sizes.joint_speed(system, place)
    turn = _turning(model, system, place, values)

    def hook(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        turn(data, data.qvel[[dof]], creep)
        damping.write(drag * math.tanh(data.qvel[dof] / creep))

    return hook


def _turning(
    model: mujoco.MjModel, system: System, place: Place, values: Values
) -> Callable[[mujoco.MjData, Array, float], None]:
    """Gives the dry friction that of the direction, when it turns; nothing where there is none."""
    mean, half = _mean(values), _half(values)
    if not mean:
        return lambda data, velocity, creep: None
    brakes, before = bristles.Brakes(model, system, CAUSE.id, place), np.nan

    def turn(data: mujoco.MjData, velocity: Array, creep: float) -> None:
        nonlocal before
        way = float(brakes.ways(data, velocity, creep)[0])
        if way != before:
            brakes.press(mean, 1 + half / mean * way)
            before = way

    return turn


CAUSE = Cause(
    id="direction_dependent_friction",
    title="friction that depends on the direction",
    explanation="Friction is larger in one direction of the motion than in the other.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    fine=True,
    sticky=True,
)
