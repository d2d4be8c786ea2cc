"""Shared amounts: a property of all joints that is wrong in the same way, as of equal motors.

If all joints have the same nominal value, one amount is added to each. If their values differ, all
are wrong by one factor.
"""

from __future__ import annotations

import numpy as np

from reality_gap.causes.base import Location, SearchHints, Values
from reality_gap.study.system import System
from reality_gap.types import Floats

FACTOR = "by one factor"
"""Note of a location whose joints are wrong by one factor, the parameter `EXCESS`."""
EXCESS = "excess"
"""Name of the parameter of a location with the note `FACTOR`."""
REDUCIBLE = SearchHints(absence=True)
"""Hints of an amount of which all may be taken away."""


def all_joints(system: System, nominal: Floats) -> tuple[Location, ...]:
    """Return the location of all joints that share an amount or a factor; none for one joint.

    Args:
        system: the machine.
        nominal: nominal value of each degree of freedom, shape (nv,).
    """
    model = system.model
    values = {name: float(nominal[model.joint(name).dofadr[0]]) for name in system.joints}
    kinds = {int(model.joint(name).type[0]) for name in system.joints}
    if len(kinds) == 1 and len(set(values.values())) == 1:
        names, note = tuple(values), ""
    else:
        names, note = tuple(name for name, value in values.items() if value > 0.0), FACTOR
    return (Location("joint", names, note),) if len(names) > 1 else ()


def amounts(
    system: System, location: Location, nominal: Floats, name: str, values: Values
) -> dict[str, float]:
    """Return the amount that is added to each joint of a location; no more is taken than there is.

    Args:
        system: the machine.
        location: one joint, or all of them.
        nominal: nominal value of each degree of freedom, shape (nv,).
        name: name of the parameter of a location without the note `FACTOR`.
        values: values of the parameters.
    """
    found = {}
    for joint in location.elements:
        old = float(nominal[system.model.joint(joint).dofadr[0]])
        added = values[EXCESS] * old if location.note == FACTOR else values[name]
        found[joint] = max(old + added, 0.0) - old
    return found


def least(system: System, location: Location, nominal: Floats) -> float:
    """Return the smallest nominal value of a location's joints."""
    dofs = [int(system.model.joint(name).dofadr[0]) for name in location.elements]
    return float(np.min(nominal[dofs]))
