"""`python -m benchmarks markers`: frames that show what they promise, and a fair conclusion."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks import markers
from benchmarks._marker_frames import SIDE, render
from benchmarks.markers import CONDITIONS, Tally, conclude, measure, ratios
from jmm_agent.vision.square_pose import square_corners


def tally(mm: list[float], flipped: bool = False, unsure: bool = False) -> Tally:
    count = len(mm)
    return Tally(mm, mm.copy(), [flipped] * count, [unsure] * count, [0.01] * count)


def test_a_rendered_marker_lies_at_its_true_pose_and_within_its_size() -> None:
    for condition in (CONDITIONS[0], CONDITIONS[10], CONDITIONS[12]):
        image, pose = render(condition, 3, np.random.default_rng(0), None)
        camera = condition.camera
        corners = camera.project(square_corners(SIDE) @ pose[:3, :3].T + pose[:3, 3])
        low, high = condition.size
        edges = np.linalg.norm(np.roll(corners, 1, axis=0) - corners, axis=1)
        assert 0.5 * low < edges.max() < 1.3 * high
        inner, outer = (
            camera.project(s * square_corners(SIDE) @ pose[:3, :3].T + pose[:3, 3])
            for s in (0.9, 1.12)
        )
        for x, y in np.rint(inner).astype(int):
            assert image[y, x, 0] < 60
        for x, y in np.rint(outer).astype(int):
            assert image[y, x, 0] > 120


def test_errors_are_compared_where_both_found_the_marker() -> None:
    results = {
        "ours": tally([1.0, 2.0, 50.0]),
        "SUBPIX": tally([4.0, 4.0, np.nan]),
        "APRILTAG": tally([np.nan, np.nan, np.nan]),
    }
    assert ratios(results) == {"mm": 1.5 / 4.0, "deg": 1.5 / 4.0}


def test_what_is_not_reached_is_named() -> None:
    good = {"ours": tally([1.0, 1.0]), "SUBPIX": tally([3.0, 3.0]), "APRILTAG": tally([4.0, 4.0])}
    bad = {
        "ours": tally([1.2, np.nan], flipped=True),
        "SUBPIX": tally([1.0, 1.0]),
        "APRILTAG": tally([np.nan, np.nan]),
    }
    assert all(found["reached"] for found in conclude({"a": good, "b": good}).values())
    found = conclude({"a": good, "b": good, "c": bad})
    reached = {name: metric["reached"] for name, metric in found.items()}
    assert reached == {
        "markers_fewer_than_opencv": False,
        "position_error_ratio_median": True,
        "position_error_ratio_worst": False,
        "rotation_error_ratio_median": True,
        "rotation_error_ratio_worst": False,
        "flips": False,
        "ambiguous_share": True,
    }
    assert found["position_error_ratio_worst"]["condition"] == "c"
    assert found["flips"]["value"] == 2


def test_an_ambiguous_pose_is_no_flip_but_few_may_be_ambiguous() -> None:
    bad = {"ours": tally([1.0, 1.0], flipped=True, unsure=True)}
    bad |= {"SUBPIX": tally([3.0, 3.0]), "APRILTAG": tally([4.0, 4.0])}
    found = conclude({"a": bad})
    assert found["flips"] == {"value": 0, "must": "0", "reached": True, "with_ambiguous": 2}
    assert found["ambiguous_share"]["value"] == 1.0
    assert not found["ambiguous_share"]["reached"]


def test_a_run_on_photographs_prints_its_table_and_writes_its_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    photograph = np.random.default_rng(0).integers(0, 255, (60, 80), np.uint8)
    cv2.imwrite(str(tmp_path / "desk.png"), photograph)
    monkeypatch.setattr(markers, "CONDITIONS", (replace(CONDITIONS[1], name="desk"),))
    markers.main(frames=2, first=0, backgrounds=tmp_path, out=tmp_path / "out")
    assert "desk" in capsys.readouterr().out
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    assert summary["metrics"]["markers_fewer_than_opencv"]["reached"]
    with pytest.raises(SystemExit, match=r"no \.jpg or \.png"):
        markers.main(backgrounds=tmp_path / "out", out=tmp_path)


def test_a_marker_that_is_not_shown_counts_as_not_found() -> None:
    dark = replace(CONDITIONS[1], light=0.0, noise=0.0)
    found = measure(dark, [0], None)
    assert [tally.found for tally in found.values()] == [0, 0, 0]
