"""Tests of the hand detector with networks that give known outputs."""

from __future__ import annotations

import copy
import itertools
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from jmm_agent.errors import AgentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera
from jmm_agent.vision.crop_view import MARGIN, CropView, hand_view
from jmm_agent.vision.hand_detection import HandDetection, HandSkip
from jmm_agent.vision.hand_detector import TrainedHandDetector, pose_of_points
from jmm_agent.vision.hand_model_file import LARGEST, read_hand_model, write_hand_model
from jmm_agent.vision.weighted_pnp import PointsPose
from tests.jmm_agent.vision.hand_files import MODEL, POINTS, write_constant_detector

CAMERA = Camera.from_fovy(640, 480, np.deg2rad(45))
GREY = np.full((480, 640, 3), 100, dtype=np.uint8)
ROWS, COLUMNS = 16, 20


def straight_hand(distance: float = 0.5) -> Floats:
    """Pose of a hand whose middle is on the optical axis."""
    pose = np.eye(4)
    pose[:3, :3] = cv2.Rodrigues(np.array([1.2, 0.3, 0.1]))[0]
    pose[:3, 3] = np.array([0.0, 0.0, distance]) - pose[:3, :3] @ MODEL.centre
    return pose


def finder_output(score: float, columns: float = 9.5, rows: float = 7.0) -> Floats:
    """Output of a finder that sees a hand of 0.5 m distance at a place [cells]."""
    output = np.zeros((4, ROWS, COLUMNS))
    output[0] = -10.0
    output[0, round(rows), round(columns)] = score
    output[1], output[2] = columns - round(columns), rows - round(rows)
    output[3] = np.log(MARGIN * MODEL.radius / 0.5)
    return output


def points_output(present: float, distance: float = 0.5) -> Floats:
    """Output of a points network for the first view of the hand."""
    pose = straight_hand(distance)
    points = POINTS @ pose[:3, :3].T + pose[:3, 3]
    positions = points[:, :2] / points[:, 2:] / (MARGIN * MODEL.radius / distance)
    spreads = np.tile([4.0, 4.0, 0.0], (len(POINTS), 1))
    return np.concatenate([positions.ravel(), spreads.ravel(), [present]])


def detector(tmp_path: Path, finder: Floats, points: Floats) -> TrainedHandDetector:
    path = tmp_path / "hand.zip"
    write_constant_detector(path, finder, points)
    return TrainedHandDetector(CAMERA, path)


def test_points_in_the_crop_have_the_pose_of_the_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("jmm_agent.vision.hand_detector.TURNS", 1)
    # The principal point (319.5, 239.5) is cell 9.47, 6.97 of 8 px in a frame of 160 x 120.
    middle = (
        ((319.5 + 0.5) * 145.0 / CAMERA.fx) / 8.0 - 0.5,
        ((239.5 + 0.5) * 145.0 / CAMERA.fx) / 8.0 - 0.5,
    )
    finder = detector(tmp_path, finder_output(5.0, *middle), points_output(4.0))
    found = finder.detect(GREY)
    assert isinstance(found, HandDetection)
    assert found.pose_hand_in_camera == pytest.approx(straight_hand(), abs=2e-3)
    [candidate] = finder.candidates(GREY)
    assert candidate.score == pytest.approx(1.0 / (1.0 + np.exp(-4.0)))
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0
    # Depth is known less than what is across the line of sight.
    assert found.covariance[2, 2] > 2.0 * found.covariance[0, 0]
    assert finder.frame == "hand"


OTHERS = {
    "four times the pixels": Camera.from_fovy(1280, 960, np.deg2rad(45)),
    "wide and small": Camera.from_fovy(320, 240, np.deg2rad(60)),
    "principal point aside": Camera(640, 480, 579.0, 579.0, 400.0, 180.0),
    "bent": Camera(640, 480, 579.0, 579.0, 319.5, 239.5, (-0.2, 0.05, 0.0, 0.0)),
}


