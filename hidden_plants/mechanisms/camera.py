"""What the camera and the marker are off by.

Parameters and amplitudes:

* marker_offset: ``x, y, z`` [m] in the frame of the marker's body.
* camera_mounting: shifted by ``x, y, z`` [m] in its body's frame and turned by ``turn_x, turn_y,
  turn_z`` [rad] about its own axes.
* camera_focal: the depth of the marker, z in the camera's frame, times (1 + ``excess``).
"""

from __future__ import annotations

import numpy as np

from hidden_plants.machine import MARKER
from hidden_plants.mechanisms.mechanism import (
    BOTH_SIGNS,
    Mechanism,
    Shape,
    Structure,
    along,
    random_way,
    shapes_of,
    signed,
    vector,
)
from hidden_plants.robot import Readings, Robot, move_camera
from hidden_plants.secret import Effect

TURN_OF_SHIFT = 3.0
"""A mounting that turns by 1 rad per 1/3 m that it shifts: both scale together [rad/m]."""


def _ways(id: str, place: str, count: int, names: str) -> list[Structure]:
    rng = shapes_of(id, place)
    structures = []
    for _ in range(count):
        shape: dict[str, float] = {}
        for i in range(0, len(names), 3):
            shape |= random_way(rng, names[i : i + 3])
        structures.append(Structure(id, (place,), shape))
    return structures


def _tune_marker(robot: Robot, effect: Effect) -> None:
    robot.model.site_pos[robot.model.site(MARKER).id] += vector(effect)


def _mounting(shape: Shape, amplitude: float) -> dict[str, float]:
    turns = {f"turn_{axis}": f"direction_{name}" for axis, name in zip("xyz", "uvw", strict=True)}
    return {
        **along(shape, amplitude),
        **{turn: TURN_OF_SHIFT * amplitude * shape[way] for turn, way in turns.items()},
    }


def _tune_mounting(robot: Robot, effect: Effect) -> None:
    turn = np.array([effect.parameters[f"turn_{axis}"] for axis in "xyz"])
    move_camera(robot.model, effect.elements[0], vector(effect), turn)


def _tune_focal(robot: Robot, effect: Effect) -> None:
    def sense(readings: Readings, robot: Robot) -> None:
        readings["marker_position"][:, 2] *= 1.0 + effect.parameters["excess"]

    robot.senses.append(sense)


MECHANISMS = (
    Mechanism(
        "marker_offset",
        "m",
        3e-3,
        0.03,
        lambda machine: _ways("marker_offset", MARKER, 4, "xyz"),
        along,
        tune=_tune_marker,
    ),
    Mechanism(
        "camera_mounting",
        "m",
        5e-3,
        0.05,
        lambda machine: _ways("camera_mounting", machine.camera, 4, "xyzuvw"),
        _mounting,
        tune=_tune_mounting,
    ),
    Mechanism(
        "camera_focal",
        "1",
        0.01,
        0.15,
        lambda machine: [
            Structure("camera_focal", (machine.camera,), shape) for shape in BOTH_SIGNS
        ],
        signed("excess"),
        tune=_tune_focal,
    ),
)
