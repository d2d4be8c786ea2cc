"""Camera and marker: offsets, mounting and focal length.

Parameters and amplitudes:

* marker_offset: the marker moves by ``x, y, z`` [m] in the frame of its body.
* camera_mounting: the camera moves by ``x, y, z`` [m] in the frame of its body and turns by
  ``turn_x, turn_y, turn_z`` [rad] about its own axes.
* camera_focal: the marker's measured z in the camera's frame is (1 + ``excess``) [1] times the
  true one.
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
    random_direction,
    shapes_of,
    signed,
    vector,
)
from hidden_plants.robot import Readings, Robot, move_camera
from hidden_plants.secret import Effect

TURN_OF_SHIFT = 3.0
"""Ratio of a mounting's turn to its shift, which scale together [rad/m]."""


def _directions(id: str, element: str, *names: str) -> list[Structure]:
    """Structures with random directions, each given by three of ``names``."""
    rng = shapes_of(id, element)
    structures = []
    for _ in range(4):
        shape: dict[str, float] = {}
        for three in names:
            shape |= random_direction(rng, three)
        structures.append(Structure(id, (element,), shape))
    return structures


def _tune_marker(robot: Robot, effect: Effect) -> None:
    robot.model.site_pos[robot.model.site(MARKER).id] += vector(effect)


def _mounting(shape: Shape, amplitude: float) -> dict[str, float]:
    turns = {f"turn_{axis}": f"direction_{name}" for axis, name in zip("xyz", "uvw", strict=True)}
    return {
        **along(shape, amplitude),
        **{turn: TURN_OF_SHIFT * amplitude * shape[name] for turn, name in turns.items()},
    }


def _tune_mounting(robot: Robot, effect: Effect) -> None:
    turn = np.array([effect.parameters[f"turn_{axis}"] for axis in "xyz"])
    move_camera(robot.model, effect.elements[0], vector(effect), turn)


def _tune_focal(robot: Robot, effect: Effect) -> None:
    def change(readings: Readings, robot: Robot) -> None:
        readings["marker_position"][:, 2] *= 1.0 + effect.parameters["excess"]

    robot.sensor_effects.append(change)


MECHANISMS = (
    Mechanism(
        id="marker_offset",
        unit="m",
        typical=3e-3,
        bound=0.03,
        structures=lambda machine: _directions("marker_offset", MARKER, "xyz"),
        parameters=along,
        tune=_tune_marker,
    ),
    Mechanism(
        id="camera_mounting",
        unit="m",
        typical=5e-3,
        bound=0.05,
        structures=lambda machine: _directions("camera_mounting", machine.camera, "xyz", "uvw"),
        parameters=_mounting,
        tune=_tune_mounting,
    ),
    Mechanism(
        id="camera_focal",
        unit="1",
        typical=0.01,
        bound=0.15,
        structures=lambda machine: [
            Structure("camera_focal", (machine.camera,), shape) for shape in BOTH_SIGNS
        ],
        parameters=signed("excess"),
        tune=_tune_focal,
    ),
)
