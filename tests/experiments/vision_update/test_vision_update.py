"""Vision Updater: findings from made-up visits, and corners of markers."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from experiments.robots.conditions import ACTUAL, NOMINAL
from experiments.vision_update.figures import corners, shown_robot
from experiments.vision_update.run import Sizes, conclude, run
from jmm_agent.vision.marker_detector import MarkerDetector
from kengoro.robots import CAMERA, HAND, SIDES
from kengoro.visits import group_joints
from kengoro_env.names import JOINTS

SEED = 2


def made_up(seen: list[float], true: list[float]) -> dict[str, Any]:
    """A robot whose shoulder estimate is off by so many degrees at each visit."""
    shoulder = np.zeros(len(JOINTS))
    shoulder[group_joints()["shoulder"]] = 1.0
    jpeg = cv2.imencode(".jpg", np.zeros((480, 640, 3), np.uint8))[1]
    shot = {
        "frame": base64.b64encode(jpeg.tobytes()).decode(),
        "estimated": [[10, 10], [20, 10], [20, 20], [10, 20]],
        "seen": None,
    }
    count = len(seen)
    return {
        "visits": {
            "target": [np.zeros(len(JOINTS)).tolist()] * count,
            "estimate": [np.zeros(len(JOINTS)).tolist()] * count,
            "seen": [(np.radians(x) * shoulder).tolist() for x in seen],
            "true": [(np.radians(x) * shoulder).tolist() for x in true],
            "max_tension": [100.0] * count,
            "time": list(range(1, count + 1)),
        },
        "before": shot,
        "after": shot,
        "fired": count,
        "dropped": {},
    }


def test_first_and_last_visits_are_compared_by_both_definitions() -> None:
    seen, true = [20.0, 16.0, 12.0] + 6 * [9.0] + 9 * [2.0], [18.0] * 9 + [4.0] * 9
    robot = {ACTUAL: made_up(seen, true), NOMINAL: made_up([0.5] * 18, [0.5] * 18)}
    metrics = conclude({7: robot, 8: robot}, Sizes(postures=18)).metrics
    assert metrics["shoulder_seen_first"]["median"] == pytest.approx(16.0)
    assert metrics["shoulder_seen_last"]["median"] == pytest.approx(2.0)
    assert metrics["shoulder_seen_last"]["reached"] is True
    assert metrics["shoulder_true_first"]["median"] == pytest.approx(18.0)
    assert metrics["shoulder_true_last"]["median"] == pytest.approx(4.0)


def test_the_picture_shows_a_robot_whose_hand_was_in_view() -> None:
    not_seen, seen = ({ACTUAL: made_up([1.0], [1.0])} for _ in range(2))
    for when in ("before", "after"):
        seen[ACTUAL][when] = seen[ACTUAL][when] | {"seen": [[1, 1], [2, 1], [2, 2], [1, 2]]}
    assert shown_robot({3: not_seen, 4: seen})[0] == 4
    assert shown_robot({3: not_seen})[0] == 3


def test_corners_are_where_the_detector_finds_them() -> None:
    """A synthetic marker, seen from straight ahead."""
    pose = np.eye(4)
    pose[:3, :3] = np.diag([1.0, -1.0, -1.0])  # faces the camera, upright
    pose[:3, 3] = 0.05, -0.02, 0.4
    outline = corners(pose)
    side = round(CAMERA.fx * SIDES[HAND] / 0.4)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    frame = np.full((480, 640), 255, np.uint8)
    x, y = np.round(outline[0]).astype(int)
    frame[y : y + side, x : x + side] = cv2.aruco.generateImageMarker(dictionary, HAND, side)
    found = MarkerDetector(CAMERA, SIDES).detect(np.dstack([frame] * 3), {}).poses[HAND]
    np.testing.assert_allclose(outline, found.corners_px, atol=2.0)


def test_a_robot_observes_and_learns(request: pytest.FixtureRequest) -> None:
    maps: Path = request.config.cache.mkdir("maps")
    sizes = Sizes(postures=3, move=1.0, patience=1.5)
    result = run(ACTUAL, SEED, sizes, maps)
    assert len(result["visits"]["target"]) == 3
    assert result["fired"] >= 2
    before, after = result["before"], result["after"]
    assert before["seen"] is not None
    miss = [
        np.linalg.norm(np.mean(shot["seen"], axis=0) - np.mean(shot["estimated"], axis=0))
        for shot in (before, after)
    ]
    assert miss[1] < miss[0]
