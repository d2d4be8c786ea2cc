"""Where causes may act: the groups of elements that several causes share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import mujoco

from reality_gap.causes.base import Location
from reality_gap.study.system import ActuatedTendon, System, commanded

Sensed = Literal["length", "tension", None]


def _has(tendon: ActuatedTendon, sensed: Sensed) -> bool:
    if sensed == "length":
        return bool(tendon.length_sensors)
    return sensed is None or bool(tendon.tension_sensors)


def each_tendon(system: System, sensed: Sensed = None) -> tuple[Location, ...]:
    """Every wire by itself; only those whose length or tension is measured, if asked."""
    return tuple(Location("tendon", (w.name,)) for w in system.tendons if _has(w, sensed))


def all_tendons(system: System, sensed: Sensed = None) -> tuple[Location, ...]:
    """All wires at once, sharing the parameters; none where there are fewer than two."""
    names = tuple(w.name for w in system.tendons if _has(w, sensed))
    return (Location("tendon", names),) if len(names) > 1 else ()


def each_joint(system: System) -> tuple[Location, ...]:
    """Every hinge and slide joint by itself."""
    return tuple(Location("joint", (name,)) for name in system.joints)


Fit = Callable[[mujoco.MjModel, int], bool]


def _fitting(system: System, fit: Fit | None) -> tuple[str, ...]:
    model = system.model
    return tuple(model.actuator(i).name for i in commanded(model) if fit is None or fit(model, i))


def each_actuator(system: System, fit: Fit | None = None) -> tuple[Location, ...]:
    """Every actuator by itself; only those with ``fit(model, actuator)``, if given."""
    return tuple(Location("actuator", (name,)) for name in _fitting(system, fit))


def all_actuators(system: System, fit: Fit | None = None) -> tuple[Location, ...]:
    """All actuators at once; none where there are fewer than two."""
    names = _fitting(system, fit)
    return (Location("actuator", names),) if len(names) > 1 else ()


def tension_signs(system: System, location: Location) -> dict[str, float]:
    """Sensors of the tension of a place's wires, each with the sign that it gives to a pull.

    A force on a tendon that is positive lengthens it; an actuator's own comes before its gear.
    """
    model, signs = system.model, {}
    for tendon in (system.tendon(name) for name in location.elements):
        for sensor in tendon.tension_sensors:
            own = int(model.sensor(sensor).type[0]) == int(mujoco.mjtSensor.mjSENS_ACTUATORFRC)
            turned = own and model.actuator(tendon.actuator).gear[0] < 0
            signs[sensor] = 1.0 if turned else -1.0
    return signs
