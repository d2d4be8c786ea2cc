"""Runs a detector on frames, and keeps its answers beside the truth.

Records are dictionaries that fit in JSON: one for each frame, bad frame, frame with two hands and
scene in which the own hand moves beside another one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from experiments.hand_detector.bad_input import (
    PHOTOGRAPH,
    SECOND,
    bad_frames,
    photograph_frame,
    second_hand_frame,
)
from experiments.hand_detector.frames import Frame, make_frame
from experiments.hand_detector.movements import PairFrame, PairScene, pair_scene
from experiments.hand_detector.scores import ELSEWHERE_MM, MOVED
from experiments.hand_detector.studio import Studio
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_detection import HandDetection, HandSkip
from jmm_agent.vision.hand_detector import TrainedHandDetector
from jmm_agent.vision.own_hand import ExpectedPoses, OwnHand
from kengoro_env.vision.rendering import HEIGHT, WIDTH

NOMINAL_FOVY = np.radians(45.0)
"""Vertical angle of view that the detector believes in [rad]."""
Record = dict[str, Any]


class Answer(Protocol):
    """What a detector found: a pose in the camera (4, 4) and its covariance (6, 6)."""

    @property
    def pose_hand_in_camera(self) -> Floats:
        """The pose."""

    @property
    def covariance(self) -> Floats:
        """The covariance [m, rad], as in `jmm_agent.vision.pose_covariance`."""


class Detector(Protocol):
    """What is judged: `jmm_agent.vision.hand_detector.TrainedHandDetector`, or a test's own."""

    def detect(self, frame_rgb: np.ndarray, expected: np.ndarray | None = None) -> Answer | Enum:
        """The hand in a frame, or the reason why there is none."""


@runtime_checkable
class HandsDetector(Detector, Protocol):
    """A detector that also finds the other hands in a frame."""

    def hands(
        self, frame_rgb: np.ndarray, expected: np.ndarray | None = None
    ) -> Sequence[Answer] | Enum:
        """All hands in the frame, or the reason why there is none."""


class Job(NamedTuple):
    """Frames that one process judges.

    Attributes:
        seeds: of the frames.
        path: file of the detector.
    """

    seeds: tuple[int, ...]
    path: Path


def trial(job: Job) -> list[Record]:
    """Records of all frames of a job."""
    cv2.setNumThreads(1)
    studio = Studio()
    try:
        return judge(studio, job.seeds, lambda camera: TrainedHandDetector(camera, job.path))
    finally:
        studio.close()


def judge(
    studio: Studio, seeds: Sequence[int], make_detector: Callable[[Camera], Detector]
) -> list[Record]:
    """Records of frames, bad frames and frames with two hands.

    Args:
        studio: takes the frames.
        seeds: of the frames. The tenth part of each kind also has bad input, the next a
            photograph, the next a second hand, in one frame and in a scene.
        make_detector: detector for a camera.
    """
    records: list[Record] = []
    camera, detector = None, None
    for seed in seeds:
        frame = make_frame(studio, seed)
        if detector is None or believed_camera(frame) != camera:
            camera = believed_camera(frame)
            detector = make_detector(camera)
            detector.detect(frame.image)  # the first call allocates
        records.append(judged(frame, detector))
        records += others(studio, frame, detector)
    return records


def believed_camera(frame: Frame) -> Camera:
    """The camera that a detector is given: nominal, but with the distortion of the actual lens."""
    ideal = Camera.from_fovy(WIDTH, HEIGHT, NOMINAL_FOVY)
    lens = (frame.camera.k1, 0.0, 0.0, 0.0) if frame.camera.k1 else ()
    return Camera(WIDTH, HEIGHT, ideal.fx, ideal.fy, ideal.cx, ideal.cy, lens)


def judged(frame: Frame, detector: Detector) -> Record:
    """Record of a frame, without and with an expected pose."""
    before, cpu = time.perf_counter(), time.process_time()
    found = detector.detect(frame.image)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - before
    return {
        **_about(frame, "frame"),
        "cpu_ms": 1e3 * cpu,
        "wall_ms": 1e3 * wall,
        "without": answer(found, frame.truth),
        "expected": answer(detector.detect(frame.image, frame.expected), frame.truth),
    }


def others(studio: Studio, frame: Frame, detector: Detector) -> list[Record]:
    """Records of the bad frames and the frames with two hands of a frame's seed."""
    found: list[Record] = []
    if frame.seed % 10 == 0:
        for name, bad in bad_frames(studio, frame):
            wanted = bad.expected if name == "frozen" else None
            each = answer(detector.detect(bad.image, wanted), bad.truth)
            found.append({**_about(bad, name), "without": each})
    if frame.seed % 10 == 1:
        photograph = photograph_frame(studio, frame.seed)
        each = answer(detector.detect(photograph.image), photograph.truth)
        found.append({**_about(photograph, PHOTOGRAPH), "without": each})
    if frame.seed % 10 == 2 and (pair := second_hand_frame(studio, frame.seed)) is not None:
        both, other = pair
        record = _about(both, SECOND)
        for key, wanted in (("without", None), ("expected", both.expected)):
            own = detector.detect(both.image, wanted)
            record[key] = answer(own, both.truth)
            record[f"{key}_other"] = answer(own, other)
        found.append(record)
    if frame.seed % 10 == 2 and (scene := pair_scene(studio, frame.seed)) is not None:
        found.append(chosen(scene, detector))
    return found


