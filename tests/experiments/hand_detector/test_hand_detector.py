"""The judge of the hand detector: each metric turns red and green, and frames are what they say."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.hand_detector import run
from experiments.hand_detector.bad_input import (
    BLACK,
    BLURRED,
    FROZEN,
    MIRRORED,
    bad_frames,
    photograph_frame,
    second_hand_frame,
)
from experiments.hand_detector.criteria import (
    bad_rows,
    judged,
    metrics,
    movement_rows,
    pair_rows,
)
from experiments.hand_detector.frames import (
    HIDDEN,
    NONE,
    OFF_POSITION,
    OFF_ROTATION,
    SEEN,
    Frame,
    kind_of,
    make_frame,
    set_up,
    shifted,
)
from experiments.hand_detector.movements import (
    MOVEMENTS,
    MOVES,
    STILL,
    PairFrame,
    PairScene,
    kind_of_pair,
    pair_scene,
)
from experiments.hand_detector.run import Args, blocks, conclude, detector_path, frame_seeds
from experiments.hand_detector.scene import make_model
from experiments.hand_detector.scores import EXPECTED
from experiments.hand_detector.studio import ActualCamera, Studio, Visible, geoms_left_out
from experiments.hand_detector.tables import weakest
from experiments.hand_detector.trial import (
    answer,
    believed_camera,
    chosen,
    judge,
    pose_error,
)
from experiments.hand_detector.trial import judged as record_of
from experiments.harness.errors import ExperimentError
from jmm_agent.types import Floats
from jmm_agent.vision.camera import Camera

ROOT = Path(__file__).resolve().parents[3]


class Reason(Enum):
    NOT_SEEN = "not seen"
    TWICE = "two hands"


class Pose(NamedTuple):
    pose_hand_in_camera: Floats
    covariance: Floats


def moved(pose: Floats, error: Floats) -> Floats:
    """A pose whose error by `pose_covariance` is given (6,)."""
    result = pose.copy()
    result[:3, 3] += error[:3]
    result[:3, :3] = Rotation.from_rotvec(error[3:]).as_matrix() @ pose[:3, :3]
    return result


class Fake:
    """A detector that knows the truth, and deviates from it as told.

    Args:
        frames: that it knows, by their images.
        deviation: standard deviations of its errors [m, rad].
        claimed: those that it claims, over the actual ones.
        error: constant error (6,) [m, rad].
        misses: share of hands that it does not find.
        far: share of its answers that are 60 mm off.
        invents: whether it finds a hand where none is.
        busy: time that it computes [s].
    """

    def __init__(
        self,
        frames: Sequence[Frame],
        deviation: tuple[float, float] = (0.001, 0.005),
        claimed: float = 1.0,
        error: Sequence[float] = (0.0,) * 6,
        misses: float = 0.0,
        far: float = 0.0,
        invents: bool = False,
        busy: float = 0.0,
    ) -> None:
        self._truths = {id(frame.image): frame for frame in frames}
        self._deviation, self._claimed = np.repeat(deviation, 3), claimed
        self._error, self._misses, self._far = np.array(error), misses, far
        self._invents, self._busy = invents, busy
        self._random = np.random.default_rng(3)

    def detect(self, frame_rgb: np.ndarray, expected: np.ndarray | None = None) -> Pose | Enum:
        frame, end = self._truths[id(frame_rgb)], time.process_time() + self._busy
        while time.process_time() < end:
            pass
        if (frame.kind == NONE and not self._invents) or self._random.uniform() < self._misses:
            return Reason.NOT_SEEN
        error = self._error + self._deviation * self._random.standard_normal(6)
        if self._random.uniform() < self._far:
            error[0] += 0.06
        covariance = np.diag((self._claimed * self._deviation) ** 2)
        return Pose(moved(frame.truth, error), covariance)


def some_pose(rng: np.random.Generator) -> Floats:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(rng=rng).as_matrix()
    pose[:3, 3] = rng.uniform((-0.1, -0.1, 0.3), (0.1, 0.1, 0.7))
    return pose


def made_frames(count: int = 400) -> list[Frame]:
    """Frames without a picture."""
    rng, found = np.random.default_rng(0), []
    for seed in range(9000, 9000 + count):
        pose, kind = some_pose(rng), kind_of(seed)
        visible = Visible({SEEN: 900, HIDDEN: 300, NONE: 0}[kind], 1000)
        families = {"skin": "carbon" if seed % 3 else "aluminium"}
        image = np.zeros((4, 4, 3), dtype=np.uint8)
        camera = ActualCamera(579.0, 0.0)
        found.append(Frame(seed, kind, image, pose, shifted(pose, rng), camera, visible, families))
    return found


FRAMES = made_frames()


def found_metrics(count: int = 400, **more: Any) -> dict[str, dict[str, Any]]:
    fake = Fake(FRAMES, **more)
    return metrics(judged([record_of(frame, fake) for frame in FRAMES[:count]]))


def red(found: dict[str, dict[str, Any]]) -> set[str]:
    return {name for name, one in found.items() if one["reached"] is False}


def test_a_good_detector_with_a_right_covariance_is_green() -> None:
    found = found_metrics()
    assert set(found) == {
        "found", "position_mm", "rotation_deg", "position_95_mm", "rotation_95_deg", "covered",
        "false_claims", "time_ms",
    }  # fmt: skip
    assert all(one["reached"] is True for one in found.values())
    low, high = found["covered"]["interval"]
    assert low < 95.0 < high
    assert found["covered"]["cases"] == 360
    assert found["found"]["cases"] == 320
    assert found["false_claims"]["cases"] == 40


@pytest.mark.parametrize(
    ("more", "wrong"),
    [
        ({"misses": 0.05}, {"found"}),
        ({"claimed": 0.3}, {"covered"}),
        ({"claimed": 3.0}, {"covered"}),
        ({"invents": True}, {"false_claims"}),
        ({"deviation": (0.005, 0.005)}, {"position_mm"}),
        ({"deviation": (0.001, 0.04)}, {"rotation_deg", "rotation_95_deg"}),
        ({"deviation": (0.001, 0.02)}, {"rotation_deg"}),
        ({"far": 0.2}, {"position_95_mm", "covered"}),
        ({"error": (0.03, 0, 0, 0, 0, 0), "claimed": 20.0}, {"position_mm", "position_95_mm",
                                                             "covered"}),
        ({"error": (0.3, 0, 0, 0, 0, 0)}, {"found", "position_mm", "position_95_mm", "covered"}),
    ],
)  # fmt: skip
def test_each_fault_turns_its_own_metrics_red(more: dict[str, Any], wrong: set[str]) -> None:
    assert red(found_metrics(**more)) == wrong


def test_a_blind_detector_has_no_errors_and_is_red() -> None:
    found = found_metrics(misses=1.0)
    assert red(found) == {"found"}
    assert found["position_mm"]["reached"] is None
    assert found["covered"]["cases"] == 0


def test_a_slow_detector_is_red() -> None:
    found = found_metrics(count=4, busy=0.07)
    assert "time_ms" in red(found)
    assert found["time_ms"]["value"] == pytest.approx(70.0, rel=0.2)


def test_a_covariance_that_is_none_covers_nothing() -> None:
    truth = some_pose(np.random.default_rng(1))
    for wrong in (np.full((6, 6), np.nan), np.zeros((6, 6)), np.diag([1.0, 1, 1, 1, 1, -1])):
        record = answer(Pose(truth, wrong), truth)
        assert record["claims"]
        assert record["distance2"] is None
        json.dumps(record, allow_nan=False)


def test_errors_are_in_the_axes_of_the_camera() -> None:
    truth, error = (
        some_pose(np.random.default_rng(2)),
        np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.1]),
    )
    assert pose_error(moved(truth, error), truth) == pytest.approx(error)
    sizes = np.abs(error)
    assert answer(Pose(moved(truth, error), np.diag(sizes**2)), truth)["distance2"] == (
        pytest.approx(6.0)
    )


def test_the_expected_pose_is_off_by_the_stated_amounts() -> None:
    for frame in FRAMES[:20]:
        error = pose_error(frame.expected, frame.truth)
        assert np.linalg.norm(error[:3]) == pytest.approx(OFF_POSITION)
        assert np.linalg.norm(error[3:]) == pytest.approx(OFF_ROTATION)


def test_answers_with_an_expected_pose_are_not_judged_by_the_musts() -> None:
    fake = Fake(FRAMES, misses=1.0)
    rows = judged([record_of(frame, fake) for frame in FRAMES[:20]], EXPECTED)
    assert {row.reached for row in rows.values()} == {None}


def bad_record(kind: str, **more: Any) -> dict[str, Any]:
    each = {"claims": True, "reason": "", "position_mm": 1.0, "rotation_deg": 1.0,
            "distance2": 5.0, "position_std_mm": 2.0, "rotation_std_deg": 1.0}  # fmt: skip
    return {"of": kind, "kind": SEEN, "seed": 9000, "without": each | more}


def test_claims_for_bad_frames_are_counted_by_how_sure_they_are() -> None:
    records = [
        bad_record(MIRRORED),
        bad_record(MIRRORED, position_std_mm=200.0),
        bad_record(MIRRORED, claims=False),
        bad_record(FROZEN, distance2=1e4),
        bad_record(FROZEN),
    ]
    found = {row.name: row.value for row in bad_rows(records)}
    assert found["mirrored: claims a pose"] == pytest.approx(200 / 3)
    assert found["mirrored: claims one, and is sure"] == pytest.approx(100 / 3)
    assert found["frozen: claims one, and is sure"] == 100.0
    assert found["frozen: is sure, and far outside"] == 50.0
    assert found["black: claims a pose"] is None


def test_the_own_hand_is_chosen_if_the_claim_is_nearer_to_it() -> None:
    near, far = {"claims": True, "reason": "", "position_mm": 3.0}, {"position_mm": 200.0}
    none = {"claims": False, "reason": "TWICE"}
    pairs = [(near, far), (far | {"claims": True, "reason": ""}, near), (none, none), (none, none)]
    records = [
        {"of": "second hand", "kind": SEEN, "without": own, "without_other": other,
         "expected": none, "expected_other": none}
        for own, other in pairs
    ]  # fmt: skip
    found = {row.name: row.value for row in pair_rows(records)}
    assert found["two hands: the own one is claimed"] == 25.0
    assert found["two hands: the own one, or 'there are two'"] == 75.0
    assert found["two hands: another is claimed"] == 25.0
    assert found["pose expected: the own one, or 'there are two'"] == 100.0


def test_the_weakest_family_is_named() -> None:
    weak = [replace(f, families={"skin": "orange print"}) for f in FRAMES[:60]]
    fake, bad = Fake(FRAMES), Fake(weak, misses=0.5)
    records = [record_of(frame, fake) for frame in FRAMES[60:]]
    records += [record_of(frame, bad) for frame in weak]
    assert weakest(records).rows[0][0] == "skin: orange print"


def test_seeds_of_frames_are_those_for_tuning_or_for_reports() -> None:
    assert frame_seeds(Args()) == list(range(9000, 10000))
    assert frame_seeds(Args(seeds="10000-10999"))[-1] == 10999
    assert len(frame_seeds(Args(seeds="10000-10999", quick=True))) == 20
    for wrong in ("0-9", "100-109", "9990-10010", "8999-9005"):
        with pytest.raises(ExperimentError, match="9000 to 9999 for tuning, or seeds from 10000"):
            frame_seeds(Args(seeds=wrong))


def test_a_smaller_run_has_the_tasks_of_a_larger_one() -> None:
    many = blocks(list(range(9000, 10000)))
    assert len(many) == 20
    assert {len(block) for block in many} == {50}
    assert blocks(list(range(9050, 9100))) == [many[1]]
    assert blocks([9048, 9049, 9050]) == [[9048, 9049], [9050]]


def test_a_missing_detector_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ExperimentError, match=r"There is no detector at .*none\.zip"):
        run.main(Args(detector=tmp_path / "none.zip", out=tmp_path))
    monkeypatch.setattr(run, "KENGORO", "no_such_detector.zip")
    with pytest.raises(ExperimentError, match=r"No hand detector is shipped .* --detector"):
        detector_path(None)


def test_saved_records_are_those_of_one_detector(tmp_path: Path) -> None:
    one, other = tmp_path / "one.zip", tmp_path / "other.zip"
    one.write_bytes(b"1")
    other.write_bytes(b"2")
    assert run.digest(one) == run.digest(one) != run.digest(other)


JUDGE = """
import importlib, pkgutil, sys
import experiments.hand_detector as judge
for module in pkgutil.iter_modules(judge.__path__):
    importlib.import_module(f"experiments.hand_detector.{module.name}")
