"""Faults of frames: of the hand's marker, or of a hand that carries none."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import mujoco
import numpy as np

from jmm_agent.guard import faults
from jmm_agent.types import Floats
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro.robots import CAMERA
from kengoro_env.robot.robot import Robot
from kengoro_env.robot.subtree import subtree

CYCLE, HIDDEN_SHARE = 2.0, 0.3
"""Period with which the marker, or the hand, is hidden [s], and hidden share of it."""
OF_MARKER = (faults.MARKER_HIDDEN, faults.SECOND_MARKER, faults.MIRRORED_MARKER)
OF_HAND = (faults.HAND_HIDDEN, faults.SECOND_HAND, faults.MIRRORED_HAND, faults.OTHER_HAND)
IN_FRAMES = (*OF_MARKER, *OF_HAND)
"""Faults of marker and hand, which are visible only while these are in view."""
HAND_FRAME, EYE = "hand", "eye"
"""Names of the hand's body and of the camera."""
HAND_MARGIN = 4.0
"""Of what is hidden around the hand, whose camera is not quite the nominal one [px]."""
COVER = (90, 80, 70)
"""Colour of what hides a marker or a hand."""
MEMORY = 30
"""Number of control periods over which the hand is remembered: frames are younger."""
EDGE = 20
"""Distance of a copy from the border of its frame [px]."""


class Box(NamedTuple):
    """Part of a frame: upper left and lower right (x, y) [px]."""

    low: np.ndarray
    high: np.ndarray

    def of(self, frame: np.ndarray) -> np.ndarray:
        """What a frame shows in it, not a copy."""
        (left, top), (right, bottom) = self
        return frame[top:bottom, left:right]


class FrameFault:
    """A fault that frames show from some time on.

    Args:
        kind: one of `IN_FRAMES`, or `faults.CAMERA_FROZEN`.
        begin: time of its begin [s].
        detector: finds the marker; None: the hand carries none.
    """

    def __init__(self, kind: str, begin: float, detector: MarkerDetector | None) -> None:
        self._kind, self._begin, self._detector = kind, begin, detector
        self._kept: tuple[Box, np.ndarray] | None = None
        self._frozen: np.ndarray | None = None
        self._views: deque[HandView] = deque(maxlen=MEMORY)
        self._taken = -np.inf
        self._box: Box | None = None
        """Where the latest frame, taken at that time [s], shows the hand."""

    def disturb(self, frame: np.ndarray, time: float, robot: Robot) -> bool:
        """Change a frame in place.

        Args:
            frame: RGB, shape (height, width, 3).
            time: at which it was taken [s].
            robot: as it is now; frames are some periods old.

        Returns:
            Whether the fault is visible in it.
        """
        if self._kind == faults.CAMERA_FROZEN:
            self._frozen = frame.copy() if self._frozen is None else self._frozen
            frame[:] = self._frozen
            return True
        box = self._shown(frame, time, robot)
        if box is None:
            return False
        if self._kind in (faults.MARKER_HIDDEN, faults.HAND_HIDDEN):
            hidden = (time - self._begin) % CYCLE < HIDDEN_SHARE * CYCLE
            if hidden:
                box.of(frame)[:] = COVER
            return hidden
        if self._kind in (faults.SECOND_MARKER, faults.SECOND_HAND):
            _paint_copy(frame, box)
        elif self._kind == faults.MIRRORED_HAND:
            frame[:] = frame[:, ::-1].copy()
        elif self._kind == faults.OTHER_HAND:
            self._show_picture(frame, box)
        return True

    def _shown(self, frame: np.ndarray, time: float, robot: Robot) -> Box | None:
        """Where a frame shows the marker or the hand."""
        if self._detector is not None:
            return marker_box(self._detector, frame)
        self._views.append(hand_view(robot))
        if time != self._taken:
            self._taken = time
            then = min(self._views, key=lambda view: abs(view.time - time))
            self._box = hand_box(robot.model, then)
        return self._box

    def _show_picture(self, frame: np.ndarray, box: Box) -> None:
        """Hide the hand, and show how it was at first, as a picture before the lens does."""
        if self._kept is None:
            self._kept = box, box.of(frame).copy()
        box.of(frame)[:] = COVER
        before, picture = self._kept
        before.of(frame)[:] = picture


def marker_box(detector: MarkerDetector, frame: np.ndarray) -> Box | None:
    """The hand's marker with its white margin; None if it is not found."""
    marker = detector.detect(frame).poses.get(0)
    if marker is None:
        return None
    margin = 0.25 * float(np.ptp(marker.corners_px, axis=0).max())
    return _box(marker.corners_px, margin)


class HandView(NamedTuple):
    """Where hand and camera were at a time.

    Attributes:
        time: [s].
        positions: of all geoms in the world (ngeom, 3) [m].
        turns: their rotation matrices (ngeom, 9).
        eye: position of the camera (3,) [m].
        eye_turn: its rotation matrix (9,), in the axes of MuJoCo.
    """

    time: float
    positions: Floats
    turns: Floats
    eye: Floats
    eye_turn: Floats


def hand_view(robot: Robot) -> HandView:
    """Where hand and camera of a robot are now."""
    data, eye = robot.data, robot.data.camera(EYE)
    moving = (data.geom_xpos, data.geom_xmat, eye.xpos, eye.xmat)
    return HandView(robot.time, *(values.copy() for values in moving))


def hand_box(model: mujoco.MjModel, view: HandView) -> Box | None:
    """The hand with its fingers, which are meshes; None if its middle is out of view."""
    points = []
    mine = subtree(model, model.body(HAND_FRAME).id)[model.geom_bodyid]
    for geom in np.flatnonzero(mine & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)):
        mesh = model.mesh(model.geom_dataid[geom])
        first, count = mesh.vertadr[0], mesh.vertnum[0]
        inside = model.mesh_vert[first : first + count]
        points.append(view.positions[geom] + inside @ view.turns[geom].reshape(3, 3).T)
    turn = view.eye_turn.reshape(3, 3) @ np.diag([1.0, -1.0, -1.0])  # OpenCV's axes
    pixels = CAMERA.project((np.concatenate(points) - view.eye) @ turn)
    middle = pixels.mean(axis=0)
    if not np.all((middle > 0.0) & (middle < (CAMERA.width, CAMERA.height))):
        return None
    return _box(pixels, HAND_MARGIN)


def _box(points: Floats, margin: float) -> Box:
    size = (CAMERA.width, CAMERA.height)
    low = np.clip(np.floor(points.min(axis=0) - margin), 0, size).astype(int)
    return Box(low, np.clip(np.ceil(points.max(axis=0) + margin), 0, size).astype(int))


def _paint_copy(frame: np.ndarray, box: Box) -> None:
    """Paint a copy of a part of a frame into the other upper corner, in place."""
    patch = box.of(frame).copy()
    height, width = patch.shape[:2]
    left = EDGE if box.low[0] > frame.shape[1] // 2 else frame.shape[1] - width - EDGE
    left, height = max(left, 0), min(height, frame.shape[0] - EDGE)
    frame[EDGE : EDGE + height, left : left + width] = patch[:height]