def chosen(scene: PairScene, detector: Detector) -> Record:
    """Record of a scene with two hands, of which the own one is to be chosen by its movements.

    Returns:
        ``frames``, each with ``own`` and ``own_other``, the choice beside the poses of the own and
        the second hand, and with ``finds`` and ``finds_other``, whether the detector found them.
    """
    agent, frames = OwnHand(), []
    for frame in scene.frames:
        hands = hands_in(detector, frame)
        outcome: Answer | Enum = HandSkip.NOT_SEEN
        if hands:
            outcome = agent.choose(hands, ExpectedPoses(frame.expected, frame.eye))
        poses = [hand.pose_hand_in_camera for hand in hands]
        near = [nearest(pose, frame.own, frame.other) for pose in poses]
        frames.append(
            {
                "own": answer(outcome, frame.own),
                "own_other": answer(outcome, frame.other),
                "finds": 0 in near,
                "finds_other": 1 in near,
            }
        )
    return {"seed": scene.seed, "of": MOVED, "kind": scene.kind, "frames": frames}


def hands_in(detector: Detector, frame: PairFrame) -> list[HandDetection]:
    """All hands that a detector finds in a frame, or the only one that it returns."""
    found: Sequence[Answer] | Enum
    if isinstance(detector, HandsDetector):
        found = detector.hands(frame.image, frame.expected)
    else:
        only = detector.detect(frame.image, frame.expected)
        found = only if isinstance(only, Enum) else [only]
    if isinstance(found, Enum):
        return []
    return [HandDetection(hand.pose_hand_in_camera, hand.covariance) for hand in found]


def nearest(pose: Floats, *truths: Floats) -> int | None:
    """Number of the true pose (4, 4) that is nearest to a found one; None if all are elsewhere."""
    away = [1e3 * float(np.linalg.norm(pose[:3, 3] - truth[:3, 3])) for truth in truths]
    return int(np.argmin(away)) if min(away) <= ELSEWHERE_MM else None


def _about(frame: Frame, kind: str) -> Record:
    return {
        "seed": frame.seed,
        "of": kind,
        "kind": frame.kind,
        "share": frame.visible.share,
        "distance": float(frame.truth[2, 3]),
        "families": frame.families,
        "truth": frame.truth.tolist(),
    }


def answer(found: Answer | Enum, truth: Floats) -> Record:
    """An answer beside the truth.

    Returns:
        ``claims`` and ``reason``; for a claim ``pose``, ``position_mm``, ``rotation_deg``,
        ``distance2`` (the error's square in units of the covariance; None if that is not valid),
        ``position_std_mm`` and ``rotation_std_deg``, the largest of any direction.
    """
    if isinstance(found, Enum):
        return {"claims": False, "reason": found.name}
    pose = np.asarray(found.pose_hand_in_camera, dtype=float)
    error = pose_error(pose, truth)
    covariance = np.asarray(found.covariance, dtype=float)
    valid = covariance.shape == (6, 6) and bool(np.isfinite(covariance).all())
    valid = valid and bool(np.linalg.eigvalsh(0.5 * (covariance + covariance.T))[0] > 0.0)
    record = {
        "claims": True,
        "reason": "",
        "pose": pose.tolist(),
        "position_mm": 1e3 * float(np.linalg.norm(error[:3])),
        "rotation_deg": float(np.degrees(np.linalg.norm(error[3:]))),
        "distance2": None,
        "position_std_mm": None,
        "rotation_std_deg": None,
    }
    if valid:
        largest = [np.linalg.eigvalsh(covariance[part, part])[-1] ** 0.5 for part in PARTS]
        record["distance2"] = float(error @ np.linalg.solve(covariance, error))
        record["position_std_mm"] = 1e3 * float(largest[0])
        record["rotation_std_deg"] = float(np.degrees(largest[1]))
    return record


PARTS = (slice(0, 3), slice(3, 6))
"""Position and rotation in an error (6,)."""


def pose_error(pose: Floats, truth: Floats) -> Floats:
    """Error (6,) of a pose (4, 4): position [m] and rotation vector [rad], in the camera's axes."""
    turn = Rotation.from_matrix(pose[:3, :3] @ truth[:3, :3].T).as_rotvec()
    return np.concatenate([pose[:3, 3] - truth[:3, 3], turn])
