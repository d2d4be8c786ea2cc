"""The trial on the drawing: it grasps, it does not without fingers, and it skips what it must."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from jmm_agent.grasping import GraspOptions, GraspPlanner
from kengoro import grasp_trial
from kengoro.arm import make_agent, make_env
from kengoro.grasp_trial import GraspTrial
from kengoro.hand_search import READY, TrialOptions
from kengoro.session import OPEN, Session
from kengoro.trained_maps import trained_map
from kengoro_env.names import GROUP_JOINTS
from kengoro_env.postures import posture_set


@pytest.fixture
def session(request: pytest.FixtureRequest) -> Iterator[Session]:
    agent = make_agent(trained_map(request.config.cache.mkdir("maps")), 0, learning=False)
    env = make_env("CanGrasp", None)
    yield Session(env, agent, 0, None, {"posture": np.array(READY)})
    env.close()


def trial_of(session: Session, options: GraspOptions | None = None) -> GraspTrial:
    planner = GraspPlanner(session.agent.kinematics, "eye", GROUP_JOINTS["neck"], options)
    rng = np.random.default_rng(0)
    return GraspTrial(session, planner, posture_set(), rng, TrialOptions(approaches=1))


def test_the_drawing_lifts_the_can_and_a_person_puts_it_back(session: Session) -> None:
    stood = session.truth["can_pose"][:3, 3].copy()
    trial = trial_of(session).run()
    (approach,) = trial.approaches
    assert approach.grasped
    assert approach.distance < 0.060  # what gravity may make of stiff gains, learning off
    session.step()
    np.testing.assert_allclose(session.truth["can_pose"][:3, 3], stood, atol=2e-3)
    assert not session.truth["success"]


def test_fingers_that_stay_open_lift_nothing(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grasp_trial, "CLOSED", OPEN)
    (approach,) = trial_of(session).run().approaches
    assert not approach.grasped


def test_a_can_out_of_reach_is_reported_and_left_alone(session: Session) -> None:
    """The grip point is planned two metres above the can's marker."""
    trial = trial_of(session, GraspOptions(grip_depth=-2.0)).run()
    assert trial.approaches == []
    (note,) = trial.notes
    assert "out of reach by" in note
