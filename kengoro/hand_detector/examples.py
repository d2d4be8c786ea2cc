"""Examples for the networks of a hand detector: frames made small, and crops around the hand.

They are made in processes of their own, which draw, and lie in files of `CHUNK` frames: a run that
was stopped goes on with the files that are missing. The seed of a frame is its number.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jmm_agent.mapping.array_file import write_arrays
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.crop_view import MARGIN, CropView, looking_at, roll_of
from jmm_agent.vision.hand_detector import STRIDE, TrainedHandDetector, finder_input
from kengoro.hand_detector.frames import Frame, FrameMaker, develop, load_model
from kengoro_env.types import Floats

CHUNK = 250
"""Number of frames in a file."""
CROPS = 4
"""Number of crops of a frame."""
PRESENT, ABSENT = 0.3, 0.03
"""A hand of which this share and more is visible is there; one of less than the other is not [1].
Frames between are not learned from."""
FINDER_FOCAL = 145.0
"""Focal length of the finder's frames [px]."""
ELSEWHERE = 0.12
"""Share of the crops that show another place, in frames that show the hand [1]."""
FAR = 2.0
"""Such a place is this far from the hand [half widths of a crop]."""
NEAR, TWICE = 0.6, 2.0
"""A view that a finder offers shows the hand if its middle is nearer to it than this [half widths
of a crop], and its width right within this factor [1]."""


@dataclass(frozen=True)
class Source:
    """What frames are made of.

    Attributes:
        model: path of the MJCF.
        body: name of the hand's body.
        camera: name of the camera.
        hidden: names of geoms that are not drawn, as a marker on the hand.
        size: of the crops [px].
        count: number of points of the hand.
        seed: of textures and frames.
    """

    model: Path
    body: str
    camera: str
    hidden: tuple[str, ...] = ()
    size: int = 128
    count: int = 32
    seed: int = 0

    def maker(self, others: bool = False) -> FrameMaker:
        """Makes frames of the model.

        Args:
            others: whether with other textures than those of the examples.
        """
        textures = np.random.default_rng([self.seed, 4 if others else 1])
        model = load_model(self.model, textures, self.hidden)
        return FrameMaker(model, self.body, self.camera, self.count)


class Jitter(NamedTuple):
    """How far the crops of a kind are from the right ones; standard deviations.

    Attributes:
        centre: of the middle [radii of the hand].
        scale: of the logarithm of the width [1].
        roll: of the turn about the line of sight [rad]; None: the view is not turned.
    """

    centre: float
    scale: float
    roll: float | None


JITTERS = (Jitter(0.30, 0.20, None), Jitter(0.12, 0.10, 0.25))
"""Of crops around what the finder found, and around what the first crop showed."""


def jittered_view(
    middle: Floats, rotation: Floats, radius: float, size: int, jitter: Jitter,
    random: np.random.Generator,
) -> CropView:  # fmt: skip
    """A view of a hand that is as far from the right one as an estimate.

    Args:
        middle: of the hand in the camera (3,) [m].
        rotation: of the hand in the camera (3, 3).
        radius: of the hand [m].
        size: of the crop [px].
        jitter: how far the view may be off.
        random: source of it.
    """
    moved = middle + radius * jitter.centre * random.normal(0.0, 1.0, 3) * [1.0, 1.0, 0.0]
    slope = MARGIN * radius / np.linalg.norm(middle) * np.exp(jitter.scale * random.normal())
    view = looking_at(moved, slope, size)
    if jitter.roll is None:
        return view
    roll = roll_of(view.rotation.T @ rotation) + jitter.roll * random.normal()
    return looking_at(moved, slope, size, roll)


