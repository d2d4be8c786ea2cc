"""Snapped muscles: metrics that can fail, tables, what the actual robot lacks, a short run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.harness.experiment import Results
from experiments.robots.conditions import ACTUAL
from experiments.robots.robot_arms import RobotArms
from experiments.wire_snaps.balance import Balances
from experiments.wire_snaps.figures import pictures
from experiments.wire_snaps.run import QUICK, run
from experiments.wire_snaps.tables import metrics, per_seed, tables
from jmm_agent.guard.faults import MotorControl
from kengoro.robots import arm_scene, shuffled_postures
from kengoro_env.departures import actual
from kengoro_env.names import JOINTS
from kengoro_env.robot.robot import Robot


def visited(degrees: float, held: bool = True, named: str | None = None) -> dict[str, Any]:
    return {
        "wanted_deg": degrees,
        "target_deg": 0.5 * degrees,
        "held": held,
        "named": named,
        "lacks": None if held else "elbow",
        "largest_N": 200.0,
        "demanded_N": 480.0,
    }


def results(**changes: Any) -> Results:
    """A robot whose errors are 1 and 3 deg, and 1.5 times that without a muscle."""
    muscle = {
        "muscle": "triceps",
        "lost": 0.4,
        "lost_actual": 0.5,
        "named_s": 0.14,
        "left_out_s": 0.64,
        "others": [],
        "observations": 7,
        "largest_N": 300.0,
        "demanded_N": 400.0,
        "unnoticed": [visited(8.0), visited(9.0, held=False)],
        "after": [visited(2.0), visited(20.0, held=False, named="elbow")],
        "learned": [visited(1.5), visited(16.0, held=False, named="sh_yaw")],
    }
    before = [visited(1.0), visited(3.0)]
    return {4: {ACTUAL: {"false": [], "before": before, "muscles": [muscle | changes]}}}


def test_errors_count_where_a_posture_can_be_held_by_the_balance() -> None:
    found = metrics(results())
    assert found["error_learned_over_before"]["median"] == pytest.approx(1.5)
    assert found["error_learned_over_before"]["reached"]
    assert found["error_unnoticed_over_before"]["median"] == pytest.approx(8.0)
    assert found["named_joint_right"]["median"] == pytest.approx(0.5)
    assert found["held_as_on_the_robot"]["median"] == 1.0
    assert found["error_at_nearest_posture_deg"]["median"] == pytest.approx(8.0)
    assert found["postures_that_can_be_held"]["median"] == pytest.approx(0.6)
    assert found["largest_demand_N"]["reached"]
    assert per_seed(results())[4]["learned"] == pytest.approx(1.5)


def test_each_requirement_can_fail() -> None:
    late = results(learned=[visited(4.5), visited(6.0)])
    assert not metrics(late)["error_learned_over_before"]["reached"]
    assert not metrics(results(named_s=None))["named_share"]["reached"]
    assert not metrics(results(others=["biceps"]))["intact_muscles_named"]["reached"]
    assert not metrics(results(demanded_N=500.1))["largest_demand_N"]["reached"]


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"named_s": None}, "named_share"),
        ({"others": ["biceps"]}, "intact_muscles_named"),
        ({"demanded_N": 500.1}, "largest_demand_N"),
    ],
)
def test_one_bad_robot_of_three_does_not_reach_what_each_must(
    change: dict[str, Any], name: str
) -> None:
    three = {5: results()[4], 6: results()[4]}
    assert metrics({**three, 7: results()[4]})[name]["reached"]
    assert not metrics({**three, 7: results(**change)[4]})[name]["reached"]


def test_tables_and_figure_have_a_row_for_each_muscle() -> None:
    [table] = tables(results())
    assert table.rows[0][:4] == (4, "triceps", "0.14", "60, 50")
    assert table.rows[0][7] == "1.0, 1.5"
    strained = visited(2.0) | {"largest_N": 400.0}
    [table] = tables(results(after=[strained, strained]))
    assert table.rows[0][-1] == "400"
    [picture] = pictures(results(named_s=None))
    assert len(picture.png) > 5_000


def test_the_actual_robot_lacks_torque_at_the_elbow_without_its_extensor() -> None:
    arms, motors = RobotArms(Robot(arm_scene(), actual(3))), MotorControl()
    limits = np.tile([-10.0, 10.0], (len(JOINTS), 1))
    balances = Balances(motors, limits)
    lacking = [balances.lacking(arms, "triceps", q) for q in shuffled_postures(3)[:6]]
    assert lacking.count(JOINTS.index("elbow")) >= 3
    assert balances.lost(arms, "delt_mid", shuffled_postures(3)[:6]) == 0.0


def test_a_short_run_names_the_muscle(request: pytest.FixtureRequest) -> None:
    cache = Path(request.config.cache.mkdir("maps"))
    found = run(ACTUAL, 1, QUICK, cache)
    [muscle] = found["muscles"]
    assert muscle["named_s"] < 0.5
    assert muscle["left_out_s"] < 1.2
    assert (found["false"], muscle["others"]) == ([], [])
    assert muscle["demanded_N"] <= 500.0 + 1e-3
    assert len(muscle["learned"]) == QUICK.tested
