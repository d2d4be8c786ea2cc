"""The judge's frames: each follows from its seed, whatever was made before.

Of ten frames eight show at least half of the hand, one shows less of it, and one shows none of it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from experiments.hand_detector.clutter import clear_before, put_before, scatter
from experiments.hand_detector.optics import Image, Optics, expose, sample_optics
from experiments.hand_detector.patterns import Random
from experiments.hand_detector.studio import ActualCamera, Studio, Visible, geoms_left_out
from jmm_agent.types import Floats
from kengoro_env.postures import posture_set
from kengoro_env.tasks.can_grasp import CAN_AREA
from kengoro_env.vision.rendering import HEIGHT, WIDTH

SEEN, HIDDEN, NONE = "seen", "hidden", "none"
"""At least half of the hand is visible, or less, or nothing."""
SET, RANGES = "posture set", "joint ranges"
"""Where a posture is sampled."""
FEWEST = 60
"""Fewest pixels of a hand that is said to be hidden in part, at half the frame's resolution."""
TRIES = 5000
"""Number of samples for a frame of a kind."""
SAME_CAMERA = 10
"""Number of frames of each camera."""
LARGEST_K1 = 0.05
OFF_POSITION, OFF_ROTATION = 0.1, np.radians(10.0)
"""By how much the expected pose is wrong [m, rad]."""
LEAST_CONTRAST = 8.0
"""Least `contrast` of a hand that is said to be visible."""
CONTRASTS = (16.0, 32.0, 64.0)
"""Edges of groups of contrasts."""
TABLE_CLEARANCE = 0.02
"""Least height of the hand's geoms above the table [m]."""


@dataclass(frozen=True)
class Frame:
    """A frame with what is true about it.

    Attributes:
        seed: of the frame.
        kind: `SEEN`, `HIDDEN` or `NONE`.
        image: (480, 640, 3) uint8.
        truth: pose of the hand in the camera that took the frame (4, 4).
        expected: the same, `OFF_POSITION` and `OFF_ROTATION` off in random directions.
        camera: that took it; a detector knows its distortion, and not its focal length.
        visible: pixels of the hand.
        families: what the frame has of each kind of appearance, by kind.
    """

    seed: int
    kind: str
    image: Image
    truth: Floats
    expected: Floats
    camera: ActualCamera
    visible: Visible
    families: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Style:
    """How a frame is rendered and taken.

    Attributes:
        fine: whether with shadows and anti-aliasing.
        tendons: whether tendons are rendered.
        optics: faults of the camera.
    """

    fine: bool
    tendons: bool
    optics: Optics


def kind_of(seed: int) -> str:
    """Kind of a frame by its seed."""
    return {8: HIDDEN, 9: NONE}.get(seed % 10, SEEN)


def make_frame(studio: Studio, seed: int) -> Frame:
    """Set up a studio by a seed, and take the frame."""
    style, visible, families = set_up(studio, seed)
    image = expose(studio.picture(style.fine, style.tendons), style.optics)
    return camera_frame(studio, seed, kind_of(seed), image, visible, families)


def contrast(studio: Studio, style: Style, visible: Visible) -> float:
    """By how much the hand changes the frame, mean over its pixels [0, 255].

    Without faults of the camera but exposure and colour, and with the shadows that the hand casts.
    """
    ideal = replace(style.optics, motion=(0.0, 0.0), defocus=0.0, noise=(0.0, 0.0), quality=None)
    without = geoms_left_out(studio.hand)
    frames = [
        expose(studio.picture(False, False, decorate), ideal).astype(float)
        for decorate in (None, without)
    ]
    return float(np.abs(frames[0] - frames[1]).mean(axis=2).sum() / (4.0 * visible.hand))


def camera_frame(
    studio: Studio, seed: int, kind: str, image: Image, visible: Visible, families: dict[str, str]
) -> Frame:
    """A frame that was taken of a studio as it is set up now."""
    truth = studio.hand_pose()
    expected = shifted(truth, np.random.default_rng([seed, 3803]))
    return Frame(seed, kind, image, truth, expected, studio.camera, visible, families)


