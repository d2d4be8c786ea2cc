"""File of a hand detector: two networks as ONNX, and what they are about as JSON, in a zip archive.

Nothing in it is executed: OpenCV reads the networks, and no pickle is loaded.
"""

from __future__ import annotations

import json
import lzma
import os
import zipfile
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from mjcf_sandbox.files import whole_file

FORMAT = "hand-detector-1"
FINDER, POINTS, MODEL = "finder.onnx", "points.onnx", "hand.json"
LARGEST = 64 * 2**20
"""Larger files are refused [bytes]."""
SIZES = (32, 1024)
"""Range of the size of crops [px]."""
FOCAL = (10.0, 1e4)
"""Range of the focal length of the finder's frames [px]."""
RADII = (1e-3, 10.0)
"""Range of the distance of a hand's farthest point from its middle [m]."""
FACTORS = (1e-6, 1e6)
"""Range of the factors of standard deviations [1]."""

_UNREADABLE = (
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, OSError,
    KeyError, ValueError, RecursionError, RuntimeError,
)  # fmt: skip
"""What zipfile and json raise for damaged, encrypted and other archives."""


@dataclass(frozen=True)
class HandModel:
    """What the networks of a hand detector are about.

    Attributes:
        body: name of the hand's frame.
        points: of the hand that are located, in its axes (n, 3) [m].
        size: of the crops [px].
        finder_focal: focal length of the frames in which the hand is searched [px].
        threshold: least score of a hand in a frame [0, 1].
        position_factor: by which the standard deviations of positions are multiplied [1].
        rotation_factor: the same of rotations [1].
        made_by: command that trained the networks.
    """

    body: str
    points: tuple[tuple[float, float, float], ...]
    size: int
    finder_focal: float
    threshold: float = 0.5
    position_factor: float = 1.0
    rotation_factor: float = 1.0
    made_by: str = ""

    @property
    def array(self) -> Floats:
        """The points (n, 3) [m]."""
        return np.array(self.points, dtype=float)

    @property
    def centre(self) -> Floats:
        """Middle of the hand in its axes (3,) [m]."""
        return middle_of(self.array)

    @property
    def radius(self) -> float:
        """Distance of the farthest point from the middle [m]."""
        return radius_of(self.array)


def middle_of(points: Floats) -> Floats:
    """Middle of the box around points (n, 3), which is what views of a hand look at (3,) [m]."""
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2.0)


def radius_of(points: Floats) -> float:
    """Distance of the farthest of points (n, 3) from their middle [m]."""
    return float(np.linalg.norm(points - middle_of(points), axis=1).max())


def write_hand_model(path: Path, model: HandModel, finder: bytes, points: bytes) -> None:
    """Write the file of a hand detector.

    Args:
        path: of the file; one that is there is replaced.
        model: what the networks are about.
        finder: network that finds the hand in a frame, as ONNX.
        points: network that locates its points in a crop, as ONNX.
    """
    with (
        whole_file(path) as beside,
        zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for name, content in (
            (MODEL, json.dumps({"format": FORMAT, **asdict(model)}, indent=1).encode()),
            (FINDER, finder),
            (POINTS, points),
        ):
            # A fixed date: the same networks give the same bytes.
            archive.writestr(zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), content)


def read_hand_model(path: str | os.PathLike[str]) -> tuple[HandModel, bytes, bytes]:
    """What a file of a hand detector holds: model, finder and points as ONNX.

    Args:
        path: of a file of `write_hand_model`.

    Raises:
        AgentError: there is no such file, or it is not one of a hand detector.
    """
    if not isinstance(path, str | os.PathLike):
        raise AgentError(f"The file of a hand detector is {path!r}, but must be a path.")
    path = Path(path)
    if not path.is_file():
        raise AgentError(
            f"There is no hand detector {path}: `kengoro hand-detector` trains one and writes it."
        )
    try:
        with zipfile.ZipFile(path) as archive:
            large = sum(info.file_size for info in archive.infolist()) > LARGEST
            contents = [] if large else [archive.read(name) for name in (MODEL, FINDER, POINTS)]
        found = json.loads(contents[0]) if contents else None
    except _UNREADABLE as error:
        raise AgentError(f"{path} is no file of a hand detector ({error}).") from error
    if large:
        raise AgentError(f"{path} is larger than a hand detector's {LARGEST >> 20} MiB.")
    return _model(path, found), contents[1], contents[2]


def _model(path: Path, found: Any) -> HandModel:
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise AgentError(f"{path}: {MODEL} must have the format {FORMAT}; train the detector anew.")
    try:
        points = np.array(found["points"], dtype=float)
        rest = {name: value for name, value in found.items() if name not in ("format", "points")}
        model = HandModel(points=tuple(map(tuple, points.tolist())), **rest)
        if not (points.ndim == 2 and points.shape[1] == 3 and len(points) >= 4):
            raise ValueError("points must be four or more places of three numbers")
        _check(model)
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        raise AgentError(f"{path}: {MODEL} is not valid ({error}).") from error
    return model


def _check(model: HandModel) -> None:
    """Refuse values with which no hand can be found."""
    if not (isinstance(model.body, str) and model.body and isinstance(model.made_by, str)):
        raise ValueError("body and made_by must be texts")
    if not np.isfinite(model.array).all():
        raise ValueError("points must be finite")
    if type(model.size) is not int:
        raise ValueError(f"size is {model.size!r}, but must be a whole number")
    for name, value, (least, most) in (
        ("size", model.size, SIZES),
        ("finder_focal", model.finder_focal, FOCAL),
        ("threshold", model.threshold, (1e-3, 1.0)),
        ("position_factor", model.position_factor, FACTORS),
        ("rotation_factor", model.rotation_factor, FACTORS),
        ("the radius of the points", model.radius, RADII),
    ):
        if type(value) not in (int, float) or not least <= value <= most:  # NaN: not in a range
            raise ValueError(f"{name} is {value!r}, but must be in {least} to {most}")