def make_chunk(
    source: Source, number: int, folder: Path, count: int = CHUNK, finder: Path | None = None
) -> int:
    """Write the examples of some frames into a file, unless it is there.

    Args:
        source: what the frames are made of.
        number: of the file.
        folder: of the files.
        count: number of frames.
        finder: file of a detector. Up to half of the crops show the places that its finder offers,
            as in use: beside the hand, or at what only resembles one.

    Returns:
        Number of frames that show the hand.
    """
    path = chunk_path(folder, number)
    if path.exists():
        with np.load(path) as stored:
            return int(stored["cells"][:, 3].sum())
    maker = source.maker()
    camera = Camera.from_fovy(maker.width, maker.height, maker.fovy)
    offers = None if finder is None else TrainedHandDetector(camera, finder).views
    rows: dict[str, list[object]] = {
        name: [] for name in ("small", "cells", "crops", "positions", "present")
    }
    for frame_number in range(number * CHUNK, number * CHUNK + count):
        random = np.random.default_rng([source.seed, 2, frame_number])
        frame = maker.make(random)
        frame = frame._replace(image=develop(frame.image, random))
        if ABSENT <= frame.visible < PRESENT:
            continue
        small, cells = _finder_example(frame, maker, camera)
        rows["small"].append(small)
        rows["cells"].append(cells)
        views: list[tuple[CropView | None, bool | None]] = [
            _view(frame, maker, source.size, JITTERS[turn % 2], random) for turn in range(CROPS)
        ]
        if offers is not None:
            offered = [view._replace(size=source.size) for view in offers(frame.image)]
            views[: len(offered)] = [(view, shows(view, frame, maker)) for view in offered]
        for view, there in views:
            if view is None or there is None:
                continue
            rows["crops"].append(view.cut(frame.image, camera))
            positions = view.project(frame.points_in_camera(maker.points))
            middle = (source.size - 1) / 2.0
            rows["positions"].append(
                ((positions - middle) / (source.size / 2.0)).astype(np.float32)
            )
            rows["present"].append(np.float32(there))
    arrays = {name: np.array(values) for name, values in rows.items()}
    write_arrays(path, arrays)
    return int(arrays["cells"][:, 3].sum())


def chunk_path(folder: Path, number: int) -> Path:
    """Path of a file of examples."""
    return folder / f"examples_{number:05d}.npz"


def _finder_example(frame: Frame, maker: FrameMaker, camera: Camera) -> tuple[np.ndarray, Floats]:
    """The frame made small; of the hand: column, row [cells], log slope, whether it is there."""
    factor = FINDER_FOCAL / camera.fx
    small = finder_input(frame.image, factor)
    if frame.visible < PRESENT:
        return small, np.zeros(4, dtype=np.float32)
    middle = frame.middle(maker.centre)
    pixel = (camera.project(middle) + 0.5) * factor - 0.5
    column, row = (pixel + 0.5) / STRIDE - 0.5
    slope = MARGIN * maker.radius / float(np.linalg.norm(middle))
    return small, np.array([column, row, np.log(slope), 1.0], dtype=np.float32)


def _view(
    frame: Frame, maker: FrameMaker, size: int, jitter: Jitter, random: np.random.Generator
) -> tuple[CropView | None, bool]:
    """A view of the hand, or of another place; whether it shows the hand."""
    middle, rotation = frame.middle(maker.centre), frame.pose[:3, :3]
    if frame.visible >= PRESENT and random.random() >= ELSEWHERE:
        return jittered_view(middle, rotation, maker.radius, size, jitter, random), True
    elsewhere = _elsewhere(frame, random)
    view = jittered_view(elsewhere, np.eye(3), maker.radius, size, JITTERS[0], random)
    if frame.visible >= ABSENT:
        off = view.slopes(view.project(middle)) / view.slope if middle[2] > 0.0 else FAR
        if np.linalg.norm(off) < FAR:
            return None, False
    return view, False


def shows(view: CropView, frame: Frame, maker: FrameMaker) -> bool | None:
    """Whether a finder's view shows the hand; None if a part of it, or in a wrong size."""
    if frame.visible < ABSENT:
        return False
    middle = frame.middle(maker.centre)
    if (middle @ view.rotation)[2] <= 0.0:
        return False
    off = float(np.linalg.norm(view.slopes(view.project(middle)) / view.slope))
    if off >= FAR:
        return False
    right = MARGIN * maker.radius / float(np.linalg.norm(middle))
    return True if off < NEAR and 1.0 / TWICE < view.slope / right < TWICE else None


def _elsewhere(frame: Frame, random: np.random.Generator) -> Floats:
    """A point of the frame (3,) [m]: of the robot or of what is around, or anywhere."""
    x, y, z = frame.others.T
    seen = (z > 0.15) & (np.abs(x) < 0.5 * z) & (np.abs(y) < 0.4 * z)
    if seen.any() and random.random() < 0.5:
        return np.asarray(frame.others[random.choice(np.flatnonzero(seen))])
    ray = np.array([*random.uniform([-0.5, -0.4], [0.5, 0.4]), 1.0])
    return ray * random.uniform(0.25, 0.8)