@pytest.mark.parametrize("camera", OTHERS.values(), ids=OTHERS)
def test_a_detector_serves_any_camera(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, camera: Camera
) -> None:
    monkeypatch.setattr("jmm_agent.vision.hand_detector.TURNS", 1)
    path = tmp_path / "hand.zip"
    factor = MODEL.finder_focal / camera.fx
    middle = ((np.array([camera.cx, camera.cy]) + 0.5) * factor) / 8.0 - 0.5
    rows, columns = (-(-round(side * factor) // 16) * 2 for side in (camera.height, camera.width))
    output = np.zeros((4, rows, columns))
    output[0] = -10.0
    column, row = np.round(middle).astype(int)
    output[0, row, column] = 5.0
    output[1], output[2] = middle - (column, row)
    output[3] = np.log(MARGIN * MODEL.radius / 0.5)
    write_constant_detector(path, output, points_output(4.0))
    frame = np.full((camera.height, camera.width, 3), 100, dtype=np.uint8)
    found = TrainedHandDetector(camera, path).detect(frame)
    assert isinstance(found, HandDetection)
    assert found.pose_hand_in_camera == pytest.approx(straight_hand(), abs=2e-3)


def test_the_depth_of_a_hand_aside_is_uncertain_along_its_ray() -> None:
    turn = cv2.Rodrigues(np.array([0.3, 0.7, 0.0]))[0]
    pose = np.eye(4)
    pose[:3] = turn @ straight_hand()[:3]
    view = hand_view(pose, MODEL.centre, MODEL.radius, MODEL.size)
    found = pose_of_points(points_output(4.0), view, POINTS)
    assert found is not None
    assert found.pose == pytest.approx(pose, abs=1e-6)
    values, axes = np.linalg.eigh(found.covariance[:3, :3])
    ray = pose[:3, :3] @ MODEL.centre + pose[:3, 3]
    assert values[2] > 2.0 * values[1]
    assert abs(axes[:, 2] @ ray) / np.linalg.norm(ray) > 0.98


def test_each_crop_is_upright_around_the_pose_that_the_one_before_showed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    views: list[CropView] = []
    cut = CropView.cut

    def noted(view: CropView, frame: np.ndarray, camera: Camera) -> np.ndarray:
        views.append(view)
        return cut(view, frame, camera)

    monkeypatch.setattr(CropView, "cut", noted)
    detector(tmp_path, finder_output(-10.0), points_output(4.0)).detect(GREY, straight_hand(0.6))
    assert len(views) == 3
    for before, after in itertools.pairwise(views):
        shown = pose_of_points(points_output(4.0), before, POINTS)
        assert shown is not None
        upright = hand_view(shown.pose, MODEL.centre, MODEL.radius, MODEL.size, level=True)
        assert after.rotation == pytest.approx(upright.rotation, abs=1e-6)
        assert after.slope == pytest.approx(upright.slope)
    assert np.abs(views[1].rotation - views[0].rotation).max() > 0.05


@pytest.mark.parametrize(("odds", "score"), [((8.0, 3.0, 1.0), 4.0), ((-6.0,), -6.0)])
def test_a_score_is_that_of_the_mean_log_odds_of_the_crops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, odds: tuple[float, ...], score: float
) -> None:
    """A place that shows nothing at all is looked at once."""
    made = detector(tmp_path, finder_output(-10.0), points_output(4.0))
    outputs = iter([finder_output(-10.0)[None], *(points_output(each) for each in odds)])
    monkeypatch.setattr("jmm_agent.vision.hand_detector._run", lambda *_: next(outputs))
    (found,) = made.candidates(GREY, straight_hand(0.6))
    assert found.score == pytest.approx(1.0 / (1.0 + np.exp(-score)))
    assert next(outputs, None) is None


def test_factors_of_the_calibration_scale_the_covariance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("jmm_agent.vision.hand_detector.TURNS", 1)
    plain = detector(tmp_path, finder_output(5.0), points_output(4.0)).detect(GREY)
    scaled = replace(MODEL, position_factor=3.0, rotation_factor=2.0)
    write_constant_detector(tmp_path / "b.zip", finder_output(5.0), points_output(4.0), scaled)
    other = TrainedHandDetector(CAMERA, tmp_path / "b.zip").detect(GREY)
    assert isinstance(plain, HandDetection)
    assert isinstance(other, HandDetection)
    ratio = other.covariance / plain.covariance
    assert ratio[:3, :3] == pytest.approx(9.0)
    assert ratio[3:, 3:] == pytest.approx(4.0)
    assert ratio[:3, 3:] == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("finder", "points"), [(-10.0, 4.0), (5.0, -4.0)], ids=["no place", "no hand in the crop"]
)
def test_a_hand_that_no_network_believes_is_not_found(
    tmp_path: Path, finder: float, points: float
) -> None:
    found = detector(tmp_path, finder_output(finder), points_output(points)).detect(GREY)
    assert found is HandSkip.NOT_SEEN


