"""Where causes may act: the groups of elements that several causes share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import mujoco

from reality_gap.causes.base import Place
from reality_gap.study.system import System, Wire, commanded

Sensed = Literal["length", "tension", None]


def _has(wire: Wire, sensed: Sensed) -> bool:
    if sensed == "length":
        return bool(wire.length_sensors)
    return sensed is None or bool(wire.tension_sensors)


def each_wire(system: System, sensed: Sensed = None) -> tuple[Place, ...]:
    """Every wire by itself; only those whose length or tension is measured, if asked."""
    return tuple(Place("tendon", (w.tendon,)) for w in system.wires if _has(w, sensed))


def all_wires(system: System, sensed: Sensed = None) -> tuple[Place, ...]:
    """All wires at once, sharing the parameters; none where there are fewer than two."""
    names = tuple(w.tendon for w in system.wires if _has(w, sensed))
    return (Place("tendon", names),) if len(names) > 1 else ()


def each_joint(system: System) -> tuple[Place, ...]:
    """Every hinge and slide joint by itself."""
    return tuple(Place("joint", (name,)) for name in system.joints)


Fit = Callable[[mujoco.MjModel, int], bool]


def _fitting(system: System, fit: Fit | None) -> tuple[str, ...]:
    model = system.model
    return tuple(model.actuator(i).name for i in commanded(model) if fit is None or fit(model, i))


def each_actuator(system: System, fit: Fit | None = None) -> tuple[Place, ...]:
    """Every actuator by itself; only those with ``fit(model, actuator)``, if given."""
    return tuple(Place("actuator", (name,)) for name in _fitting(system, fit))


def all_actuators(system: System, fit: Fit | None = None) -> tuple[Place, ...]:
    """All actuators at once; none where there are fewer than two."""
    names = _fitting(system, fit)
    return (Place("actuator", names),) if len(names) > 1 else ()


def tension_signs(system: System, place: Place) -> dict[str, float]:
    """Sensors of the tension of a place's wires, each with the sign that it gives to a pull.

    A force on a tendon that is positive lengthens it; an actuator's own comes before its gear.
    """
    model, signs = system.model, {}
    for wire in (system.wire(name) for name in place.elements):
        for sensor in wire.tension_sensors:
            own = int(model.sensor(sensor).type[0]) == int(mujoco.mjtSensor.mjSENS_ACTUATORFRC)
            turned = own and model.actuator(wire.actuator).gear[0] < 0
            signs[sensor] = 1.0 if turned else -1.0
    return signs
