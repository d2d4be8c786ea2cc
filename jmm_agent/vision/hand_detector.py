"""Finds a robot's hand in a camera frame without a marker, by two networks (Kawaharazuka et al.
2018, future work of sec. V).

1. The *finder* gives places in the frame at which a hand may be, and how large it is.
2. A virtual camera looks at each place (`CropView`), and the *points network* locates points of the
   hand in that crop, each with a covariance. Their pose follows (`weighted_pnp`). Further crops,
   in which the hand is upright and centred, make it finer.

Where the joints expect the hand is one more place to look at, and not trusted: a pose is accepted
for what the crop shows.
"""

from __future__ import annotations

import os
import threading
from typing import NamedTuple

import cv2
import numpy as np
from scipy.special import expit

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.crop_view import CropView, hand_view, looking_at
from jmm_agent.vision.hand_detection import HandDetection, HandSkip
from jmm_agent.vision.hand_model_file import HandModel, read_hand_model
from jmm_agent.vision.marker_input import check_frame
from jmm_agent.vision.weighted_pnp import PointsPose, solve_points

DARK = 12
"""A frame without a brighter value is black [0, 255]."""
STRIDE = 8
"""Pixels of the finder's input along a cell of its output."""
MOST_VIEWS = 2
"""Number of places in a frame that are looked at, besides the expected one."""
UNCLEAR = 0.3
"""A hand with this share of the least score may be there, but gives no pose [1]."""
LEAST_SCORE = 0.1
"""The finder's score from which on a place is looked at [0, 1]."""
TURNS = 3
"""Number of crops of each place; each is cut around the pose that the one before gave."""
HOPELESS = 0.02
"""A place whose first crop has a smaller score than this is not looked at again [0, 1]."""
SPREAD = (-2.0, 6.0)
"""Range of the logarithms of the diagonal of a point's whitening matrix."""
SAME = 0.5
"""Hands nearer to each other than this across the line of sight are one [radii]."""
SECOND_HAND = 0.3
"""A second hand with this share of the first one's score makes the frame ambiguous [1]."""


class Candidate(NamedTuple):
    """A hand that may be in a frame.

    Attributes:
        detection: its pose.
        score: how sure the points network is that the hand is there [0, 1]. It is the logistic
            function of its output's mean over all crops of the place.
    """

    detection: HandDetection
    score: float


