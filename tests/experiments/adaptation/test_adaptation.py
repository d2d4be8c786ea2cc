"""Adaptation: learning compensates for elongated muscles, and only learning."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.adaptation.critical_muscles import critical_muscles, effect_deg, rest
from experiments.adaptation.run import ELONGATED, ELONGATION, QUICK, conclude, run
from experiments.adaptation.sizes import BEFORE, EVENT, OFF
from experiments.robots.conditions import ACTUAL, NOMINAL
from kengoro.trained_maps import ARM
from kengoro.visits import errors
from kengoro_env.assets import asset_path
from kengoro_env.postures import posture_set
from kengoro_env.robot.muscle_law import DEFAULT_GAINS
from kengoro_env.robot.nominal_model import NominalArm

SIZES = replace(QUICK, learned=8, more=4, every=4, tested=2)


@pytest.fixture(scope="module")
def cache(request: pytest.FixtureRequest) -> Path:
    """Folder of a map that is trained once and kept between test runs."""
    return Path(request.config.cache.mkdir("maps"))


@pytest.fixture(scope="module")
def result(cache: Path) -> dict[str, Any]:
    return run(NOMINAL, 0, SIZES, cache)


@pytest.mark.slow
def test_the_event_raises_the_error_and_learning_lowers_it(result: dict[str, Any]) -> None:
    found = {name: errors(test)["target_true_deg"] for name, test in result["tests"].items()}
    assert found[EVENT] > 1.5 * found[BEFORE]
    assert found[OFF] == pytest.approx(found[EVENT], rel=0.1)
    assert found[str(SIZES.more)] < 0.5 * found[EVENT]


@pytest.mark.slow
def test_the_elongated_muscles_are_listed(result: dict[str, Any]) -> None:
    assert set(result["identified"]) == set(critical_muscles(ELONGATED, ELONGATION))


@pytest.mark.slow
def test_findings_hold_all_robots(result: dict[str, Any]) -> None:
    results = {seed: {ACTUAL: result, NOMINAL: result} for seed in (0, 1)}
    found = conclude(results, SIZES)
    assert {"event_ratio", "adapted_ratio", "off_ratio"} <= found.metrics.keys()
    assert found.metrics["event_ratio"]["must"] == 1.5
    assert found.metrics["adapted_ratio"]["must"] == 1.25
    tests = result["tests"]
    before, after = (errors(tests[name])["target_true_mm"] for name in (BEFORE, str(SIZES.more)))
    assert found.metrics["hand_adapted_ratio"]["median"] == pytest.approx(after / before, rel=1e-3)
    assert found.metrics["muscles_found"]["median"] == ELONGATED
    assert found.metrics["muscles_false_positive"]["worst"] == 0
    assert list(found.per_seed) == [0, 1]
    assert all(picture.png.startswith(b"\x89PNG") for picture in found.pictures)


def test_the_nominal_arm_rests_where_pull_and_gravity_balance() -> None:
    arm, gains = NominalArm(asset_path(ARM)), DEFAULT_GAINS
    posture = posture_set()[0]
    target = arm.lengths(posture)[0]
    here = rest(arm, target, posture)
    tension = gains.bias + gains.stiffness * np.maximum(0.0, arm.lengths(here)[0] - target)
    torque = arm.gravity(here) - arm.moment_arms(here).T @ tension
    inside = (here > arm.lower + 1e-9) & (here < arm.upper - 1e-9)
    assert np.abs(torque[inside]).max() < 0.1
    assert 0.0 < np.degrees(np.abs(here - posture)).max() < 10.0


def test_the_critical_muscles_move_the_nominal_arm_most() -> None:
    muscles = critical_muscles(2, ELONGATION)
    assert muscles == critical_muscles(ELONGATED, ELONGATION)[:2]
    one = effect_deg(muscles[:1], ELONGATION)
    assert effect_deg(muscles, ELONGATION) > one
    for other in NominalArm(asset_path(ARM)).muscles:
        assert effect_deg((other,), ELONGATION) <= one
    assert effect_deg(muscles, 0.0) == pytest.approx(0.0, abs=0.02)
