"""Gravity direction: the base of the machine is tilted, about axes of the model.

The model keeps its axes, so that gravity turns the other way in them.
"""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.study.system import System

AXES = ("x", "y", "z")


def _locations(system: System) -> tuple[Location, ...]:
    heavy = bool(system.bodies) and bool(np.any(system.model.opt.gravity))
    return (Location("model", ("gravity",)),) if heavy else ()


def _axes(system: System) -> list[int]:
    """Return the two axes of the world that are most perpendicular to gravity."""
    return sorted(np.argsort(np.abs(system.model.opt.gravity), kind="stable")[:2].tolist())


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(f"about_{AXES[i]}", "rad", 0.05, 0.001, -0.8, 0.8) for i in _axes(system)
    )


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    turn = np.zeros(3)
    for i in _axes(system):
        turn[i] = values[f"about_{AXES[i]}"]
    spec.option.gravity = Rotation.from_rotvec(-turn).apply(spec.option.gravity)


CAUSE = Cause(
    id="gravity_direction",
    title="tilted base",
    explanation="The base of the machine is tilted, so that gravity has another direction.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