class TrainedHandDetector:
    """Finds the hand in frames of a camera, see `HandDetector`.

    Args:
        camera: model of the camera that the frames come from.
        path: file of the detector, see `hand_model_file`.

    Attributes:
        frame: name of the hand's frame, whose pose is given.

    Raises:
        AgentError: there is no camera, or the file is missing or not valid.
    """

    def __init__(self, camera: Camera, path: str | os.PathLike[str]) -> None:
        if not isinstance(camera, Camera):
            raise AgentError(f"A hand detector needs a Camera, got {type(camera).__name__}.")
        self._camera, self._path = camera, path
        # OpenCV's networks keep what they compute, so that one thread at a time may use them.
        self._lock = threading.Lock()
        self._model, finder, points = read_hand_model(path)
        self._finder, self._points = (_network(path, content) for content in (finder, points))
        self._hand = self._model.array
        self.frame = self._model.body
        self._check_networks()

    def _check_networks(self) -> None:
        """Refuse networks whose outputs are not those that the file describes."""
        frame = np.zeros((8 * STRIDE, 10 * STRIDE, 3), dtype=np.uint8)
        crop = np.zeros((self._model.size, self._model.size, 3), dtype=np.uint8)
        count = len(self._hand)
        try:
            cells, points = _run(self._finder, frame), _run(self._points, crop)
        except cv2.error as error:
            raise AgentError(
                f"The networks in {self._path} do not take a frame, or crops of "
                f"{self._model.size} px, as the file says."
            ) from error
        if cells.ndim != 4 or cells.shape[:2] != (1, 4) or points.size != 5 * count + 1:
            raise AgentError(
                f"The networks in {self._path} have outputs of the shapes {cells.shape} and "
                f"{points.shape}, but (1, 4, rows, columns) and (1, {5 * count + 1}) belong to the "
                f"file's {count} points."
            )

    def __deepcopy__(self, memo: dict[int, object]) -> TrainedHandDetector:
        """Itself: it remembers nothing of a frame."""
        return self

    def __reduce__(self) -> tuple[type[TrainedHandDetector], tuple[Camera, str | os.PathLike[str]]]:
        return TrainedHandDetector, (self._camera, self._path)

    @property
    def model(self) -> HandModel:
        """What the networks are about."""
        return self._model

    def shows(self, pose: np.ndarray) -> bool:
        """Whether a frame would show all points of the hand at a pose in the camera (4, 4).

        Raises:
            AgentError: it is no pose of the shape (4, 4).
        """
        pose = _pose(pose)
        pixels = self._camera.project(self._hand @ pose[:3, :3].T + pose[:3, 3])
        size = np.array([self._camera.width - 1.0, self._camera.height - 1.0])
        return bool(np.all((pixels >= 0.0) & (pixels <= size)))  # NaN: no

    def detect(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> HandDetection | HandSkip:
        """The pose of the hand in a frame, or why there is none.

        Args:
            frame_rgb: (H, W, 3) uint8.
            expected: predicted pose_hand_in_camera (4, 4): where to look, too.

        Raises:
            AgentError: the frame or the predicted pose has a wrong shape or type.
        """
        found = self.hands(frame_rgb, expected)
        if isinstance(found, HandSkip):
            return found
        return found[0] if len(found) == 1 else HandSkip.TWICE

    def hands(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> tuple[HandDetection, ...] | HandSkip:
        """All hands in a frame, the surest one first, or why there is none; see `detect`."""
        check_frame(frame_rgb, self._camera)
        if frame_rgb.max() <= DARK:
            return HandSkip.DARK
        found = sorted(self.candidates(frame_rgb, expected), key=lambda each: -each.score)
        if not found or found[0].score < UNCLEAR * self._model.threshold:
            return HandSkip.NOT_SEEN
        if found[0].score < self._model.threshold:
            return HandSkip.UNCLEAR
        least = max(self._model.threshold, SECOND_HAND * found[0].score)
        hands: list[HandDetection] = []
        for each in found:
            if each.score >= least and all(self._apart(each.detection, one) for one in hands):
                hands.append(each.detection)
        return tuple(hands)

    def candidates(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> list[Candidate]:
        """Poses at all places at which a hand may be, whatever their scores; see `detect`."""
        predicted = None if expected is None else _pose(expected)
        with self._lock:
            views = self.views(frame_rgb)
            if predicted is not None and self._in_front(predicted):
                views.append(self._view(predicted))
            found = [self._candidate(frame_rgb, view) for view in views]
        return [each for each in found if each is not None]

    def views(self, frame_rgb: np.ndarray) -> list[CropView]:
        """Views of the places at which the finder sees a hand, the surest first."""
        camera, factor = self._camera, self._model.finder_focal / self._camera.fx
        small = finder_input(frame_rgb, factor)
        output = _run(self._finder, small)[0]
        scores = expit(output[0])
        views: list[CropView] = []
        for _ in range(MOST_VIEWS):
            row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
            if scores[row, column] < LEAST_SCORE:
                break
            dx, dy, log_slope = output[1:, row, column]
            at = (np.array([column + dx, row + dy]) + 0.5) * STRIDE - 0.5
            ray = camera.rays((at + 0.5) / factor - 0.5)
            if np.isfinite(ray).all():
                views.append(looking_at(ray, float(np.exp(log_slope)), self._model.size))
            scores[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3] = 0.0
        return views

    def _view(self, pose: Floats, level: bool = False) -> CropView:
        """The view of the hand at a pose in the camera (4, 4)."""
        model = self._model
        return hand_view(pose, model.centre, model.radius, model.size, level)

    def _in_front(self, pose: np.ndarray) -> bool:
        """Whether a pose (4, 4) is a finite one whose hand is before the camera."""
        if not np.isfinite(pose).all():
            return False
        middle = pose[:3, :3] @ self._model.centre + pose[:3, 3]
        return bool(pose[2, 3] > 0.0 and middle[2] > 0.0)

    def _apart(self, one: HandDetection, other: HandDetection) -> bool:
        """Whether two detections are of two hands: across the line of sight, because a single hand
        may be found at two depths, and the nearer of two hands hides the other."""
        poses = [each.pose_hand_in_camera for each in (one, other)]
        middles = [pose[:3, :3] @ self._model.centre + pose[:3, 3] for pose in poses]
        near = min(float(middle[2]) for middle in middles)
        across = [near * middle[:2] / middle[2] for middle in middles]
        return float(np.linalg.norm(across[0] - across[1])) > SAME * self._model.radius

    def _candidate(self, frame: np.ndarray, view: CropView) -> Candidate | None:
        """The hand that a view shows; None if its points have no pose before the camera."""
        found, odds = None, []
        for _ in range(TURNS):
            output = _run(self._points, view.cut(frame, self._camera)).ravel().astype(float)
            odds.append(output[-1])
            found = pose_of_points(output, view, self._hand)
            if found is None:
                return None
            if expit(odds[-1]) < HOPELESS:
                break
            view = self._view(found.pose, level=True)
        assert found is not None
        if not self._in_front(found.pose):
            return None
        scale = np.repeat([self._model.position_factor, self._model.rotation_factor], 3)
        detection = HandDetection(found.pose, found.covariance * np.outer(scale, scale))
        return Candidate(detection, float(expit(np.mean(odds))))


def _pose(value: object) -> Floats:
    """A pose (4, 4), which may be any."""
    try:
        pose = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        pose = np.empty(0)
    if pose.shape != (4, 4):
        got = f"the shape {pose.shape}" if pose.size > 1 else type(value).__name__
        raise AgentError(
            f"The pose of a hand in the camera must be numbers of the shape (4, 4), got {got}."
        )
    return pose


def finder_input(frame: np.ndarray, factor: float) -> np.ndarray:
    """A frame made smaller by a factor, with sides that the finder's strides divide."""
    size = [max(round(side * factor), STRIDE) for side in frame.shape[1::-1]]
    small = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    right, below = (-side % (2 * STRIDE) for side in size)
    return cv2.copyMakeBorder(small, 0, below, 0, right, cv2.BORDER_CONSTANT)


def pose_of_points(output: Floats, view: CropView, points: Floats) -> PointsPose | None:
    """The pose in the camera of points that a network located in a view; None if there is none.

    Args:
        output: of the points network (5 n + 1,): positions [half widths], spreads, presence.
        view: of the crop.
        points: in the hand's axes (n, 3) [m].
    """
    if not np.isfinite(output).all():
        return None
    count = len(points)
    spreads = output[2 * count : 5 * count].reshape(count, 3)
    whitening = np.zeros((count, 2, 2))
    whitening[:, 0, 0], whitening[:, 1, 1] = np.exp(np.clip(spreads[:, :2], *SPREAD)).T
    whitening[:, 1, 0] = spreads[:, 2]
    factor = np.linalg.inv(whitening) * view.slope
    slopes = output[: 2 * count].reshape(count, 2) * view.slope
    found = solve_points(points, slopes, factor @ factor.transpose(0, 2, 1))
    if found is None:
        return None
    pose, turn = found.pose.copy(), np.zeros((6, 6))
    pose[:3] = view.rotation @ found.pose[:3]
    turn[:3, :3] = turn[3:, 3:] = view.rotation
    return PointsPose(pose, turn @ found.covariance @ turn.T)


def _network(path: str | os.PathLike[str], content: bytes) -> cv2.dnn.Net:
    try:
        return cv2.dnn.readNetFromONNX(np.frombuffer(content, dtype=np.uint8))
    except cv2.error as error:
        raise AgentError(f"OpenCV cannot read the networks in {path} ({error.err}).") from error


def _run(network: cv2.dnn.Net, image: np.ndarray) -> Floats:
    """Output of a network for an image (h, w, 3) uint8."""
    blob = np.ascontiguousarray(image.transpose(2, 0, 1)[None], dtype=np.float32) / 255.0
    network.setInput(blob)
    return np.asarray(network.forward())