def set_up(studio: Studio, seed: int) -> tuple[Style, Visible, dict[str, str]]:
    """Set up a studio for the frame of a seed."""
    camera = np.random.default_rng([seed // SAME_CAMERA, 3802])
    k1 = float(camera.uniform(-LARGEST_K1, LARGEST_K1)) if camera.uniform() < 0.5 else 0.0
    studio.set_camera(seed // SAME_CAMERA, k1)
    for attempt in range(TRIES):
        style, visible, families = _sample(studio, seed, attempt)
        if kind_of(seed) == NONE:
            return style, visible, families | {"contrast": "no hand"}
        amount = contrast(studio, style, visible)
        if amount >= LEAST_CONTRAST:
            return style, visible, families | {"contrast": _contrast_group(amount)}
    raise RuntimeError(f"no appearance was found in which the frame {seed} shows the hand")


def _contrast_group(amount: float) -> str:
    return next(
        (f"below {edge:g}" for edge in CONTRASTS if amount < edge), f"from {CONTRASTS[-1]:g}"
    )


def _sample(studio: Studio, seed: int, attempt: int) -> tuple[Style, Visible, dict[str, str]]:
    kind, rng = kind_of(seed), np.random.default_rng([seed, 3801, attempt])
    families = studio.appearance.write(rng)
    scatter(studio.model, rng)
    arm_wanted = bool(rng.uniform() < 0.6)
    source = SET if kind != NONE and rng.uniform() < 0.6 else RANGES
    for _ in range(TRIES):
        found = pose_robot(studio, rng, kind, source)
        if found is None:
            continue
        visible = studio.visible()
        if _fits(kind, visible, arm_wanted):
            break
    else:
        raise RuntimeError(f"no scene of the kind {kind!r} was found for the frame {seed}")
    families |= found
    style = sample_style(rng, families["light"])
    families |= {"camera": style.optics.fault, "rendered": "fine" if style.fine else "plain"}
    return style, visible, families


def _fits(kind: str, visible: Visible, arm_wanted: bool) -> bool:
    """Whether a scene is of a kind."""
    if kind == NONE:
        return visible.hand == 0 and (visible.arm > 300 or not arm_wanted)
    enough = visible.hand >= FEWEST
    return enough and (visible.share >= 0.5) == (kind == SEEN)


def sample_style(rng: Random, light: str) -> Style:
    """Sample how a frame in a kind of light is rendered and taken."""
    ranges = {"dim": (0.13, 0.22), "overexposed": (0.64, 0.78), "hard lamp": (0.25, 0.45)}
    mean = float(rng.uniform(*ranges.get(light, (0.34, 0.55))))
    fine = bool(light == "hard lamp" or rng.uniform() < 0.7)
    return Style(fine, bool(rng.uniform() < 0.2), sample_optics(rng, mean))


def pose_robot(studio: Studio, rng: Random, kind: str, source: str) -> dict[str, str] | None:
    """Sample posture, can and what is before the hand; None if the kind is not possible."""
    clear_before(studio.model)
    studio.set_robot(sample_posture(studio, rng, source), sample_fingers(rng))
    cut = kind == HIDDEN and rng.uniform() < 0.5
    if not hand_is_possible(studio, kind, cut):
        return None
    can = _put_can(studio, rng)
    cover = "nothing"
    if (kind == HIDDEN and not cut) or (kind == SEEN and rng.uniform() < 0.25):
        size = rng.uniform(0.6, 1.6) if kind == HIDDEN else rng.uniform(0.15, 0.6)
        eye = studio.camera_pose()[:3, 3]
        put_before(studio.model, rng, eye, studio.hand_middle(), float(size))
        cover = "an object"
    studio.update()
    return {"posture": source, "can": can, "before the hand": cover}


def sample_posture(studio: Studio, rng: Random, source: str) -> Floats:
    """A posture (14,) [rad], near one of the posture set or anywhere in the joint ranges."""
    low, high = studio.ranges.T
    if source == RANGES:
        return np.asarray(rng.uniform(low, high))
    postures = posture_set()
    posture = postures[rng.integers(len(postures))] + np.radians(3.0) * rng.standard_normal(14)
    if rng.uniform() < 0.5:  # not with the hand in the middle of the frame
        posture[:3] += np.radians((9.0, 9.0, 6.0)) * rng.standard_normal(3)
    return np.clip(posture, low, high)


def sample_fingers(rng: Random) -> Floats:
    """Angles of the fingers' joints (4,) [rad]: open, or closed in part."""
    if rng.uniform() < 0.75:
        return np.radians(rng.uniform(0.0, 4.0, 4))
    closed = rng.uniform(0.1, 0.7, 4)
    return np.radians((75.0, 77.0, 65.0, 70.0)) * closed


def hand_is_possible(studio: Studio, kind: str, cut: bool) -> bool:
    """Whether the hand is above the table, and where a kind of frame needs it; quickly."""
    geoms = studio.data.geom_xpos[studio.hand]
    table = studio.model.geom("table_top")
    top = studio.model.body("table").pos
    over = np.all(np.abs(geoms[:, :2] - top[:2]) < table.size[:2] + 0.03, axis=1)
    if np.any(geoms[over, 2] < top[2] + TABLE_CLEARANCE):
        return False
    if kind == NONE:
        return True
    middle = np.linalg.inv(studio.camera_pose()) @ np.append(studio.hand_middle(), 1.0)
    pixel = studio.camera.project(middle[:3])
    if not np.isfinite(pixel).all():
        return False
    inside = float(np.min(np.concatenate([pixel, (WIDTH, HEIGHT) - pixel])))
    return abs(inside) < 60.0 if cut else inside > 0.0


def _put_can(studio: Studio, rng: Random) -> str:
    """Put the can on the table, before the hand or into it; where it is."""
    where = str(rng.choice(["on the table", "before the hand", "in the hand"], p=[0.8, 0.1, 0.1]))
    height = studio.model.geom("can").size[1] + studio.model.body("table").pos[2]
    if where == "on the table":
        studio.put_can(np.array([*rng.uniform(CAN_AREA[:, 0] - 0.1, CAN_AREA[:, 1] + 0.1), height]))
    elif where == "in the hand":
        studio.put_can(studio.data.site("grip").xpos.copy())
    else:
        eye, hand = studio.camera_pose()[:3, 3], studio.hand_middle()
        share = rng.uniform(0.6, 0.85)
        aside = 0.04 * rng.standard_normal(3)
        studio.put_can(eye + share * (hand - eye) + aside)
    return where


def shifted(pose: Floats, rng: Random) -> Floats:
    """A pose (4, 4), moved by `OFF_POSITION` and turned by `OFF_ROTATION` in random directions."""
    move, turn = rng.standard_normal((2, 3))
    result = pose.copy()
    result[:3, 3] += OFF_POSITION * move / np.linalg.norm(move)
    rotation = Rotation.from_rotvec(OFF_ROTATION * turn / np.linalg.norm(turn))
    result[:3, :3] = rotation.as_matrix() @ pose[:3, :3]
    return result
