"""A can-grasping trial on the nominal model: a grasp, open fingers, and a can out of reach."""

from __future__ import annotations

from collections.abc import Iterator

import gymnasium as gym
import numpy as np
import pytest

from jmm_agent import FeedbackOptions
from jmm_agent.grasping import GraspOptions, GraspPlanner
from kengoro import grasp_trial
from kengoro.agents import make_agent
from kengoro.grasp_trial import GraspTrial, outcome_sentences
from kengoro.hand_search import READY, TrialOptions
from kengoro.robots import make_env
from kengoro.session import OPEN, Session
from kengoro_env.departures import DryFriction
from kengoro_env.names import GROUP_JOINTS
from kengoro_env.postures import posture_set


@pytest.fixture
def session(request: pytest.FixtureRequest) -> Iterator[Session]:
    agent = make_agent(cache=request.config.cache.mkdir("maps"), learning=False)
    env = make_env("CanGrasp", None)
    yield Session(env, agent, 0, None, {"posture": np.array(READY)})
    env.close()


def trial_of(session: Session, options: GraspOptions | None = None) -> GraspTrial:
    planner = GraspPlanner(session.agent.kinematics, "eye", GROUP_JOINTS["neck"], options)
    rng = np.random.default_rng(0)
    return GraspTrial(session, planner, posture_set(), rng, TrialOptions(approaches=1))


def test_the_nominal_model_lifts_the_can_which_is_then_put_back(session: Session) -> None:
    start = session.truth["can_pose"][:3, 3].copy()
    trial = trial_of(session).run()
    (approach,) = trial.approaches
    assert approach.grasped
    assert approach.distance < 0.060  # [m]: sag under gravity, learning off
    session.step()
    np.testing.assert_allclose(session.truth["can_pose"][:3, 3], start, atol=2e-3)
    assert not session.truth["success"]


@pytest.fixture
def rubbing(request: pytest.FixtureRequest) -> Iterator[Session]:
    """The drawing's robot with 8 N of dry friction in each muscle, and a map that is right."""
    agent = make_agent(cache=request.config.cache.mkdir("maps"), learning=False)
    env = gym.make("Kengoro/CanGrasp-v0", departures=[DryFriction(8.0, 0.0)])
    yield Session(env, agent, 0, None, {"posture": np.array(READY)})
    env.close()


def test_fingers_close_when_the_hand_has_arrived_although_muscles_rub(rubbing: Session) -> None:
    trial = trial_of(rubbing)
    (early,) = trial.run().approaches  # the first one, before anything is learned
    trial.approach(3.0)
    arrived = trial.trial.approaches[-1]
    assert early.distance > 0.010
    assert arrived.distance < 0.006
    assert rubbing.agent.feedback is None  # as before


def test_feedback_of_its_own_is_kept(session: Session) -> None:
    session.agent.feedback = own = FeedbackOptions(gain=0.5)
    trial_of(session).approach(1.0)
    assert session.agent.feedback is own


def test_open_fingers_do_not_lift_the_can(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grasp_trial, "CLOSED", OPEN)
    (approach,) = trial_of(session).run().approaches
    assert not approach.grasped


def test_a_can_out_of_reach_is_reported_and_not_approached(session: Session) -> None:
    """The grip point is planned two metres above the can's marker."""
    trial = trial_of(session, GraspOptions(grip_depth=-2.0)).run()
    assert trial.approaches == []
    (note,) = trial.notes
    assert "out of reach by" in note


def test_a_result_is_three_sentences() -> None:
    assert outcome_sentences([0.1964, 0.0241], [False, True], 27, 93.2) == [
        "In its first approach the robot missed the can: its hand was 196 mm off.",
        "It then learned from 27 observations of its hand in 93 s.",
        "In approach 2 it grasped and lifted the can, with its hand 24 mm off.",
    ]


def test_a_trial_without_an_approach_is_one_sentence() -> None:
    assert outcome_sentences([], [], 0, 0.0) == ["The robot made no approach to the can."]
