"""Antagonism Updater on the elbow: antagonistic muscles pull less, by learning only."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from experiments.antagonism_elbow.run import (
    OFF,
    OURS,
    START_N,
    Sizes,
    conclude,
    numbers,
    run,
)
from experiments.robots.conditions import ACTUAL, NOMINAL
from experiments.robots.elbow import Elbow

SEED = 20
SIZES = Sizes(trials=3, move=0.8, hold=0.8, tightening=1e-3)


@pytest.fixture(scope="module")
def maps(request: pytest.FixtureRequest) -> Path:
    return request.config.cache.mkdir("maps")


@pytest.fixture(scope="module")
def result(maps: Path) -> dict:
    return run(ACTUAL, SEED, SIZES, maps)


@pytest.mark.slow
def test_the_first_movement_needs_what_it_should(result: dict) -> None:
    for name in (OURS, OFF):
        assert result[name][0]["largest"] == pytest.approx(START_N, abs=35.0)
        assert len(result[name]) == 1 + SIZES.trials


@pytest.mark.slow
def test_tension_falls_by_learning_only(result: dict) -> None:
    ours, off = result[OURS], result[OFF]
    assert ours[-1]["largest"] < 0.68 * ours[0]["largest"]
    assert off[-1]["largest"] == pytest.approx(off[0]["largest"], rel=0.1)
    first, last = numbers(ours[0]), numbers(ours[-1])
    assert last["antagonist_N"] < first["antagonist_N"]
    assert last["agonist_difference_N"] < first["agonist_difference_N"]
    assert 0.0 <= last["excess_N"] < first["excess_N"]


@pytest.mark.slow
def test_it_does_not_learn_where_the_arm_is(result: dict) -> None:
    """As the paper says: this updater modifies the antagonism only."""
    first, last = numbers(result[OURS][0]), numbers(result[OURS][-1])
    assert last["estimate_true_deg"] > 0.7 * first["estimate_true_deg"]
    assert abs(last["true_at_90_deg"] - first["true_at_90_deg"]) < 10.0


def test_numbers_of_a_made_up_trial() -> None:
    trial = {
        "largest": 300.0,
        "tensions": [[100.0, 60.0, 50.0], [100.0, 140.0, 70.0], [80.0, 80.0, 90.0]],
        "least": [40.0, 40.0, 40.0],
        "target": [30.0, 60.0, 90.0],
        "true": [33.0, 63.0, 93.0],
        "estimate": [29.0, 59.0, 89.0],
    }
    assert numbers(trial) == {
        "largest_N": 300.0,
        "agonist_difference_N": pytest.approx(80.0 / 3.0),
        "antagonist_N": 70.0,
        "excess_N": pytest.approx((60.0 + 100.0 + 50.0) / 3.0),
        "estimate_true_deg": pytest.approx(4.0),
        "target_true_deg": pytest.approx(3.0),
        "true_at_90_deg": 93.0,
    }


def test_tightening_shortens_all_muscles_equally(maps: Path) -> None:
    loose, tight = (Elbow(NOMINAL, SEED, length, maps, learning=False) for length in (0.0, 0.004))
    there = [elbow.go(np.radians(60.0), 0.6, 0.6)[-1] for elbow in (loose, tight)]
    assert (there[1] > there[0] + 40.0).all()


@pytest.mark.slow
def test_conclusions_pair_robots_and_judge(result: dict, maps: Path) -> None:
    nominal = run(NOMINAL, SEED, SIZES, maps)
    found = conclude({SEED: {ACTUAL: result, NOMINAL: nominal}}, SIZES)
    ratio = found.metrics["tension_ratio"]
    expected = result[OURS][-1]["largest"] / result[OURS][0]["largest"]
    assert ratio["median"] == pytest.approx(expected, rel=1e-2)
    assert ratio["must"] == 0.68
    assert ratio["reached"] is (expected <= 0.68)
    assert found.per_seed[SEED][OURS]["last"]["largest_N"] == result[OURS][-1]["largest"]
    assert all(picture.png.startswith(b"\x89PNG") for picture in found.pictures)
