"""Frames that must not be believed, and frames with a second hand."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from experiments.hand_detector.frames import (
    NONE,
    RANGES,
    SEEN,
    SET,
    Frame,
    camera_frame,
    make_frame,
    pose_robot,
    sample_style,
    set_up,
)
from experiments.hand_detector.optics import defocus_blur, expose, move_blur
from experiments.hand_detector.patterns import Random
from experiments.hand_detector.scene import FAR, FLAT_SIDE, below
from experiments.hand_detector.studio import Decorate, Studio, add_copy
from jmm_agent.types import Floats

BLACK, FROZEN, MIRRORED, BLURRED, PHOTOGRAPH = (
    "black", "frozen", "mirrored", "blurred", "photograph",
)  # fmt: skip
BAD = (BLACK, FROZEN, MIRRORED, BLURRED, PHOTOGRAPH)
SECOND = "second hand"
APART = 130.0
"""Least distance between the middles of two hands in a frame [px]."""
TRIES = 300


def bad_frames(studio: Studio, frame: Frame) -> list[tuple[str, Frame]]:
    """Bad frames that are made of a frame of the kind `SEEN`, with what each is."""
    rng = np.random.default_rng([frame.seed, 3804])
    blurred = defocus_blur(frame.image / 255.0, float(rng.uniform(6.0, 14.0)))
    blurred = move_blur(blurred, float(rng.uniform(0.0, 50.0)), float(rng.uniform(0.0, np.pi)))
    images = {
        BLACK: rng.integers(0, 4, frame.image.shape).astype(np.uint8),
        MIRRORED: np.ascontiguousarray(frame.image[:, ::-1]),
        BLURRED: np.rint(255.0 * np.clip(blurred, 0.0, 1.0)).astype(np.uint8),
    }
    found = [(name, replace(frame, image=image)) for name, image in images.items()]
    # The hand has moved on since: the truth and what the joints expect have.
    moved = make_frame(studio, frame.seed + 1)
    if moved.kind == SEEN:
        found.append((FROZEN, replace(moved, image=frame.image, camera=frame.camera)))
    return found


def photograph_frame(studio: Studio, seed: int) -> Frame:
    """A frame with a photograph of the hand on a flat board; the hand itself is elsewhere."""
    rng = np.random.default_rng([seed, 3805])
    style, _, families = set_up(studio, seed)
    picture = studio.picture(True, False)
    pixels = studio.camera.project(
        np.concatenate(studio.hand_outlines()) @ studio.hand_pose()[:3, :3].T
        + studio.hand_pose()[:3, 3]
    )
    half = 1.15 * float(np.max(np.ptp(pixels, axis=0))) / 2.0
    middle = (pixels.min(axis=0) + pixels.max(axis=0)) / 2.0
    steps = np.linspace(-half, half, FLAT_SIDE)
    columns, rows = (np.clip(np.rint(at + steps), 0, limit - 1).astype(int)
                     for at, limit in zip(middle, (640, 480), strict=True))  # fmt: skip
    studio.appearance.print("photograph", picture[rows][:, columns] / 255.0)
    size = half / studio.camera.focal * float(studio.hand_pose()[2, 3])
    for _ in range(TRIES):
        if pose_robot(studio, rng, NONE, RANGES) is not None and studio.visible().hand == 0:
            break
    else:
        raise RuntimeError(f"no posture without the hand was found for the photograph {seed}")
    _put_board(studio, rng, size * float(rng.uniform(0.8, 1.2)))
    image = expose(studio.picture(style.fine, False), style.optics)
    studio.model.geom("photograph").pos[:] = FAR
    return camera_frame(studio, seed, NONE, image, studio.visible(), families)


def _put_board(studio: Studio, rng: Random, size: float) -> None:
    """Hold the photograph, half of whose side is given [m], before the camera, in view of it."""
    board, eye = studio.model.geom("photograph"), studio.camera_pose()
    depth = float(rng.uniform(4.0, 6.0)) * size
    position = np.array([*rng.uniform((-0.25, -0.15), (0.25, 0.15)) * depth, depth])
    axis = rng.standard_normal(3)
    tilt = Rotation.from_rotvec(rng.uniform(0.0, np.radians(35.0)) * axis / np.linalg.norm(axis))
    turn = eye[:3, :3] @ (tilt.as_matrix() @ np.diag([1.0, -1.0, -1.0]))
    board.size[:] = (size, size, 0.003)
    board.pos[:] = eye[:3, :3] @ position + eye[:3, 3]
    board.quat[:] = np.roll(Rotation.from_matrix(turn).as_quat(), 1)
    studio.update()


def second_hand_frame(studio: Studio, seed: int) -> tuple[Frame, Floats] | None:
    """A frame with a second hand and forearm of the same robot; the truth is the own hand.

    Returns:
        The frame and the pose of the second hand in the camera (4, 4); None if none fits.
    """
    rng = np.random.default_rng([seed, 3807])
    _, _, families = set_up(studio, seed)
    style = sample_style(rng, families["light"])
    state, own = studio.data.qpos.copy(), studio.hand_pose()
    for _ in range(TRIES):
        found = pose_robot(studio, rng, SEEN, SET)
        other = studio.hand_pose()
        studio.data.qpos[:] = state
        studio.update()
        if found is None:
            continue
        if not hands_apart(studio, own, other):
            continue
        eye = studio.camera_pose()  # of the own robot: poses of hands are in the camera
        decorate = _second(studio, eye @ other @ np.linalg.inv(eye @ own))
        visible = studio.visible(decorate)
        if visible.share >= 0.5 and visible.copies >= visible.whole // 2:
            image = expose(studio.picture(style.fine, False, decorate), style.optics)
            return camera_frame(studio, seed, SEEN, image, visible, families), other
    return None


def hands_apart(studio: Studio, own: Floats, other: Floats) -> bool:
    """Whether the middles of two hands at poses in the camera (4, 4) are far from each other.

    Args:
        studio: is set up with the own hand.
        own: pose of the own hand.
        other: pose of the other one.
    """
    middle = np.append(studio.hand_middle(), 1.0)
    local = np.linalg.inv(studio.camera_pose() @ own) @ middle
    one, two = (studio.camera.project((pose @ local)[:3]) for pose in (own, other))
    return bool(np.linalg.norm(one - two) >= APART)


def _second(studio: Studio, move: Floats) -> Decorate:
    """Adds a copy of hand and forearm to a scene, moved by a transformation of the world."""
    model = studio.model
    arm = np.isin(model.geom_bodyid, sorted(below(model, model.body("ulna").id)))

    def decorate(scene: mujoco.MjvScene) -> None:
        for geom in list(scene.geoms[: scene.ngeom]):
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and arm[geom.objid]:
                add_copy(scene, geom, move)

    return decorate
