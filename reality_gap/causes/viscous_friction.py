"""Viscous friction of a wire or joint."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Parameter, Place, Values
from reality_gap.causes.support import elements, typical_scales
from reality_gap.study.system import System

DRAWN = 0.04
"""What a drawn damping may be off by, relatively."""


def _places(system: System) -> tuple[Place, ...]:
    return elements.each_wire(system) + elements.all_wires(system) + elements.each_joint(system)


def _parameters(system: System, place: Place) -> tuple[Parameter, ...]:
    if place.kind == "tendon":
        return (Parameter("damping", "N s/m", 20.0, 1.5, 0.0, 5000.0),)
    unit, size = typical_scales.joint_damping(system, place)
    drawn = float(system.model.joint(place.elements[0]).damping[0])
    tolerance = max(0.001 * size, DRAWN * drawn)
    return (Parameter("damping", unit, 0.02 * size, tolerance, 0.0, 2.0 * size),)


def _edit(spec: mujoco.MjSpec, system: System, place: Place, values: Values) -> None:
    for name in place.elements:
        element = spec.tendon(name) if place.kind == "tendon" else spec.joint(name)
        element.damping[0] += values["damping"]


CAUSE = Cause(
    id="viscous_friction",
    title="viscous friction",
    explanation="A force in proportion to the velocity opposes the motion.",
    places=_places,
    parameters=_parameters,
    edit=_edit,
)
