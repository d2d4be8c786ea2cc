"""Viscous friction of a tendon or joint; a negative value takes away what the nominal model has."""

from __future__ import annotations

import mujoco
import numpy as np

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import elements, shared_amounts, typical_scales
from reality_gap.causes.support.own_amounts import with_own_amounts
from reality_gap.causes.support.shared_amounts import EXCESS, FACTOR, REDUCIBLE
from reality_gap.study.system import System

NOMINAL_ERROR = 0.04
"""Relative standard deviation of a damping in the nominal model."""


def _locations(system: System) -> tuple[Location, ...]:
    of_tendons = elements.each_tendon(system) + elements.all_tendons(system)
    every = shared_amounts.all_joints(system, system.model.dof_damping)
    return of_tendons + elements.each_joint(system) + every


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.note == FACTOR:
        return (Parameter(EXCESS, "1", 0.2, NOMINAL_ERROR, -1.0, 20.0, hints=REDUCIBLE),)
    if location.kind == "tendon":
        force = typical_scales.tendon_force(system, location)
        size = force / typical_scales.tendon_speed(system)
        ids = [system.model.tendon(name).id for name in location.elements]
        low = -float(np.min(system.model.tendon_damping[ids]))
        sizes = (0.02 * size, 0.0015 * size, low, 5.0 * size)
        return (Parameter("damping", "N s/m", *sizes, hints=REDUCIBLE),)
    unit, size = min(
        typical_scales.joint_damping(system, Location("joint", (name,)))
        for name in location.elements
    )
    nominal = shared_amounts.least(system, location, system.model.dof_damping)
    tolerance = max(0.001 * size, NOMINAL_ERROR * nominal)
    most = typical_scales.most_friction(system, location)
    sizes = (0.02 * size, tolerance, -nominal, most * size)
    return (Parameter("damping", unit, *sizes, hints=REDUCIBLE),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    if location.kind == "tendon":
        for name in location.elements:
            tendon = spec.tendon(name)
            tendon.damping[0] = max(tendon.damping[0] + values["damping"], 0.0)
        return
    nominal = system.model.dof_damping
    added = shared_amounts.amounts(system, location, nominal, "damping", values)
    for name, amount in added.items():
        joint = spec.joint(name)
        joint.damping[0] = max(0.0, joint.damping[0] + amount)


CAUSE = with_own_amounts(
    Cause(
        id="viscous_friction",
        title="viscous friction",
        explanation="A force in proportion to the velocity opposes the motion.",
        locations=_locations,
        parameters=_parameters,
        edit=_edit,
    )
)