def test_a_hand_that_is_hardly_believed_has_no_pose(tmp_path: Path) -> None:
    found = detector(tmp_path, finder_output(5.0), points_output(-0.8)).detect(GREY)
    assert found is HandSkip.UNCLEAR  # a score of 0.31, and at least 0.5 is believed


def test_the_expected_pose_is_looked_at_and_not_trusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("jmm_agent.vision.hand_detector.TURNS", 1)
    shown = detector(tmp_path, finder_output(-10.0), points_output(4.0))
    assert shown.detect(GREY) is HandSkip.NOT_SEEN
    found = shown.detect(GREY, straight_hand())
    assert isinstance(found, HandDetection)
    assert found.pose_hand_in_camera == pytest.approx(straight_hand(), abs=1e-5)
    hidden = detector(tmp_path, finder_output(-10.0), points_output(-4.0))
    assert hidden.detect(GREY, straight_hand()) is HandSkip.NOT_SEEN
    behind = straight_hand()
    behind[2, 3] = -0.5
    assert shown.detect(GREY, behind) is HandSkip.NOT_SEEN


def test_two_hands_apart_from_each_other_are_ambiguous(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("jmm_agent.vision.hand_detector.TURNS", 1)
    both = np.maximum(finder_output(5.0, 4.0), finder_output(5.0, 15.0))
    both[1:] = finder_output(5.0, 4.0)[1:]
    finder = detector(tmp_path, both, points_output(4.0))
    assert finder.detect(GREY) is HandSkip.TWICE
    found = finder.hands(GREY)
    assert not isinstance(found, HandSkip)
    one, other = (hand.pose_hand_in_camera[:3, 3] for hand in found)
    assert np.linalg.norm(one - other) > 0.1


def test_one_hand_in_two_views_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("jmm_agent.vision.hand_detector.TURNS", 1)
    finder = detector(tmp_path, finder_output(5.0), points_output(4.0))
    assert len(finder.candidates(GREY, straight_hand())) == 2
    found = finder.hands(GREY, straight_hand())
    assert not isinstance(found, HandSkip)
    assert len(found) == 1
    nothing = detector(tmp_path, finder_output(-10.0), points_output(4.0))
    assert nothing.hands(GREY) is HandSkip.NOT_SEEN
    assert nothing.hands(np.zeros_like(GREY)) is HandSkip.DARK


def test_a_black_frame_is_named_and_a_frame_of_another_shape_refused(tmp_path: Path) -> None:
    finder = detector(tmp_path, finder_output(5.0), points_output(4.0))
    assert finder.detect(np.zeros_like(GREY)) is HandSkip.DARK
    with pytest.raises(AgentError, match="it must be a uint8 array of shape"):
        finder.detect(GREY[:100])
    with pytest.raises(AgentError, match="it must be a uint8 array of shape"):
        finder.detect(GREY.astype(float))


def test_a_frame_shows_the_hand_or_does_not(tmp_path: Path) -> None:
    finder = detector(tmp_path, finder_output(5.0), points_output(4.0))
    pose = straight_hand()
    assert finder.shows(pose)
    pose[0, 3] += 0.5
    assert not finder.shows(pose)
    pose = straight_hand()
    pose[2, 3] = -0.5
    assert not finder.shows(pose)


def test_copies_and_pickles_find_the_same(tmp_path: Path) -> None:
    finder = detector(tmp_path, finder_output(5.0), points_output(4.0))
    first = finder.detect(GREY)
    kind, arguments = finder.__reduce__()
    for other in (copy.deepcopy(finder), kind(*arguments)):
        found = other.detect(GREY)
        assert isinstance(first, HandDetection)
        assert isinstance(found, HandDetection)
        assert np.array_equal(found.pose_hand_in_camera, first.pose_hand_in_camera)


def test_wrong_arguments_are_named_in_one_sentence(tmp_path: Path) -> None:
    finder = detector(tmp_path, finder_output(5.0), points_output(4.0))
    for camera in ("eye", None):
        with pytest.raises(AgentError, match=r"^A hand detector needs a Camera, got "):
            TrainedHandDetector(camera, tmp_path / "hand.zip")  # type: ignore[arg-type]
    for file in (None, 3):
        with pytest.raises(AgentError, match=r"^The file of a hand detector is .*must be a path"):
            TrainedHandDetector(CAMERA, file)  # type: ignore[arg-type]
    for pose in (np.eye(3), "ahead", [[1.0], [1.0, 2.0]]):
        with pytest.raises(AgentError, match=r"must be numbers of the shape \(4, 4\), got "):
            finder.detect(GREY, pose)  # type: ignore[arg-type]
        with pytest.raises(AgentError, match=r"must be numbers of the shape \(4, 4\), got "):
            finder.shows(pose)  # type: ignore[arg-type]
    with pytest.raises(AgentError, match=r"of the shape \(4, 4\), got NoneType"):
        finder.shows(None)  # type: ignore[arg-type]


def test_wrong_files_are_named_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(AgentError, match=r"There is no hand detector .*none.zip: `kengoro hand-"):
        TrainedHandDetector(CAMERA, tmp_path / "none.zip")
    text = tmp_path / "text.zip"
    text.write_text("no archive")
    with pytest.raises(AgentError, match="is no file of a hand detector"):
        TrainedHandDetector(CAMERA, text)
    path = tmp_path / "hand.zip"
    write_constant_detector(path, finder_output(5.0), points_output(4.0))
    model, finder, points = read_hand_model(path)
    assert model == MODEL

    def write(content: dict[str, object], network: bytes = finder) -> None:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("hand.json", json.dumps(content))
            archive.writestr("finder.onnx", network)
            archive.writestr("points.onnx", points)

    right = {"format": "hand-detector-1", "body": "hand", "points": POINTS.tolist(), "size": 64,
             "finder_focal": 145.0}  # fmt: skip
    for wrong, message in (
        ({**right, "format": "hand-detector-9"}, "must have the format hand-detector-1"),
        ({**right, "points": [[0.0, 0.0]]}, "hand.json is not valid"),
        ({**right, "points": "pickle"}, "hand.json is not valid"),
        ({**right, "size": 0}, "hand.json is not valid"),
        ({**right, "sise": 64}, "hand.json is not valid"),
        ({**right, "size": 64.0}, "size is 64.0, but must be a whole number"),
        ({**right, "size": 10**9}, "size is 1000000000, but must be in 32 to 1024"),
        ({**right, "finder_focal": float("nan")}, "finder_focal is nan, but must be in"),
        ({**right, "threshold": float("nan")}, "threshold is nan, but must be in"),
        ({**right, "threshold": "0.5"}, "threshold is '0.5', but must be in"),
        ({**right, "position_factor": float("inf")}, "position_factor is inf, but must be in"),
        ({**right, "points": np.full((5, 3), np.nan).tolist()}, "points must be finite"),
        ({**right, "points": np.zeros((5, 3)).tolist()}, "the radius of the points is 0.0"),
        ({**right, "points": (1e9 * POINTS).tolist()}, "the radius of the points is"),
        ({**right, "body": 3}, "body and made_by must be texts"),
        ({**right, "points": POINTS[:4].tolist()}, "belong to the file's 4 points"),
    ):
        write(wrong)
        with pytest.raises(AgentError, match=message):
            TrainedHandDetector(CAMERA, path)
    write(right, b"no network")
    with pytest.raises(AgentError, match="OpenCV cannot read the networks in"):
        TrainedHandDetector(CAMERA, path)
    write(right, points)
    with pytest.raises(
        AgentError, match=r"have outputs of the shapes \(1, 26\) and \(1, 26\), but"
    ):
        TrainedHandDetector(CAMERA, path)


@pytest.mark.parametrize(
    ("offset", "value"), [(6, 235), (8, 1), (10, 99)], ids=["version", "encrypted", "method"]
)
def test_an_archive_that_cannot_be_unpacked_is_named(
    offset: int, value: int, tmp_path: Path
) -> None:
    path = tmp_path / "hand.zip"
    write_constant_detector(path, finder_output(5.0), points_output(4.0))
    content = bytearray(path.read_bytes())
    content[content.find(b"PK\x01\x02") + offset] = value  # in the entry of the first file
    path.write_bytes(content)
    with pytest.raises(AgentError, match="is no file of a hand detector"):
        TrainedHandDetector(CAMERA, path)


def test_a_large_archive_is_named_once(tmp_path: Path) -> None:
    path = tmp_path / "hand.zip"
    write_hand_model(path, MODEL, bytes(LARGEST), b"")
    with pytest.raises(AgentError) as refused:
        read_hand_model(path)
    assert str(refused.value) == f"{path} is larger than a hand detector's 64 MiB."


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0])
def test_coincident_points_and_nonfinite_outputs_are_no_hand(value: float, tmp_path: Path) -> None:
    output = points_output(4.0)
    output[: 2 * len(POINTS)] = value
    finder = detector(tmp_path, finder_output(5.0), output)
    assert finder.detect(GREY, straight_hand()) is HandSkip.NOT_SEEN


