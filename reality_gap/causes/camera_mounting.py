"""Camera mounting: a camera is displaced and rotated, in its own axes."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import frames
from reality_gap.study.system import System

TURN = Parameter("turn", "rad", 0.02, 0.0005, -0.6, 0.6)


def _locations(system: System) -> tuple[Location, ...]:
    return frames.camera_locations(
        system, frames.position_sensors(system) + frames.orientation_sensors(system)
    )


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    distance = frames.distance(system, location.elements[0])
    sizes = (0.005 * distance, 0.0003 * distance, -0.2 * distance, 0.2 * distance)
    return frames.pose_parameters(Parameter("shift", "m", *sizes), TURN)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    nominal = system.model.camera(location.elements[0])
    camera = spec.camera(location.elements[0])
    frames.set_pose(camera, *frames.moved_pose(nominal.pos, nominal.quat, values))


CAUSE = Cause(
    id="camera_mounting",
    title="displaced camera",
    explanation="A camera is displaced or rotated, so that all poses that it measures are wrong.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
