"""Tests of the calibration of a hand detector."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from jmm_agent.vision.hand_model_file import read_hand_model, write_hand_model
from kengoro.hand_detector.calibration import calibrate
from kengoro.hand_detector.examples import Source
from kengoro.hand_weights import KENGORO
from kengoro_env.assets import asset_path, assets_root

OURS = Source(asset_path("mjcf/kengoro_arm/can_grasp.xml"), "hand", "eye", ("marker_plate",))


def test_a_calibration_finds_the_same_factors_whatever_was_in_the_file(tmp_path: Path) -> None:
    model, *networks = read_hand_model(assets_root() / KENGORO)
    found = []
    for factor in (1.0, 7.0):
        path = tmp_path / f"{factor}.zip"
        given = replace(model, position_factor=factor, rotation_factor=0.5 * factor)
        write_hand_model(path, given, *networks)
        result = calibrate(OURS, path, 60, lambda _: None)
        found.append(read_hand_model(path)[0])
    one, other = found
    assert one.position_factor == pytest.approx(other.position_factor, rel=1e-6)
    assert one.rotation_factor == pytest.approx(other.rotation_factor, rel=1e-6)
    assert one.threshold == other.threshold
    assert result.found > 0.8
    assert result.claimed <= 0.04


def test_the_shipped_file_names_no_folder_and_is_small() -> None:
    path = assets_root() / KENGORO
    assert path.stat().st_size < 8e6
    _, *networks = read_hand_model(path)
    for network in networks:
        assert b'File "' not in network
