"""Stiffness: metrics and tables of made-up results, a push of known joints, and a short run."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from experiments.harness.experiment import Results
from experiments.stiffness_and_load.figures import pictures
from experiments.stiffness_and_load.load import estimated
from experiments.stiffness_and_load.run import COMPLIANCE, HARDENING, QUICK, push, run
from experiments.stiffness_and_load.tables import (
    AGENTS,
    FEEDBACK,
    FRICTION_TITLES,
    OURS,
    SAG,
    SIDE,
    TENDONS,
    friction_metrics,
    friction_table,
    load_metrics,
    load_table,
    metrics,
    per_seed,
    tables,
)
from kengoro.session import Session
from kengoro_env.departures import TendonStretch, actual

STIFFNESS = (30.0, 3.0)


def results() -> Results:
    """Two robots with errors of 1 and 2 deg, twice that at 3 N/mm, and 8 times without tensions."""
    made: Results = {}
    for seed in range(2):
        robot: dict[str, Any] = {}
        for agent, worse, tension in ((SAG, 8.0, 200.0), (OURS, 2.0, 150.0), (TENDONS, 2.0, 150.0)):
            usual = {
                "target_true_deg": 1.0 + seed,
                "worst_deg": 3.0,
                "target_true_mm": 10.0,
                "max_tension_N": tension,
            }
            soft = usual | {"target_true_deg": worse * (1.0 + seed)}
            bias = 0.8 if agent == OURS else 1.1
            pushes = [
                {"joint": "elbow", "asked": asked, "predicted": asked, "measured": bias * asked,
                 "muscles": [2000, 9000], "tension_N": 90.0}
                for asked in (10.0, 20.0)
            ]  # fmt: skip
            at = {"30": usual, "3": soft}
            robot[agent] = {"at": at, "pushes": [] if agent == SAG else pushes, "observations": 1}
        made[seed] = robot
    return made


def test_metrics_are_ratios_to_the_stiffness_of_learning_and_to_the_maps_lengths() -> None:
    named = metrics(results(), STIFFNESS)
    assert named["error_at_3_over_30_deg"]["median"] == pytest.approx(2.0)
    assert named["error_at_3_over_30_deg"]["reached"]
    assert named["largest_tension_ratio"]["median"] == pytest.approx(0.75)
    assert not named["largest_tension_ratio"]["reached"]
    assert named["error_above_that_of_map_lengths_deg"]["median"] == 0.0
    assert named["stiffness_away_tensions"]["median"] == pytest.approx(0.2)
    assert named["stiffness_away_tensions_and_tendons"]["median"] == pytest.approx(0.1)


def test_what_is_done_against_friction_counts_over_a_movement_alone() -> None:
    made = results()
    for robot in made.values():
        robot[OURS]["at"] = {
            key: one | {"estimate_target_deg": 0.5} for key, one in robot[OURS]["at"].items()
        }
        for kind, share in ((SIDE, 1.1), (FEEDBACK, 0.4)):
            robot[OURS][kind] = {
                key: {name: share * value for name, value in one.items()}
                for key, one in robot[OURS]["at"].items()
            }
    named = friction_metrics(made, STIFFNESS)
    assert named["from_one_side_over_movement_at_30_deg"]["median"] == pytest.approx(1.1)
    assert named["feedback_over_movement_at_3_mm"]["worst"] == pytest.approx(0.4)
    table = friction_table(made, STIFFNESS)
    assert [row[:2] for row in table.rows[::2]] == [
        (title, "30") for title in FRICTION_TITLES.values()
    ]
    assert table.rows[-1][2:4] == ("0.2 (0.2)", "1.2 (1.6)")


def test_tables_have_a_row_for_each_agent_and_stiffness_and_for_each_push(tmp_path: Path) -> None:
    errors, pushes = tables(results(), STIFFNESS)
    assert len(errors.rows) == len(AGENTS) * len(STIFFNESS)
    assert errors.rows[1][1:3] == ("3", "12.0 (16.0)")
    assert errors.rows[1][-1] == "1.7"  # 5 N at 3 N/mm
    assert len(pushes.rows) == 2 * 2 * 2
    assert pushes.rows[0][3:7] == ("10.0", "10.0", "8.0", "2.0 to 9.0")
    assert per_seed(results())[1][SAG] == {"30": [2.0, 200.0], "3": [16.0, 200.0]}
    [picture] = pictures(results(), STIFFNESS)
    assert len(picture.png) > 10_000


@pytest.mark.parametrize("stiffness", [12.0, 90.0])
def test_friction_does_not_count_in_a_push(stiffness: float) -> None:
    """A joint that dry friction holds back by the same torque at each level."""
    friction, angle, torque = 0.2, 0.0, np.zeros(1)

    def wait(_: float) -> None:
        nonlocal angle
        pull = float(torque[0])
        if abs(pull) > friction:
            angle = (pull - np.sign(pull) * friction) / stiffness
        session.truth["joint_angles"][0] = angle

    joint = SimpleNamespace(dofadr=[0])
    robot = SimpleNamespace(
        model=SimpleNamespace(joint=lambda _: joint), data=SimpleNamespace(qfrc_applied=torque)
    )
    world = SimpleNamespace(robot=robot, joints=("elbow",))
    session = SimpleNamespace(world=world, wait=wait, truth={"joint_angles": np.zeros(1)})
    found = push(cast(Session, session), "elbow", 1.0, 2.0)
    assert found == pytest.approx(stiffness, rel=1e-6)
    assert torque[0] == 0.0


def test_a_short_run_has_errors_and_pushes(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    cache = Path(request.config.cache.mkdir("maps"))
    ours, sag = (run(name, 0, QUICK, cache) for name in (OURS, SAG))
    assert set(ours["at"]) == set(sag["at"]) == {"30", "10"}
    assert ours["at"]["10"]["target_true_deg"] < sag["at"]["10"]["target_true_deg"]
    [one] = ours["pushes"]
    assert one["measured"] == pytest.approx(one["asked"], rel=0.4)
    assert sag["pushes"] == []
    empty, full = (ours["loads"][mass] for mass in ("0", "1"))
    assert abs(full["mass_kg"] - empty["mass_kg"] - 1.0) < 0.2
    assert "loads" not in sag


def test_a_bench_shows_how_the_tendons_of_actual_robots_stretch() -> None:
    assert TendonStretch(COMPLIANCE, HARDENING) in actual(3)


def test_loads_are_compared_with_an_empty_hand() -> None:
    rows = {"target_true_mm": 9.0, "max_tension_N": 170.0}
    found = {
        seed: {
            OURS: {
                "loads": {
                    "0": rows | {"mass_kg": -0.02, "std_kg": 0.1, "target_true_deg": 1.0},
                    "0.5": rows | {"mass_kg": 0.5 + error, "std_kg": 0.1, "target_true_deg": 1.2},
                }
            }
        }
        for seed, error in ((1, 0.02), (2, -0.1))
    }
    named = load_metrics(found, (0.0, 0.5))
    assert named["mass_of_nothing_kg"]["median"] == pytest.approx(0.02)
    assert named["mass_error_0.5_kg"]["worst"] == pytest.approx(0.2)
    assert named["error_with_0.5_kg_over_empty_deg"]["median"] == pytest.approx(1.2)
    table = load_table(found, (0.0, 0.5))
    assert table.rows[1][:4] == ("0.5", "0.46", "0.40 to 0.52", "0.10")
    for seed in found:
        found[seed][OURS]["loads"]["0.5"] |= estimated(0.0, np.inf)
    assert load_table(found, (0.0, 0.5)).rows[1][:4] == ("0.5", "0.00", "0.00 to 0.00", "unknown")
    assert json.dumps(estimated(0.5, np.inf), allow_nan=False)
