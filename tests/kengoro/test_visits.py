"""Visits: target, true, estimated and seen joint angles at a posture, and their errors."""

from __future__ import annotations

import numpy as np
import pytest

from kengoro.agents import make_agent
from kengoro.robots import NO_END, make_env, shuffled_postures
from kengoro.session import Session
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


def visits_with_known_errors() -> Visits:
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


def test_errors_have_the_known_values() -> None:
    visits = visits_with_known_errors()
    root = np.sqrt(len(JOINTS))
    np.testing.assert_allclose(rmse_deg(visits, "target_true"), 14.0 / root)
    elbow = np.array([JOINTS.index("elbow")])
    np.testing.assert_allclose(rmse_deg(visits, "target_true", elbow), 14.0)
    assert gaps(visits, "estimate_seen").shape == (1, len(JOINTS))
    found = errors(visits)
    assert found["target_true_deg"] == pytest.approx(14.0 / root, abs=1e-3)
    assert found["estimate_target_deg"] == 0.0
    assert found["estimate_target_mm"] == 0.0
    forearm = 0.35  # [m], about, from the elbow to the grip point
    assert hand_mm(visits, "target_true")[0] == pytest.approx(1e3 * forearm * 0.244, rel=0.2)
    assert found["max_tension_N"] == 100.0


def test_errors_against_seen_angles_are_left_out_without_a_marker_observation() -> None:
    visits = visits_with_known_errors()
    visits["seen"] = [None, None]
    found = errors(visits)
    assert "estimate_seen_deg" not in found
    rows = {row[0]: row[1] for row in error_rows({"column": [found]})}
    assert rows["estimate - seen (the paper's) [deg]"] == "-"
    assert rows["largest tension [N]"] == "100.0 (100.0)"


def test_each_joint_is_in_one_group() -> None:
    groups = group_joints()
    all_joints = groups.pop("all")
    np.testing.assert_array_equal(np.sort(np.concatenate(list(groups.values()))), all_joints)


@pytest.fixture(scope="module")
def visited(request: pytest.FixtureRequest) -> Visits:
    """Two visits of an actual robot, with learning at the first only."""
    agent = make_agent(SEED, cache=request.config.cache.mkdir("maps"))
    start, *postures = shuffled_postures(SEED)[:3]
    env = make_env("Posture", SEED, max_episode_steps=NO_END)
    session = Session(env, agent, SEED, options={"posture": start, "target": start})
    visits = no_visits()
    before = agent.map
    visit(session, postures[0], visits)
    assert agent.map is not before
    agent.learning, learned = False, agent.map
    visit(session, postures[1], visits)
    assert agent.map is learned
    session.env.close()
    return visits


def test_the_error_of_a_visit_is_the_one_before_learning(visited: Visits) -> None:
    """The map learned at the first posture fits its observation; the visit has the error before."""
    found = rmse_deg(visited, "estimate_seen")
    assert found[0] > 2.0
    assert len(found) == 2
    assert visited["time"][1] > visited["time"][0] > 2.0
    np.testing.assert_allclose(visited["target"], shuffled_postures(SEED)[1:3], atol=1e-6)


def test_truth_and_estimate_differ_on_an_actual_robot(visited: Visits) -> None:
    assert (rmse_deg(visited, "estimate_true") > 3.0).all()
    assert (rmse_deg(visited, "target_true") > 3.0).all()
