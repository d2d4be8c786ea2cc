"""Scenes with a second hand in which the own hand moves: which one is the own one?

The second hand has the same shape and skin, with its forearm. In every other scene it stays where
it is in the world; in the others it moves to another posture for each frame. The head, and with it
the camera, turns with the own postures. The expected pose of the own hand is `OFF_POSITION` and
`OFF_ROTATION` off, the same for all frames of a scene.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from experiments.hand_detector.bad_input import hands_apart
from experiments.hand_detector.clutter import clear_before
from experiments.hand_detector.frames import (
    SEEN,
    SET,
    Style,
    hand_is_possible,
    sample_fingers,
    sample_posture,
    sample_style,
    set_up,
    shifted,
)
from experiments.hand_detector.optics import Image, expose
from experiments.hand_detector.patterns import Random
from experiments.hand_detector.scene import below
from experiments.hand_detector.studio import ActualCamera, Decorate, Studio, add_copy
from jmm_agent.types import Floats
from kengoro_env.vision.rendering import HEIGHT, WIDTH

STILL, MOVES = "still", "moves"
"""What the second hand does."""
MOVEMENTS = 6
"""Number of movements of the own hand in a scene."""
TRIES, RESTARTS = 300, 5
"""Numbers of postures that are tried for each frame, and of scenes for each seed."""


class PairFrame(NamedTuple):
    """A frame with two hands.

    Attributes:
        image: (480, 640, 3) uint8.
        own: pose of the own hand in the camera (4, 4).
        other: pose of the second hand in the camera (4, 4).
        expected: pose of the own hand in the camera that the joints expect (4, 4).
        eye: pose of the camera in the world that the joints expect (4, 4).
    """

    image: Image
    own: Floats
    other: Floats
    expected: Floats
    eye: Floats


class PairScene(NamedTuple):
    """Frames of one scene with two hands.

    Attributes:
        seed: of the scene.
        kind: what the second hand does, `STILL` or `MOVES`.
        camera: that took the frames.
        frames: `MOVEMENTS` + 1.
    """

    seed: int
    kind: str
    camera: ActualCamera
    frames: list[PairFrame]


class Arm(NamedTuple):
    """A second hand with its forearm.

    Attributes:
        hand: pose of the hand, in the camera or in the world (4, 4).
        geoms: poses of the geoms of hand and forearm in the hand's axes (4, 4), by their ids.
    """

    hand: Floats
    geoms: dict[int, Floats]


def kind_of_pair(seed: int) -> str:
    """What the second hand of a scene does."""
    return (STILL, MOVES)[seed // 10 % 2]


def pair_scene(studio: Studio, seed: int) -> PairScene | None:
    """A scene with a second hand; None if no frames that show both hands were found."""
    rng = np.random.default_rng([seed, 3808])
    _, _, families = set_up(studio, seed)
    clear_before(studio.model)
    style, kind = sample_style(rng, families["light"]), kind_of_pair(seed)
    for _ in range(RESTARTS):
        fingers = sample_fingers(rng)
        frames: list[PairFrame] = []
        other: Arm | None = None  # in the world
        while len(frames) <= MOVEMENTS:
            found = _frame(studio, rng, style, fingers, other, seed)
            if found is None:
                break
            frames.append(found[0])
            other = found[1] if kind == STILL else None
        else:
            return PairScene(seed, kind, studio.camera, frames)
    return None


def _frame(
    studio: Studio, rng: Random, style: Style, fingers: Floats, still: Arm | None, seed: int
) -> tuple[PairFrame, Arm] | None:
    """A frame with both hands, and the second one in the world; the latter may be given."""
    for _ in range(TRIES):
        other = still
        if still is None and (other := _arm(studio, rng, fingers)) is None:
            continue
        assert other is not None
        if not _pose(studio, rng, fingers):
            continue
        eye, own = studio.camera_pose(), studio.hand_pose()
        world = other if still is not None else other._replace(hand=eye @ other.hand)
        seen = np.linalg.inv(eye) @ world.hand
        if not (_in_frame(studio, seen) and hands_apart(studio, own, seen)):
            continue
        decorate = _beside(studio, world)
        visible = studio.visible(decorate)
        if visible.share < 0.5 or visible.copies < visible.whole // 2:
            continue
        image = expose(studio.picture(style.fine, False, decorate), style.optics)
        off, turned = (shifted(pose, np.random.default_rng([seed, 3809])) for pose in (own, eye))
        return PairFrame(image, own, seen, off, turned), world
    return None


def _pose(studio: Studio, rng: Random, fingers: Floats) -> bool:
    """Sample a posture; whether the hand is above the table and in the frame."""
    studio.set_robot(sample_posture(studio, rng, SET), fingers)
    return hand_is_possible(studio, SEEN, False)


def _arm(studio: Studio, rng: Random, fingers: Floats) -> Arm | None:
    """Hand and forearm at another posture, in the camera; None if that is not possible."""
    if not _pose(studio, rng, fingers):
        return None
    own, model = studio.hand_pose(), studio.model
    to_hand = np.linalg.inv(studio.camera_pose() @ own)
    arm = np.isin(model.geom_bodyid, sorted(below(model, model.body("ulna").id)))
    geoms = {int(geom): to_hand @ _geom_pose(studio, int(geom)) for geom in np.flatnonzero(arm)}
    return Arm(own, geoms)


def _geom_pose(studio: Studio, geom: int) -> Floats:
    """Pose of a geom in the world (4, 4)."""
    pose = np.eye(4)
    pose[:3, :3] = studio.data.geom_xmat[geom].reshape(3, 3)
    pose[:3, 3] = studio.data.geom_xpos[geom]
    return pose


def _in_frame(studio: Studio, pose: Floats) -> bool:
    """Whether the frame shows the origin of a hand at a pose in the camera (4, 4)."""
    pixel = studio.camera.project(pose[:3, 3])
    return bool(np.all((pixel > 0.0) & (pixel < (WIDTH, HEIGHT))))


def _beside(studio: Studio, other: Arm) -> Decorate:
    """Adds copies of hand and forearm to a scene."""

    def decorate(scene: mujoco.MjvScene) -> None:
        for geom in list(scene.geoms[: scene.ngeom]):
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.objid in other.geoms:
                there = other.hand @ other.geoms[geom.objid]
                add_copy(scene, geom, there @ np.linalg.inv(_geom_pose(studio, geom.objid)))

    return decorate
