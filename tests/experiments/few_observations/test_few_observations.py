"""Few observations: metrics and tables of made-up results, and a short run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from experiments.few_observations.methods import (
    BLIND,
    BY_SOURCE,
    DRIVING,
    GAUSSIAN,
    GIVEN,
    METHODS,
    OURS,
    POLYNOMIAL,
    Sizes,
)
from experiments.few_observations.run import QUICK, run
from experiments.few_observations.sources import SOURCES
from experiments.few_observations.tables import metrics, per_seed, tables
from experiments.harness.experiment import Results

SIZES = Sizes(counts=(1, 3), blind=4)


def found(joints: float) -> dict[str, float]:
    """Errors of a map: joints [deg], and ten times as many mm of the hand."""
    return {"target_true_deg": joints, "target_true_mm": 10.0 * joints, "max_tension_N": 200.0}


def results() -> Results:
    """Three robots: others leave 2, 3, 4 times our error of 1 deg after a look, of 8 before."""
    made: Results = {}
    for seed in range(3):
        robot: dict[str, Any] = {}
        for rank, name in enumerate(DRIVING):
            errors = {"0": found(8.0), "1": found(1.0 + rank), "3": found(0.5 + rank)}
            robot[name] = {name: errors, "observations": 3}
        for name in GIVEN:
            robot[OURS][name] = {"1": found(9.0), "3": found(0.25)}
        robot[BLIND] = {"0": found(8.0), "4": found(4.0)}
        source = {"error_deg": 2.0, "predicted_deg": 3.0, "covered": 1.0}
        robot[BY_SOURCE] = dict.fromkeys(SOURCES, source)
        made[seed] = robot
    return made


def test_metrics_are_shares_of_the_error_before_and_differences_from_the_best_other() -> None:
    named = metrics(results(), SIZES)
    assert named["share_of_error_after_1_deg"]["median"] == pytest.approx(1.0 / 8.0)
    assert named["share_of_error_after_1_deg"]["reached"]
    assert named["error_after_3_mm"]["median"] == 5.0
    assert named["above_best_other_after_1_deg"]["median"] == -1.0
    assert named["above_best_other_after_3_deg"]["median"] == 0.25
    assert not named["above_best_other_after_3_deg"]["reached"]
    assert named["share_of_error_blind_mm"]["median"] == 0.5


def test_tables_have_a_row_for_each_method_and_source() -> None:
    joints, _, _, differences, sources = tables(results(), SIZES)
    assert len(joints.rows) == len(METHODS) + 1
    assert joints.rows[0][1:] == ("8.0 (8.0)", "1.0 (1.0)", "0.5 (0.5)")
    assert joints.rows[-1][1:3] == ("8.0 (8.0)", "4.0 (4.0)")
    assert "number of looks" in joints.title
    assert differences.rows[0][1] == "-1.00 (-1.00 to -1.00)"
    assert [row[0] for row in sources.rows] == list(SOURCES.values())
    assert per_seed(results())[2][GAUSSIAN] == {"1": 9.0, "3": 0.25}


def test_ours_provides_joint_angles_to_others(tmp_path: Path) -> None:
    part = run(OURS, 0, QUICK, tmp_path)
    assert part[OURS]["3"]["target_true_deg"] < 0.6 * part[OURS]["0"]["target_true_deg"]
    assert set(part[POLYNOMIAL]) == {"1", "3"}