print(*(name for name in sys.modules if name.startswith("kengoro.hand_detector")))
"""


def test_the_judge_loads_no_code_of_the_training() -> None:
    done = subprocess.run(
        [sys.executable, "-c", JUDGE], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.strip() == ""


@pytest.fixture(scope="module")
def studio() -> Iterator[Studio]:
    made = Studio()
    yield made
    made.close()


def test_the_scene_has_no_marker_on_the_hand() -> None:
    model = make_model()
    assert "marker_plate" not in [model.geom(i).name for i in range(model.ngeom)]
    assert "marker_can_plate" in [model.geom(i).name for i in range(model.ngeom)]


def test_a_frame_depends_on_its_seed_alone(studio: Studio) -> None:
    first = make_frame(studio, 9003)
    make_frame(studio, 9014)
    again = make_frame(studio, 9003)
    assert np.array_equal(first.image, again.image)
    assert np.array_equal(first.truth, again.truth)
    assert first.families == again.families
    other = Studio()
    assert np.array_equal(make_frame(other, 9003).image, first.image)
    other.close()


def test_frames_are_of_their_kind(studio: Studio) -> None:
    kinds = [kind_of(seed) for seed in range(10000, 11000)]
    assert [kinds.count(kind) for kind in (SEEN, HIDDEN, NONE)] == [800, 100, 100]
    for seed, kind in ((9007, SEEN), (9008, HIDDEN), (9009, NONE)):
        frame = make_frame(studio, seed)
        assert frame.kind == kind
        assert frame.image.shape == (480, 640, 3)
        share = frame.visible.share
        assert {SEEN: share >= 0.5, HIDDEN: 0.0 < share < 0.5, NONE: share == 0.0}[kind]


def hull(studio: Studio) -> Floats:
    """Corners of the outline of the hand in the frame."""
    pose = studio.hand_pose()
    points = np.concatenate(studio.hand_outlines()) @ pose[:3, :3].T + pose[:3, 3]
    return np.asarray(cv2.convexHull(studio.camera.project(points).astype(np.float32)))[:, 0]


@pytest.mark.parametrize("k1", [-0.05, 0.0, 0.05])
def test_the_hand_is_in_the_picture_at_its_true_pose(studio: Studio, k1: float) -> None:
    set_up(studio, 9004)
    studio.set_camera(7, k1)
    studio.update()
    with_hand = studio.picture(False, False).astype(int)
    without = studio.picture(False, False, geoms_left_out(studio.hand)).astype(int)
    rows, columns = np.nonzero(np.abs(with_hand - without).max(axis=2) > 8)
    corners = hull(studio)
    middle = corners.mean(axis=0)
    larger = (middle + 1.03 * (corners - middle)).astype(np.float32)
    inside = [
        cv2.pointPolygonTest(larger, (float(x), float(y)), False) >= 0
        for x, y in zip(columns, rows, strict=True)
    ]
    assert len(inside) > 2000
    assert np.mean(inside) > 0.995
    ends = np.array([[columns.min(), rows.min()], [columns.max(), rows.max()]])
    assert np.abs(ends - [corners.min(axis=0), corners.max(axis=0)]).max() < 12.0


def test_the_detector_gets_the_lens_and_not_the_focal_length(studio: Studio) -> None:
    frame = make_frame(studio, next(s for s in range(9000, 9100, 10) if lens_of(studio, s)))
    camera, actual = believed_camera(frame), frame.camera
    assert camera.distortion[0] == actual.k1 != 0.0
    assert camera.fx == pytest.approx(240.0 / np.tan(np.radians(22.5)))
    assert 0.0 < abs(actual.focal / camera.fx - 1.0) < 0.015
    points = np.random.default_rng(0).uniform((-0.2, -0.15, 0.4), (0.2, 0.15, 0.8), (50, 3))
    same = Camera(640, 480, actual.focal, actual.focal, 319.5, 239.5, (actual.k1, 0.0, 0.0, 0.0))
    assert actual.project(points) == pytest.approx(same.project(points), abs=1e-3)


def lens_of(studio: Studio, seed: int) -> float:
    set_up(studio, seed)
    return studio.camera.k1


def test_what_the_border_cuts_off_is_hidden(studio: Studio) -> None:
    set_up(studio, 9004)
    whole = studio.visible()
    assert whole.share > 0.9
    columns = hull(studio)[:, 0]
    middle = (columns.min() + columns.max()) / 2.0
    turn = np.arctan((middle - studio.camera.middle[0]) / studio.camera.focal)
    turn += np.arctan(studio.camera.middle[0] / studio.camera.focal)  # at the left border
    eye, turned = studio.model.camera("eye"), np.zeros(4)
    about = np.array([np.cos(turn / 2.0), 0.0, -np.sin(turn / 2.0), 0.0])
    mujoco.mju_mulQuat(turned, eye.quat, about)
    eye.quat[:] = turned
    studio.update()
    columns = hull(studio)[:, 0]
    assert columns.min() < 0.0 < columns.max()
    cut = studio.visible()
    assert 0.3 < cut.share < 0.7
    assert cut.whole > whole.whole


def test_bad_frames_are_what_their_names_mean(studio: Studio) -> None:
    frame = make_frame(studio, 9000)
    found = dict(bad_frames(studio, frame))
    assert set(found) == {BLACK, MIRRORED, BLURRED, FROZEN}
    assert found[BLACK].image.max() < 12
    assert np.array_equal(found[MIRRORED].image[:, ::-1], frame.image)
    assert np.array_equal(found[FROZEN].image, frame.image)
    assert not np.allclose(found[FROZEN].truth, frame.truth)
    sharp = [np.abs(np.diff(i.astype(int), axis=1)).mean() for i in
             (frame.image, found[BLURRED].image)]  # fmt: skip
    assert sharp[1] < sharp[0]


def test_a_photograph_shows_no_hand_and_a_second_hand_two(studio: Studio) -> None:
    photograph = photograph_frame(studio, 9001)
    assert (photograph.kind, photograph.visible.hand) == (NONE, 0)
    pair = second_hand_frame(studio, 9002)
    assert pair is not None
    frame, other = pair
    assert frame.visible.share >= 0.5
    assert frame.visible.copies >= frame.visible.whole // 2
    pixels = [frame.camera.project(pose[:3, 3]) for pose in (frame.truth, other)]
    assert np.linalg.norm(pixels[0] - pixels[1]) > 60.0


@pytest.mark.parametrize("seed", [9002, pytest.param(9012, marks=pytest.mark.slow)])
def test_in_a_scene_the_own_hand_moves_and_the_other_one_is_still_or_moves_too(
    studio: Studio, seed: int
) -> None:
    scene = pair_scene(studio, seed)
    assert scene is not None
    assert scene.kind == kind_of_pair(seed) == {9002: STILL, 9012: MOVES}[seed]
    assert len(scene.frames) == MOVEMENTS + 1
    where = []
    for frame in scene.frames:
        off = pose_error(frame.expected, frame.own)
        assert off == pytest.approx(pose_error(scene.frames[0].expected, scene.frames[0].own))
        assert np.linalg.norm(off[:3]) == pytest.approx(OFF_POSITION)
        assert np.linalg.norm(off[3:]) == pytest.approx(OFF_ROTATION)
        pixels = [scene.camera.project(pose[:3, 3]) for pose in (frame.own, frame.other)]
        assert np.linalg.norm(pixels[0] - pixels[1]) > 60.0
        turned = frame.eye[:3, :3].T @ scene.frames[0].eye[:3, :3]  # the camera, by the joints
        where.append(turned.T @ frame.other[:3, :3])
    same = [np.allclose(each, where[0], atol=1e-9) for each in where[1:]]
    assert all(same) if scene.kind == STILL else not any(same)
    again = pair_scene(studio, seed)
    assert again is not None
    assert np.array_equal(again.frames[-1].image, scene.frames[-1].image)


def made_scene(seed: int, kind: str) -> PairScene:
    """A scene without pictures."""
    rng, frames = np.random.default_rng(seed), []
    still = some_pose(rng)
    for _ in range(MOVEMENTS + 1):
        own, other = some_pose(rng), still if kind == STILL else some_pose(rng)
        expected = shifted(own, np.random.default_rng([seed, 1]))
        image = np.zeros((4, 4, 3), dtype=np.uint8)
        frames.append(PairFrame(image, own, other, expected, np.eye(4)))
    return PairScene(seed, kind, ActualCamera(579.0, 0.0), frames)


class Pair:
    """A detector that knows the hands in the frames of a scene, the other one first.

    Args:
        scene: with two hands.
        finds: which of the hands it finds, the own one last.
    """

    def __init__(self, scene: PairScene, finds: slice = slice(None)) -> None:
        self._poses = {id(frame.image): [frame.other, frame.own][finds] for frame in scene.frames}

    def hands(self, frame_rgb: np.ndarray, expected: np.ndarray | None = None) -> list[Pose] | Enum:
        covariance = np.diag([1e-6] * 3 + [1e-4] * 3)
        return [Pose(pose, covariance) for pose in self._poses[id(frame_rgb)]]

    def detect(self, frame_rgb: np.ndarray, expected: np.ndarray | None = None) -> Pose | Enum:
        found = self.hands(frame_rgb)
        assert isinstance(found, list)
        return found[0] if len(found) == 1 else Reason.TWICE


class One:
    """A detector that returns one hand only, and knows nothing of others."""

    def __init__(self, pair: Pair) -> None:
        self._pair = pair

    def detect(self, frame_rgb: np.ndarray, expected: np.ndarray | None = None) -> Pose | Enum:
        return self._pair.detect(frame_rgb)


def chosen_share(*records: dict[str, Any]) -> dict[str, Any]:
    records = json.loads(json.dumps(records, allow_nan=False))
    return {row.name.removeprefix("after 6 movements: "): row for row in movement_rows(records)}


SCENES = [made_scene(seed, kind) for seed in range(10) for kind in (STILL, MOVES)]


def test_the_must_of_two_hands_is_reached_by_a_detector_that_finds_both() -> None:
    found = chosen_share(*(chosen(scene, Pair(scene)) for scene in SCENES))
    assert found["the own one is chosen"].value == 100.0
    assert found["the own one is chosen"].reached is True
    assert found["another is chosen"].value == 0.0
    assert found["all frames: it finds both"].value == 100.0


def test_a_detector_that_finds_the_other_hand_alone_is_red() -> None:
    for make in (Pair, lambda scene, finds: One(Pair(scene, finds))):
        found = chosen_share(*(chosen(scene, make(scene, slice(0, 1))) for scene in SCENES))
        assert found["the own one is chosen"].value == 0.0
        assert found["the own one is chosen"].reached is False
        assert found["another is chosen"].value == 0.0
        assert found["all frames: the detector finds the own one"].value == 0.0


def test_a_detector_that_only_reports_that_there_are_two_is_red() -> None:
    found = chosen_share(*(chosen(scene, One(Pair(scene))) for scene in SCENES))
    assert found["the own one is chosen"].reached is False
    assert found["all frames: another is chosen"].value == 0.0


def test_without_a_scene_the_must_is_open() -> None:
    assert chosen_share()["the own one is chosen"].reached is None


class Known:
    """A detector that knows the frames that a studio takes."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio

    def detect(self, frame_rgb: np.ndarray, expected: np.ndarray | None = None) -> Pose | Enum:
        if self._studio.visible().hand == 0:
            return Reason.NOT_SEEN
        return Pose(self._studio.hand_pose(), np.diag([1e-6] * 3 + [1e-4] * 3))


