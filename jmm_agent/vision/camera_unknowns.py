"""Errors of the camera as unknowns of the fit: its mounting, its focal length and its lens.

A camera that is mounted a little otherwise, or whose lens distorts, misses all poses of the marker
in a way that eight numbers b describe: offset [m] and rotation vector [rad] of its mounting, error
of its focal length [1], and the coefficient k1 of a radial distortion [1], with which a ray of the
slope s is seen at

    s' = (1 + focal) (1 + k1 |s|^2) s.

`corrected` undoes them: it moves the marker's corners as they were seen, and finds the pose again.
A fit of observations linearises this about the present estimate (`camera_columns`), and integrates
b out, see `jmm_agent.vision.pose_errors`.

Kawaharazuka et al. 2018 believe the camera; these unknowns are ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.marker_observation import MarkerObservation
from jmm_agent.vision.square_pose import corner_slopes, square_corners

UNKNOWNS = 8
"""Number of unknowns: offset, rotation, focal length, lens."""
SIDE = 0.1
"""Side of the square that stands for the marker, as a share of its distance; poses that are found
again hardly depend on it [1]. A cube of the same side stands for a hand without a marker, because a
square that is seen from its edge has no pose."""
STEPS = 8
"""Steps that find a pose, and the slopes before a lens, again."""
SETTLED = 1e-9
"""Change of a pose that ends the search for it [m, rad]."""
MOST_SHRUNK = 0.25
"""Largest share by which a lens shrinks a slope [1]: from a third on, it would fold the image. What
is farther out is shrunk by as much."""


@dataclass(frozen=True)
class CameraPrior:
    """Standard deviations of the camera's errors before anything was seen.

    Attributes:
        position: of its mounting along each axis [m].
        rotation: of its mounting about each axis [rad].
        focal: of its focal length, as a share of it [1].
        lens: of the coefficient k1 of a radial distortion that the agent does not know [1].

    Raises:
        AgentError: a number is negative or not finite.
    """

    position: float = 0.004
    rotation: float = 0.01
    focal: float = 0.006
    lens: float = 0.1

    def __post_init__(self) -> None:
        if not all(0.0 <= one < np.inf for one in self.widths):
            raise AgentError(
                f"CameraPrior: the standard deviations are {self.widths.tolist()}, but must be "
                "finite and at least 0."
            )

    @property
    def widths(self) -> Floats:
        """Standard deviation of each unknown (8,) [m, rad, 1, 1]."""
        return np.array([self.position] * 3 + [self.rotation] * 3 + [self.focal, self.lens])

    @property
    def enabled(self) -> bool:
        """Whether anything of the camera is unknown."""
        return bool(self.widths.any())


NOT_UNKNOWN = CameraPrior(0.0, 0.0, 0.0, 0.0)
"""The camera is right, or there is none."""


def camera_of(residual: object) -> str | None:
    """Frame of the camera that shows the poses of a residual, as `MarkerResidual` says.

    Args:
        residual: of the marker's pose.

    Returns:
        Its name; None if no camera shows them.
    """
    camera: str | None = getattr(residual, "camera", None)
    return camera or None


def is_shown(found: MarkerObservation, camera: str | None) -> bool:
    """Whether the pose of an observation is one in the camera: a marker's, or another frame's.

    Args:
        found: the observation.
        camera: the camera's frame; None if there is none.
    """
    return found.frames is None or (camera is not None and found.frames[1] == camera)


def corrected(pose: Floats, unknowns: Floats, solid: bool = False) -> Floats:
    """Pose (4, 4) in the camera as it is believed to be, from the pose that a camera showed.

    Args:
        pose: of the marker by the camera as it is modelled (4, 4).
        unknowns: errors of the camera (8,) [m, rad, 1, 1].
        solid: whether it is the pose of a solid body, which all its points show, and of no marker.
    """
    focal, lens = unknowns[6:].tolist()
    return _mounted(_seen_straight(pose, focal, lens, solid), unknowns[:6])


def corrected_observations(
    observations: Sequence[MarkerObservation], unknowns: Floats | None, camera: str | None
) -> list[MarkerObservation]:
    """Observations whose poses are those in the camera as it is believed to be.

    Poses of other frames than the camera's stay.

    Args:
        observations: K observations.
        unknowns: errors of the camera (8,) [m, rad, 1, 1]; None: unknown yet.
        camera: its frame, see `camera_of`.
    """
    if unknowns is None:
        return list(observations)
    return [
        found._replace(pose=corrected(found.pose, unknowns, found.frames is not None))
        if is_shown(found, camera)
        else found
        for found in observations
    ]


def _mounted(pose: Floats, mounting: Floats) -> Floats:
    """Pose (4, 4) in a camera that is mounted otherwise, by offset and rotation vector (6,)."""
    turn = cv2.Rodrigues(mounting[3:])[0]
    moved = np.eye(4)
    moved[:3, :3], moved[:3, 3] = turn @ pose[:3, :3], turn @ pose[:3, 3] + mounting[:3]
    return moved


def _body(pose: Floats, solid: bool) -> Floats:
    """Points (N, 3) [m] that stand for what is seen at a pose: a square, or a cube."""
    square = square_corners(SIDE * float(np.linalg.norm(pose[:3, 3])))
    if not solid:
        return square
    depth = np.array([0.0, 0.0, square[0, 1]])
    return np.vstack([square - depth, square + depth])


def _seen_straight(pose: Floats, focal: float, lens: float, solid: bool) -> Floats:
    """Pose of a body whose points are moved to where an ideal camera sees them; not to be changed.

    After each look many problems are compared that believe the same of the camera.
    """
    if not (focal or lens):
        return pose
    return _straightened(np.asarray(pose, dtype=float).tobytes(), focal, lens, solid)


@lru_cache(maxsize=1024)
def _straightened(content: bytes, focal: float, lens: float, solid: bool) -> Floats:
    """See `_seen_straight`; the pose as its bytes."""
    pose = np.frombuffer(content).reshape(4, 4)
    square = _body(pose, solid)
    points = square @ pose[:3, :3].T + pose[:3, 3]
    if points[:, 2].min() <= 0.0:
        return pose  # no camera shows it
    straight = _unbent(points[:, :2] / points[:, 2:] / (1.0 + focal), lens)
    for _ in range(STEPS):
        missed = _missed(pose, square, straight)
        slopes = corner_slopes(pose, square, np.eye(3))
        step = np.asarray(np.linalg.lstsq(slopes, missed.ravel(), rcond=None)[0], dtype=float)
        while np.abs(step).max() >= SETTLED:
            moved = _stepped(pose, step)
            if np.sum(_missed(moved, square, straight) ** 2) < np.sum(missed**2):
                pose = moved
                break
            step = step / 2.0
        else:
            break
    pose = pose.copy()
    pose.setflags(write=False)
    return pose


def _missed(pose: Floats, body: Floats, slopes: Floats) -> Floats:
    """What the points (N, 3) of a body at a pose miss of the slopes (N, 2) that show them; infinite
    if a point is behind the camera."""
    points = body @ pose[:3, :3].T + pose[:3, 3]
    if points[:, 2].min() <= 0.0:
        return np.full_like(slopes, np.inf)
    return np.asarray(slopes - points[:, :2] / points[:, 2:])


def _stepped(pose: Floats, step: Floats) -> Floats:
    """A pose moved and turned by a step (6,) in its own axes."""
    moved = pose.copy()
    moved[:3, 3] += pose[:3, :3] @ step[:3]
    moved[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(step[3:])[0]
    return moved


def _unbent(seen: Floats, lens: float) -> Floats:
    """Slopes (N, 2) of the rays that a lens shows at given slopes (N, 2)."""
    shown = np.linalg.norm(seen, axis=1, keepdims=True)
    most = np.sqrt(MOST_SHRUNK / max(-lens, np.finfo(float).tiny))
    inner = shown < (1.0 - MOST_SHRUNK) * most
    long = np.where(inner, shown, 0.0)
    for _ in range(STEPS):
        missed = long * (1.0 + lens * long**2) - np.where(inner, shown, 0.0)
        long = long - missed / (1.0 + 3.0 * lens * long**2)
    return np.where(inner, seen / (1.0 + lens * long**2), seen / (1.0 - MOST_SHRUNK))


def camera_columns(pose: Floats, unknowns: Floats, solid: bool = False) -> Floats:
    """Change (6, 8) of the residual of a corrected pose by each error of the camera.

    Args:
        pose: of the marker, as the camera showed it (4, 4).
        unknowns: errors of the camera (8,) [m, rad, 1, 1] about which the change counts.
        solid: see `corrected`.

    Returns:
        Offset [m] and rotation vector [rad] in the axes of the corrected marker, a column each.
    """
    focal, lens = (float(one) for one in unknowns[6:])
    straight = _seen_straight(pose, focal, lens, solid)
    here = _mounted(straight, unknowns[:6])
    axes, arm = here[:3, :3].T, here[:3, 3] - unknowns[:3]
    columns = np.zeros((6, UNKNOWNS))
    columns[:3, :3], columns[3:, 3:6] = axes, axes
    columns[:3, 3:6] = axes @ np.cross(np.eye(3), arm).T
    square = _body(straight, solid)
    points = square @ straight[:3, :3].T + straight[:3, 3]
    if points[:, 2].min() <= 0.0:
        return columns  # no camera shows it: focal length and lens have not moved it
    slopes = points[:, :2] / points[:, 2:]
    moved = np.zeros((len(square), 2, 2))
    for corner, slope in enumerate(slopes):
        bent, long = lens, float(slope @ slope)
        size = 1.0 + bent * long
        if size < 1.0 - MOST_SHRUNK:
            size, bent, long = 1.0 - MOST_SHRUNK, 0.0, 0.0
        grown = size * np.eye(2) + 2.0 * bent * np.outer(slope, slope)
        shifts = np.column_stack([size / (1.0 + focal) * slope, long * slope])
        moved[corner] = -np.linalg.solve(grown, shifts)
    by_slopes = corner_slopes(straight, square, np.eye(3))
    columns[:, 6:] = np.linalg.lstsq(by_slopes, moved.reshape(-1, 2), rcond=None)[0]
    return columns
