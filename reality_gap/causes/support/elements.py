"""Elements: groups of tendons, joints and actuators on which several causes can act."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import mujoco

from reality_gap.causes.base import Location
from reality_gap.causes.support import actuators
from reality_gap.study.system import ActuatedTendon, System, commanded

Sensed = Literal["length", "tension", None]
"""Quantity of a tendon that must be measured; None for no condition."""

MANY = 8
"""Number of actuators from which on single elements are screened at small sizes only."""

Suits = Callable[[mujoco.MjModel, int], bool]
"""Whether a cause can act on an actuator of this id."""


def each_tendon(system: System, sensed: Sensed = None) -> tuple[Location, ...]:
    """Return a location for each actuated tendon, or only for those that are measured."""
    return tuple(Location("tendon", (t.name,)) for t in system.tendons if _is_sensed(t, sensed))


def all_tendons(system: System, sensed: Sensed = None) -> tuple[Location, ...]:
    """Return a location of all actuated tendons together; none if there are fewer than two."""
    names = tuple(t.name for t in system.tendons if _is_sensed(t, sensed))
    return (Location("tendon", names),) if len(names) > 1 else ()


def each_joint(system: System) -> tuple[Location, ...]:
    """Return a location for each hinge and slide joint."""
    return tuple(Location("joint", (name,)) for name in system.joints)


def each_actuator(system: System, suits: Suits | None = None) -> tuple[Location, ...]:
    """Return a location for each actuator, or only for those that ``suits`` accepts."""
    return tuple(
        Location("actuator", (name,), joint=actuators.moved_joint(system.model, name))
        for name in _actuators(system, suits)
    )


def all_actuators(system: System, suits: Suits | None = None) -> tuple[Location, ...]:
    """Return a location of all actuators together; none if there are fewer than two."""
    names = _actuators(system, suits)
    return (Location("actuator", names),) if len(names) > 1 else ()


def secants(system: System, location: Location, values: tuple[float, ...]) -> tuple[float, ...]:
    """Return the sizes at which a cause is screened in addition.

    In machines with many actuators, single elements are screened at small sizes only: each size is
    one more replay for each element.
    """
    alone = len(location.elements) == 1 and location.kind != "sensor"
    return () if alone and len(commanded(system.model)) >= MANY else values


def tension_signs(system: System, location: Location) -> dict[str, float]:
    """Return the sign of a pull in each tension sensor of a location's tendons.

    In MuJoCo, a positive tendon force lengthens the tendon, so that a pull is negative. A sensor of
    the actuator force measures before the gear, which may be negative.
    """
    model, signs = system.model, {}
    for tendon in (system.tendon(name) for name in location.elements):
        for sensor in tendon.tension_sensors:
            own = int(model.sensor(sensor).type[0]) == int(mujoco.mjtSensor.mjSENS_ACTUATORFRC)
            turned = own and model.actuator(tendon.actuator).gear[0] < 0
            signs[sensor] = 1.0 if turned else -1.0
    return signs


def _is_sensed(tendon: ActuatedTendon, sensed: Sensed) -> bool:
    if sensed == "length":
        return bool(tendon.length_sensors)
    return sensed is None or bool(tendon.tension_sensors)


def _actuators(system: System, suits: Suits | None) -> tuple[str, ...]:
    model = system.model
    return tuple(
        model.actuator(i).name for i in commanded(model) if suits is None or suits(model, i)
    )