def test_the_report_is_written_whole(studio: Studio, tmp_path: Path) -> None:
    records = judge(studio, [9002, 9009], lambda camera: Known(studio))
    records = json.loads(json.dumps(records, allow_nan=False))
    path = tmp_path / "detector.zip"
    path.write_bytes(b"")
    conclude(Args(out=tmp_path, seeds="9002-9009"), path, records, 1.0, 2.0)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["name"] == "hand-detector"
    assert summary["metrics"]["found"]["value"] == 100.0
    assert summary["metrics"]["false_claims"]["reached"] is True
    assert (tmp_path / "figure_4.png").exists()
    page = (tmp_path / "report.html").read_text()
    moves = "A second hand, and the own one moves"
    for title in (
        "Criteria",
        "Weakest families",
        "Bad input",
        moves,
        "By skin",
        "The worst frames",
    ):
        assert title in page


class Blind:
    """A detector that sees nothing."""

    def __init__(self, camera: Camera, path: Path) -> None:
        assert (camera.width, path.name) == (640, "detector.zip")

    def detect(self, frame_rgb: np.ndarray, expected: np.ndarray | None = None) -> Enum:
        return Reason.NOT_SEEN


def test_a_run_judges_a_file_and_is_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiments.hand_detector.trial.TrainedHandDetector", Blind)
    path = tmp_path / "detector.zip"
    path.write_bytes(b"")
    args = Args(detector=path, seeds="9003", out=tmp_path / "out")
    first = run.main(args)
    assert first["metrics"]["found"]["reached"] is False
    assert (tmp_path / "out" / "frames" / "frames_9003_9003.json").exists()
    monkeypatch.delattr("experiments.hand_detector.trial.TrainedHandDetector")
    assert run.main(args)["metrics"] == first["metrics"]
