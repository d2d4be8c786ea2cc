"""Torque-speed curve: the largest force of a motor falls with its speed.

A motor at its largest voltage exerts its stall torque at rest and less in proportion to its speed,
because the back EMF grows. With the nominal limit ``T`` as stall torque, a motor that drives in the
direction of its speed ``v`` exerts at most

    T max(0, 1 - drop |v|)

and one that brakes at most ``T``, as a current limit ensures; ``1 / drop`` is the no-load speed.
Source: the operating range of a DC motor in T. Kenjo and A. Hughes, "Electric Motors and Drives".
A motor that does not come near its limit does not show the curve, so that the slope at zero tells
nothing; the cause is screened at several sizes.
"""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Effects, Location, Parameter, SearchHints, Values
from reality_gap.causes.support import drives, elements
from reality_gap.causes.support.force_limits import limit_force, nominal_limit
from reality_gap.study.system import System

SHARES = (0.15, 0.4, 1.0)
"""Shares of the limit that are lost at the typical speed of a drive, at which the cause is screened
in addition to a small one."""
LARGEST = 20.0
"""Largest drop over the inverse of the typical speed."""


def _locations(system: System) -> tuple[Location, ...]:
    every = drives.each_and_all(system, drives.is_drive)
    return tuple(p for p in every if all(nominal_limit(system, name) for name in p.elements))


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    unit, speed = drives.typical_speed(system, location)
    values = elements.secants(system, location, tuple(share / speed for share in SHARES))
    # The slope at zero tells nothing, so that at least one size is tried in each machine.
    hints = SearchHints(secants=values or (SHARES[1] / speed,))
    sizes = (0.05 / speed, 0.005 / speed, 0.0, LARGEST / speed)
    return (Parameter("drop", f"s/{unit}", *sizes, hints=hints),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if values["drop"]:
        for name in location.elements:
            limit_force(spec, system, name)


def _attach(effects: Effects, system: System, location: Location, values: Values) -> None:
    if values["drop"]:
        effects.add_hook(lambda model: _Curve(model, location.elements, values["drop"]))


class _Curve:
    """Hook that lets the force limits of motors fall with the speeds of their joints or tendons.

    A limit of the other sign, such as the least tension of a tendon, is not kept at a speed at
    which the motor cannot exert it. It computes with floats, which is faster than short arrays.
    """

    def __init__(self, model: mujoco.MjModel, names: tuple[str, ...], drop: float) -> None:
        self._motors = []
        for name in names:
            i = int(model.actuator(name).id)
            low, high = (float(x) for x in model.actuator_forcerange[i])
            per = drop / abs(float(model.actuator_gear[i, 0]))
            self._motors.append((i, drives.Motion(model, name), per, low, high))

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Write the limits."""
        limits = model.actuator_forcerange
        for i, motion, per, low, high in self._motors:
            lost = per * motion.velocity(data)
            least = low * min(max(1.0 + lost, 0.0), 1.0) if low < 0.0 else low
            most = high * min(max(1.0 - lost, 0.0), 1.0) if high > 0.0 else high
            limits[i, 0] = min(least, most) if low > 0.0 else least
            limits[i, 1] = max(least, most) if high < 0.0 else most


CAUSE = Cause(
    id="torque_speed_curve",
    title="torque-speed curve of a motor",
    explanation="The largest force of a motor falls with its speed, down to none at 1/drop.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
    attach=_attach,
    fine=True,
)
