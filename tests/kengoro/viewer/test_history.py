"""The history of a session: marks of the hand, and curves of the estimation error."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jmm_agent.agent import AgentOptions
from jmm_agent.kinematics.arm_kinematics import ArmKinematics
from jmm_agent.vision.hand_finder import HandSeen
from kengoro.viewer.history import MAX_POINTS, SessionHistory
from kengoro.visits import grip
from kengoro_env.assets import asset_path
from kengoro_env.names import JOINTS
from kengoro_env.postures import posture_set

POSTURE = posture_set()[0]


def session_at(time: float, estimate: np.ndarray, true: np.ndarray, **more: Any) -> Any:
    """Stub of a session with the attributes that a history reads."""
    agent = SimpleNamespace(
        options=AgentOptions(), seen=None, hand=None, joint_angles=estimate, learning=True
    )
    vars(agent).update(more)
    robot = SimpleNamespace(tensions=np.zeros(36))
    return SimpleNamespace(
        time=time,
        stage="",
        agent=agent,
        truth={"joint_angles": true},
        world=SimpleNamespace(robot=robot),
    )


def test_curves_are_errors_of_the_estimate_against_true_and_seen_angles() -> None:
    history, estimate = SessionHistory(), POSTURE + np.radians(2.0)
    observed = SimpleNamespace(angles=POSTURE, error=np.radians(np.full(len(POSTURE), 3.0)))
    for step in range(1, 11):
        seen = {"seen": observed} if step >= 4 else {}
        history.record(session_at(0.02 * step, estimate, POSTURE, **seen))
    curves = history.curves()
    np.testing.assert_allclose(curves.time, [0.02, 0.12])  # one in 0.1 s
    np.testing.assert_allclose(curves.true_deg, 2.0)
    np.testing.assert_allclose(curves.true_mm, 1e3 * np.linalg.norm(grip(estimate) - grip(POSTURE)))
    np.testing.assert_allclose(curves.observation_time, [0.08])  # each observation once
    np.testing.assert_allclose(curves.seen_deg, [3.0])
    estimated_then = grip(POSTURE + observed.error)
    np.testing.assert_allclose(
        curves.seen_mm, [1e3 * np.linalg.norm(estimated_then - grip(POSTURE))]
    )


def test_long_curves_are_thinned() -> None:
    history = SessionHistory()
    for step in range(3 * MAX_POINTS):
        history.record(session_at(0.2 * step, POSTURE, POSTURE))
    assert MAX_POINTS / 2 <= len(history.curves().time) <= MAX_POINTS


def test_the_seen_marker_is_computed_with_the_camera_at_the_estimated_joint_angles() -> None:
    """A marker seen at its estimated pose has both marks at the same point."""
    history = SessionHistory()
    kinematics = ArmKinematics(asset_path("mjcf/kengoro_arm/arm.xml"), JOINTS)
    expected = kinematics.pose("marker_hand", POSTURE, relative_to="eye")
    shifted = expected.copy()
    shifted[:3, 3] += [0.0, 0.0, 0.1]
    for pose, distance in ((expected, 0.0), (shifted, 0.1)):
        observed = SimpleNamespace(angles=POSTURE, error=np.zeros(len(POSTURE)))
        hand = HandSeen(pose)
        session = session_at(1.0, POSTURE, POSTURE, seen=observed, hand=hand)
        history.record(session)
        marks = history.moment(session).marks
        assert marks.seen is not None
        assert marks.estimated_then is not None
        np.testing.assert_allclose(marks.estimated, kinematics.pose("marker_hand", POSTURE)[:3, 3])
        found = np.linalg.norm(marks.seen - marks.estimated_then)
        assert found == pytest.approx(distance, abs=1e-9)


def test_a_moment_has_the_stage_of_the_session_or_whether_the_agent_learns() -> None:
    history = SessionHistory()
    session = session_at(1.0, POSTURE, POSTURE)
    assert history.moment(session).stage == "learns"
    session.agent.learning = False
    assert "learning is off" in history.moment(session).stage
    session.stage = "approach 2"
    assert history.moment(session).stage == "approach 2"
    assert history.moment(session).marks.seen is None
    assert history.moment(session).observation_time is None
