"""Robots of other sizes are learned with default options."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.harness.errors import ExperimentError
from experiments.other_robots.models import ROBOTS, write_model
from experiments.other_robots.public_models import add_marker
from experiments.other_robots.run import MUST, QUICK, Args, Sizes, conclude, learn, main
from kengoro_env.robot.nominal_model import NominalArm


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return Path(request.config.cache.mkdir("maps"))


def test_a_planar_finger_is_learned_in_a_few_postures(maps: Path) -> None:
    result = learn("planar-finger", 0, Sizes(learned=6, tested=3), maps)
    assert result["after_deg"] <= MUST * result["before_deg"]
    assert result["before_deg"] > 2.0
    assert result["not_reachable"] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_each_robot_is_learned_to_a_quarter(robot: str, maps: Path) -> None:
    result = learn(robot, 1, Sizes(), maps)
    assert result["after_deg"] <= MUST * result["before_deg"]


def test_a_marker_and_a_camera_are_added_to_a_model_without(tmp_path: Path) -> None:
    bare = write_model("pulley-finger", tmp_path).read_text()
    start, end = bare.index("<camera"), bare.index("/>", bare.index("<camera")) + 2
    plain = tmp_path / "plain.xml"
    plain.write_text((bare[:start] + bare[end:]).replace('name="marker_hand"', 'name="tip"'))
    path, side = add_marker(plain, tmp_path / "out")
    model = NominalArm(path).model
    assert 0.005 < side < 0.05
    assert model.site("marker_hand").bodyid[0] == model.body("distal").id
    away = model.cam_pos[model.camera("eye").id]
    assert np.isfinite(away).all()


def test_conclusions_of_learned_and_of_unreachable_robots() -> None:
    learned = {"before_deg": 10.0, "after_deg": 1.0, "not_reachable": 0.0, "reason": ""}
    refused: dict[str, Any] = {
        "before_deg": None, "after_deg": None, "not_reachable": 1.0, "reason": "too weak"
    }  # fmt: skip
    results = {"finger": {0: learned, 1: learned}, "arm": {0: refused, 1: refused}}
    summary, table = conclude(results, time.perf_counter(), 1.0)
    assert summary["metrics"]["finger"]["median"] == 0.1
    assert summary["metrics"]["finger"]["reached"]
    assert "arm" not in summary["metrics"]
    assert ("arm", "-", "-", "-", "100 %", "too weak") in table.rows
    assert QUICK.learned < Sizes().learned


def test_a_model_that_is_not_there_is_named() -> None:
    with pytest.raises(ExperimentError, match=r"no model file at nowhere\.xml"):
        main(Args(models=(Path("nowhere.xml"),)))
