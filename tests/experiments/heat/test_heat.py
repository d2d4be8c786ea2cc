"""The experiment on heat: plans from a log, and metrics that can fail."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from experiments.heat.plan import FAULTY, faulty, healthy, planned
from experiments.heat.robot import QUICK, TensionLog
from experiments.heat.tables import FAULTS, HEALTHY, POSTURES, WHOLE, metrics, tables

LOG = TensionLog(
    np.random.default_rng(0).uniform(30.0, 140.0, (40, 12)),
    np.random.default_rng(1).uniform(30.0, 140.0, (4, 12)),
)


def test_a_plan_repeats_the_log_and_holds_its_rests() -> None:
    tensions = planned(LOG, 4000.0, seed=3)
    assert tensions.shape == (4000, 12)
    rows = {row.tobytes() for row in np.vstack([LOG.moving, LOG.held])}
    assert {row.tobytes() for row in tensions} <= rows
    assert not np.array_equal(tensions, planned(LOG, 4000.0, seed=4))


def test_metrics_are_reached_or_not() -> None:
    sizes = replace(QUICK, hours=0.1, fault_after=200.0, fault_for=60.0)
    result = {
        HEALTHY: healthy(LOG, 0, sizes),
        FAULTS: {"changes": faulty(LOG, 0, sizes)},
        POSTURES: {
            "limited": {"error_deg": 6.0, "hottest": 70.0},
            "free": {"error_deg": 5.0, "hottest": 90.0},
        },
        WHOLE: {},
    }
    assert len(result[FAULTS]["changes"]) == FAULTY
    found = metrics({0: result})
    assert found["highest_core"]["reached"]
    assert found["posture_error_ratio"]["reached"]
    hot = {**result, HEALTHY: {**result[HEALTHY], "hottest": 80.5, "false_names": 1}}
    found = metrics({0: result, 1: hot})
    assert not found["highest_core"]["reached"]
    assert not found["false_names"]["reached"]
    assert len(tables({0: result, 1: hot})) == 2
