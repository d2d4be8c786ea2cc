"""Calibration of a hand detector: what its covariances and scores are worth in new frames.

The points of a hand err together, so the covariance of a pose from independent points is too small.
Frames and textures that no network learned from say by how much, and from which score on a hand is
believed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jmm_agent.vision.camera import Camera
from jmm_agent.vision.hand_detector import Candidate, TrainedHandDetector
from jmm_agent.vision.hand_model_file import HandModel, read_hand_model, write_hand_model
from kengoro.errors import UsageError
from kengoro.hand_detector.evaluation import PoseDeviation, pose_deviation
from kengoro.hand_detector.examples import ABSENT, Source
from kengoro.hand_detector.frames import Frame, FrameMaker, develop

VISIBLE = 0.5
"""Hands of which this share is visible are to be found [1]."""
QUANTILE = 0.95
"""Share of the errors that a region must hold [1]."""
ELSEWHERE = 1.2
"""By this factor standard deviations are larger in laboratories of another kind than those of the
training [1]. In those of `experiments hand-detector` the regions hold 88 % of the errors without
it, and 94 % with it; it was chosen on the frames for tuning."""
PARTS = ((slice(0, 3), 7.815), (slice(3, 6), 7.815), (slice(0, 6), 12.592))
"""Positions, rotations and both, with the squared distance that bounds the region of each [1]."""
FALSE = 0.005
"""Share of the frames without a hand in which one may be claimed [1]."""
LEAST = 0.5
"""Least score from which on a hand is believed [1]."""
LEAST_HANDS = 30
"""Believed hands that a calibration needs: of fewer than 21 the quantile of the errors rests on the
largest one alone, and of 30 it lies below the two largest."""


class Calibration(NamedTuple):
    """What a detector does in frames that no network learned from.

    Attributes:
        found: share of the visible hands that are found [1].
        claimed: share of the frames without a hand in which one is claimed [1].
        position: median and 95th percentile of the position's error [m].
        rotation: the same of the rotation's [rad].
    """

    found: float
    claimed: float
    position: tuple[float, float]
    rotation: tuple[float, float]


def calibrate(
    source: Source, path: Path, count: int, progress: Callable[[float], None]
) -> Calibration:
    """Set factors and threshold in the file of a detector; says what it does then.

    Args:
        source: what frames are made of.
        path: of the file.
        count: number of frames.
        progress: called with the share that is done.

    Raises:
        UsageError: fewer than `LEAST_HANDS` hands are found; the file stays as it is.
    """
    model, *networks = read_hand_model(path)
    maker = source.maker(others=True)
    camera = Camera.from_fovy(maker.width, maker.height, maker.fovy)
    detector = TrainedHandDetector(camera, path)
    scores, errors, without = [], [], []
    for number, frame in enumerate(_frames(source, maker, count)):
        found = max(detector.candidates(frame.image), key=_score, default=None)
        if frame.visible >= VISIBLE:
            scores.append(_score(found))
            errors.append(None if found is None else pose_deviation(found.detection, frame.pose))
        elif frame.visible < ABSENT:
            without.append(_score(found))
        progress((number + 1) / count)
    threshold = max(LEAST, float(np.quantile(without, 1.0 - FALSE)) + 1e-6) if without else LEAST
    threshold = min(threshold, 1.0 - 1e-6)
    believed = [
        error for error, score in zip(errors, scores, strict=True)
        if error is not None and score >= threshold
    ]  # fmt: skip
    if len(believed) < LEAST_HANDS:
        raise UsageError(
            f"In {count} new frames the detector finds {len(believed)} of {len(scores)} visible "
            f"hands, but the calibration needs {LEAST_HANDS} of them, so no file is written: train "
            "with more --samples or --frames, or --start from the detector of a similar hand, in "
            f"another --folder; {path.parent} stays."
        )
    write_hand_model(path, calibrated(model, threshold, believed), *networks)
    return Calibration(
        float(np.mean(np.array(scores) >= threshold)),
        float(np.mean(np.array(without) >= threshold)) if without else 0.0,
        _spread([error.position for error in believed]),
        _spread([error.rotation for error in believed]),
    )


def _score(found: Candidate | None) -> float:
    return 0.0 if found is None else found.score


def _frames(source: Source, maker: FrameMaker, count: int) -> Iterator[Frame]:
    """Frames that are not among the examples, as a camera makes them; half show the hand."""
    for number in range(count):
        random = np.random.default_rng([source.seed, 3, number])
        frame = maker.make(random, shown=number % 2 == 0)
        yield frame._replace(image=develop(frame.image, random))


def calibrated(model: HandModel, threshold: float, errors: list[PoseDeviation]) -> HandModel:
    """The model with a threshold, and with factors by which the covariances hold the errors."""
    factors = np.ones(6)
    for part, bound in PARTS:
        far = np.quantile([error.distance(part, factors) for error in errors], QUANTILE)
        factors[part] *= np.sqrt(far / bound)
    factors *= ELSEWHERE
    return replace(
        model,
        threshold=threshold,
        position_factor=model.position_factor * float(factors[0]),
        rotation_factor=model.rotation_factor * float(factors[3]),
    )


def _spread(values: list[float]) -> tuple[float, float]:
    return float(np.median(values)), float(np.quantile(values, 0.95))
