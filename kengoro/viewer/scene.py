"""Scene of a session: a copy of the robot with muscles coloured by tension and marker positions.

The scene copies the robot's model and state and does not change the session. It opens no window;
`kengoro.viewer.window` does.
"""

from __future__ import annotations

from functools import partial

import mujoco
import numpy as np
from matplotlib import colormaps

from jmm_agent.types import Floats
from kengoro.viewer.history import Marks
from kengoro_env.env import OUTSIDE
from kengoro_env.robot.tendons import spool_joint
from kengoro_env.vision.rendering import HEIGHT, WIDTH, Image, Painter

FULL_TENSION = 300.0
"""Tension from which muscles have the last colour of `MUSCLE_COLOURS` [N]."""

MUSCLE_COLOURS = "autumn_r"
"""Colour map of the muscles, a name of matplotlib's."""

MUSCLE_WIDTH = 0.003
"""Radius of the muscles in the picture [m]; twice that of the model, to show the colours."""

SEEN_COLOUR, ESTIMATED_COLOUR = "#00a02c", "#1452ff"
"""Colours of the marks: the hand's marker as the camera saw it, and as the agent estimates it."""

MARK_SIZE = 0.016
"""Half of the width of a mark [m]."""

LINE_RADIUS = 0.003
"""Radius of the line between two marks [m]."""

VIEW_DISTANCE = 1.4
"""Distance from the outside camera to the point about which the mouse turns the view [m]."""


class Scene:
    """Copy of a robot and its world, with muscles coloured by tension.

    Args:
        model: model of the robot; it is copied.
        muscles: names of the muscles, in the order of the tensions.
        width, height: size of the pictures [pixels].

    Attributes:
        model, data: the copies.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        muscles: tuple[str, ...],
        width: int = WIDTH,
        height: int = HEIGHT,
    ) -> None:
        self.model = model.__copy__()
        self.data = mujoco.MjData(self.model)
        self._tendons = [self.model.tendon(name).id for name in muscles]
        self.model.tendon_width[self._tendons] = MUSCLE_WIDTH
        joints = {self.model.joint(j).name for j in range(self.model.njnt)}
        spooled = [name for name in muscles if spool_joint(name) in joints]
        self._spooled_tendons = [self.model.tendon(name).id for name in spooled]
        self._painter = Painter(self.model, width, height)

    def update(self, data: mujoco.MjData, tensions: Floats) -> None:
        """Copy the robot's state and colour the muscles.

        The part of a tendon between its spool and its guide is hidden.

        Args:
            data: state of the robot.
            tensions: of the muscles, shape (m,) [N].
        """
        mujoco.mj_copyData(self.data, self.model, data)
        points = self.data.wrap_xpos.reshape(-1, 3)
        ends = self.data.ten_wrapadr[self._spooled_tendons]
        points[ends] = points[ends + 1]  # the spool's point moves to the guide
        self.model.tendon_rgba[self._tendons] = muscle_colours(tensions)

    def draw(self, marks: Marks) -> Image:
        """Draw the outside view with the marks, shape (height, width, 3) uint8, RGB."""
        return self._painter.draw(self.data, OUTSIDE, partial(add_marks, marks=marks))

    def close(self) -> None:
        """Free the GL context; call it in the thread that drew."""
        self._painter.close()


def match_outside_camera(camera: mujoco.MjvCamera, data: mujoco.MjData) -> None:
    """Give a camera the view of the outside camera, and make it free to move.

    Args:
        camera: camera that is changed.
        data: state of a model with the outside camera.
    """
    outside = data.camera(OUTSIDE)
    forward = -outside.xmat.reshape(3, 3)[:, 2]
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.distance = VIEW_DISTANCE
    camera.lookat[:] = outside.xpos + VIEW_DISTANCE * forward
    camera.azimuth = np.degrees(np.arctan2(forward[1], forward[0]))
    camera.elevation = np.degrees(np.arcsin(forward[2]))


def muscle_colours(tensions: Floats) -> Floats:
    """Colours of muscles by tension.

    Args:
        tensions: shape (m,) [N].

    Returns:
        Red, green, blue and opacity, each in [0, 1], shape (m, 4).
    """
    colours: Floats = colormaps[MUSCLE_COLOURS](np.clip(tensions / FULL_TENSION, 0.0, 1.0))
    return colours


def add_marks(scene: mujoco.MjvScene, marks: Marks) -> None:
    """Add marks to a scene, as far as it has room.

    A cube marks the estimated position of the hand's marker, a ball the seen one. A line joins the
    ball with the position that was estimated when the marker was seen.
    """
    _add(scene, mujoco.mjtGeom.mjGEOM_BOX, marks.estimated, ESTIMATED_COLOUR)
    if marks.seen is not None and marks.estimated_then is not None:
        _add(scene, mujoco.mjtGeom.mjGEOM_SPHERE, marks.seen, SEEN_COLOUR)
        line = _add(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, marks.seen, SEEN_COLOUR)
        if line is not None:
            capsule = int(mujoco.mjtGeom.mjGEOM_CAPSULE)
            mujoco.mjv_connector(line, capsule, LINE_RADIUS, marks.seen, marks.estimated_then)


def _add(
    scene: mujoco.MjvScene, kind: mujoco.mjtGeom, point: Floats, colour: str
) -> mujoco.MjvGeom | None:
    """Add a geom to a scene; None if the scene is full."""
    if scene.ngeom >= scene.maxgeom:
        return None
    geom = scene.geoms[scene.ngeom]
    rgba = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)] + [0.9], np.float32)
    mujoco.mjv_initGeom(
        geom, int(kind), np.full(3, MARK_SIZE), np.asarray(point), np.eye(3).ravel(), rgba
    )
    scene.ngeom += 1
    return geom
