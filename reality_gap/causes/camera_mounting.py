"""A camera that is not mounted where the drawing has it: moved and turned in its own axes."""

from __future__ import annotations

import mujoco

from reality_gap.causes.base import Cause, Location, Parameter, Values
from reality_gap.causes.support import frames
from reality_gap.study.system import System

SHIFT = Parameter("shift", "m", 0.005, 0.0003, -0.2, 0.2)
TURN = Parameter("turn", "rad", 0.02, 0.0005, -0.6, 0.6)


def _locations(system: System) -> tuple[Location, ...]:
    return frames.cameras(
        system, frames.position_sensors(system) + frames.orientation_sensors(system)
    )


def _parameters(system: System, location: Location) -> tuple[Parameter, ...]:
    return frames.motion(SHIFT, TURN)


def _edit(spec: mujoco.MjSpec, system: System, location: Location, values: Values) -> None:
    drawn = system.model.camera(location.elements[0])
    camera = spec.camera(location.elements[0])
    frames.put(camera, *frames.moved(drawn.pos, drawn.quat, values))


CAUSE = Cause(
    id="camera_mounting",
    title="displaced camera",
    explanation="The camera looks from elsewhere, or elsewhere, so that all that it sees is moved.",
    locations=_locations,
    parameters=_parameters,
    edit=_edit,
)
