"""Viscous friction of a tendon or joint."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import elements, typical_scales
from reality_gap.study.system import System

NOMINAL_ERROR = 0.04
"""Relative standard deviation of a damping in the nominal model."""


def _locations(system: System) -> tuple[Location, ...]:
    return elements.each_tendon(system) + elements.all_tendons(system) + elements.each_joint(system)


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    if location.kind == "tendon":
        return (Parameter("damping", "N s/m", 20.0, 1.5, 0.0, 5000.0),)
    unit, size = typical_scales.joint_damping(system, location)
    nominal = float(system.model.joint(location.elements[0]).damping[0])
    tolerance = max(0.001 * size, NOMINAL_ERROR * nominal)
    return (Parameter("damping", unit, 0.02 * size, tolerance, 0.0, 2.0 * size),)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    for name in location.elements:
        element = spec.tendon(name) if location.kind == "tendon" else spec.joint(name)
        element.damping[0] += values["damping"]


CAUSE = Cause(
    id="viscous_friction",
    title="viscous friction",
    explanation="A force in proportion to the velocity opposes the motion.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
