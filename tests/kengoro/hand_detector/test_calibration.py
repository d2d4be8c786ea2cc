"""Tests of the calibration of a hand detector."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from jmm_agent.vision.hand_model_file import HandModel, read_hand_model, write_hand_model
from kengoro.errors import UsageError
from kengoro.hand_detector.calibration import ELSEWHERE, calibrate, calibrated
from kengoro.hand_detector.evaluation import PoseDeviation
from kengoro.hand_detector.examples import Source
from kengoro.hand_detector.frames import FrameMaker
from kengoro.hand_weights import KENGORO
from kengoro_env.assets import asset_path, assets_root

OURS = Source(asset_path("mjcf/kengoro_arm/can_grasp.xml"), "hand", "eye", ("marker_plate",))


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """A single hand is enough, so that few frames are."""
    monkeypatch.setattr("kengoro.hand_detector.calibration.LEAST_HANDS", 1)


@pytest.mark.slow
@pytest.mark.usefixtures("few")
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


def test_a_detector_that_finds_too_few_hands_is_not_calibrated(tmp_path: Path) -> None:
    """Six frames show at most three hands."""
    path = tmp_path / "uncalibrated.zip"
    path.write_bytes((assets_root() / KENGORO).read_bytes())
    with pytest.raises(UsageError, match=r"^In 6 new frames the detector finds [0-3] of [1-3] vis"):
        calibrate(OURS, path, 6, lambda _: None)
    assert path.read_bytes() == (assets_root() / KENGORO).read_bytes()


@pytest.mark.usefixtures("few")
def test_a_calibration_has_frames_with_textures_that_were_not_learned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bool] = []
    maker = Source.maker

    def noted(source: Source, others: bool = False) -> FrameMaker:
        asked.append(others)
        return maker(source, others)

    monkeypatch.setattr(Source, "maker", noted)
    path = tmp_path / "hand.zip"
    path.write_bytes((assets_root() / KENGORO).read_bytes())
    calibrate(OURS, path, 2, lambda _: None)
    assert asked == [True]


def test_the_regions_of_a_calibration_hold_the_errors() -> None:
    """Of positions, of rotations, and of both, whose errors go together."""
    random = np.random.default_rng(0)
    model = HandModel("hand", ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0)), 128, 145.0)
    errors = []
    for _ in range(4000):
        size = random.lognormal(0.0, 0.5)  # of both alike: a few hands are bad in all
        claimed = np.diag(random.uniform(0.5, 2.0, 6)) ** 2 * 1e-4
        error = size * np.sqrt(np.diag(claimed)) * random.normal(size=6)
        errors.append(PoseDeviation(error * np.repeat([3.0, 5.0], 3), claimed))
    found = calibrated(model, 0.9, errors)
    factors = np.repeat([found.position_factor, found.rotation_factor], 3) / ELSEWHERE
    for part, degrees in ((slice(0, 3), 3), (slice(3, 6), 3), (slice(0, 6), 6)):
        bound = chi2.ppf(0.95, degrees)
        held = np.mean([error.distance(part, factors) < bound for error in errors])
        assert 0.94 <= held <= 0.97
    assert found.rotation_factor / found.position_factor == pytest.approx(5.0 / 3.0, rel=0.05)
    assert found.threshold == 0.9


def test_the_shipped_file_names_no_folder_and_is_small() -> None:
    path = assets_root() / KENGORO
    assert path.stat().st_size < 8e6
    _, *networks = read_hand_model(path)
    for network in networks:
        assert b'File "' not in network
