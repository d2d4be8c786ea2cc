"""Visits: what was wanted, true, estimated and seen at a posture, and the errors between them."""

from __future__ import annotations

import numpy as np
import pytest

from kengoro.arm import ACTUAL, make_session, new_agent, shuffled_postures
from kengoro.visits import (
    Visits,
    error_rows,
    errors,
    gaps,
    group_joints,
    hand_mm,
    no_visits,
    rmse_deg,
    visit,
)
from kengoro_env.names import JOINTS

SEED = 1


def some_visits() -> Visits:
    zero = np.zeros(len(JOINTS))
    one = np.eye(len(JOINTS))[JOINTS.index("elbow")]
    visits = no_visits()
    for seen in (None, one.tolist()):
        visits["target"].append(zero.tolist())
        visits["true"].append((np.radians(14.0) * one).tolist())
        visits["estimate"].append(zero.tolist())
        visits["seen"].append(seen)
        visits["max_tension"].append(100.0)
        visits["time"].append(1.0)
    return visits


def test_errors_of_made_up_visits() -> None:
    visits = some_visits()
    root = np.sqrt(len(JOINTS))
    np.testing.assert_allclose(rmse_deg(visits, "target_true"), 14.0 / root)
    elbow = np.array([JOINTS.index("elbow")])
    np.testing.assert_allclose(rmse_deg(visits, "target_true", elbow), 14.0)
    assert gaps(visits, "estimate_seen").shape == (1, len(JOINTS))
    found = errors(visits)
    assert found["target_true_deg"] == pytest.approx(14.0 / root, abs=1e-3)
    assert found["estimate_target_deg"] == 0.0
    assert found["estimate_target_mm"] == 0.0
    forearm = 0.35  # [m] elbow to grip point, about
    assert hand_mm(visits, "target_true")[0] == pytest.approx(1e3 * forearm * 0.244, rel=0.2)
    assert found["max_tension_N"] == 100.0


def test_what_was_never_seen_is_left_out_and_told() -> None:
    visits = some_visits()
    visits["seen"] = [None, None]
    found = errors(visits)
    assert "estimate_seen_deg" not in found
    rows = {row[0]: row[1] for row in error_rows({"column": [found]})}
    assert rows["estimate - seen (the paper's) [deg]"] == "-"
    assert rows["largest tension [N]"] == "100.0 (100.0)"


def test_groups_own_all_joints_once() -> None:
    groups = group_joints()
    every = groups.pop("all")
    np.testing.assert_array_equal(np.sort(np.concatenate(list(groups.values()))), every)


@pytest.fixture(scope="module")
def visited(request: pytest.FixtureRequest) -> Visits:
    """Two visits of an actual robot; it learns at the first only."""
    agent = new_agent(request.config.cache.mkdir("maps"), SEED)
    start, *postures = shuffled_postures(SEED)[:3]
    session = make_session(ACTUAL, SEED, agent, start)
    visits = no_visits()
    before = agent.map
    visit(session, postures[0], visits)
    assert agent.map is not before
    agent.learning, learned = False, agent.map
    visit(session, postures[1], visits)
    assert agent.map is learned
    session.env.close()
    return visits


def test_a_visit_is_judged_before_it_is_learned_from(visited: Visits) -> None:
    """What was learned at the first posture explains its look; the visit still tells the miss."""
    found = rmse_deg(visited, "estimate_seen")
    assert found[0] > 2.0
    assert len(found) == 2
    assert visited["time"][1] > visited["time"][0] > 2.0
    np.testing.assert_allclose(visited["target"], shuffled_postures(SEED)[1:3], atol=1e-6)


def test_truth_and_estimate_differ_on_an_actual_robot(visited: Visits) -> None:
    assert (rmse_deg(visited, "estimate_true") > 3.0).all()
    assert (rmse_deg(visited, "target_true") > 3.0).all()