@pytest.mark.parametrize(("entry", "value"), [((0, 3), np.nan), ((2, 3), np.inf), ((2, 3), -0.5)])
def test_an_expected_pose_that_cannot_be_looked_at_is_left_out(
    entry: tuple[int, int], value: float, tmp_path: Path
) -> None:
    finder = detector(tmp_path, finder_output(5.0), points_output(4.0))
    expected = straight_hand()
    expected[entry] = value
    alone, found = finder.candidates(GREY), finder.candidates(GREY, expected)
    assert len(found) == len(alone) == 1
    assert np.array_equal(
        found[0].detection.pose_hand_in_camera, alone[0].detection.pose_hand_in_camera
    )


def test_a_hand_whose_frame_is_not_before_the_camera_has_no_pose(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finder = detector(tmp_path, finder_output(5.0), points_output(4.0))
    assert len(finder.candidates(GREY)) == 1
    behind = straight_hand()
    behind[2, 3] = -0.01
    monkeypatch.setattr(
        "jmm_agent.vision.hand_detector.pose_of_points",
        lambda *_: PointsPose(behind, 1e-4 * np.eye(6)),
    )
    assert finder.candidates(GREY) == []


def test_the_same_networks_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.zip", "b.zip"):
        write_constant_detector(tmp_path / name, finder_output(5.0), points_output(4.0))
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
