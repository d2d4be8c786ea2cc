"""Sessions: the agent gets sensor readings only, and the same seed gives the same bits."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from jmm_agent.agent import Agent
from jmm_agent.grasping import GraspPlanner
from jmm_agent.mapping.joint_muscle_map import JointMuscleMap
from kengoro.agents import make_agent
from kengoro.grasp_trial import GraspTrial
from kengoro.hand_search import READY
from kengoro.robots import make_env
from kengoro.session import CLOSED, EpisodeEndedError, Session
from kengoro.trained_maps import trained_map
from kengoro_env.names import GROUP_JOINTS
from kengoro_env.postures import posture_set

SEED = 1


@pytest.fixture(scope="module")
def nominal_map(request: pytest.FixtureRequest) -> JointMuscleMap:
    return trained_map(request.config.cache.mkdir("maps"))


class ActionRecorder(gym.Wrapper[Any, Any, Any, Any]):
    """Records the actions."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self.actions: list[np.ndarray] = []

    def step(self, action: Any) -> Any:
        self.actions.append(np.array(action))
        return super().step(action)


class InfoFalsifier(ActionRecorder):
    """Falsifies every entry of ``info``."""

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self.count = 0

    def _falsified(self, info: dict[str, Any]) -> dict[str, Any]:
        rng = np.random.default_rng(self.count)
        self.count += 1
        return {name: self._falsified_value(value, rng) for name, value in info.items()}

    def _falsified_value(self, value: Any, rng: np.random.Generator) -> Any:
        if isinstance(value, bool | np.bool_):
            return not value
        if isinstance(value, str):
            return "nonsense"
        return np.asarray(value, dtype=float) + rng.normal(0.0, 1.0, np.shape(value))

    def reset(self, **arguments: Any) -> Any:
        observation, info = super().reset(**arguments)
        return observation, self._falsified(info)

    def step(self, action: Any) -> Any:
        *rest, info = super().step(action)
        return (*rest, self._falsified(info))


def short_session(env: ActionRecorder, agent: Agent) -> Session:
    """Session with two postures in view of the camera and a reach; learning is on."""
    session = Session(env, agent, SEED, None, {"posture": np.array(READY)})
    planner = GraspPlanner(agent.kinematics, "eye", GROUP_JOINTS["neck"])
    for posture in posture_set()[[206, 162]]:
        session.move(posture, 1.2, 3.0)
    trial = GraspTrial(session, planner, posture_set(), np.random.default_rng(0))
    pose = np.eye(4)
    pose[:3, 3] = session.agent.kinematics.pose("grip", agent.target)[:3, 3]
    trial.grasp(planner.plan(pose, agent.target), arrival=0.5)
    return session


def env_and_agent(
    wrapper: type[ActionRecorder], nominal_map: JointMuscleMap, seed: int = SEED
) -> tuple[Any, Agent]:
    return wrapper(make_env("CanGrasp", SEED)), make_agent(seed, jmm=nominal_map)


@pytest.fixture(scope="module")
def true_run(nominal_map: JointMuscleMap) -> tuple[ActionRecorder, Agent, Session]:
    """A short session with the truth in ``info``."""
    env, agent = env_and_agent(ActionRecorder, nominal_map)
    session = short_session(env, agent)
    env.close()
    return env, agent, session


def same_bits(one: ActionRecorder, other: ActionRecorder) -> bool:
    return np.array(one.actions).tobytes() == np.array(other.actions).tobytes()


def test_falsified_info_changes_no_bit_of_the_actions(
    true_run: tuple[ActionRecorder, Agent, Session], nominal_map: JointMuscleMap
) -> None:
    true_env, true_agent, true_session = true_run
    assert true_agent.vision.fired >= 1
    assert true_agent.antagonism.fired >= 1
    env, agent = env_and_agent(InfoFalsifier, nominal_map)
    session = short_session(env, agent)
    env.close()
    assert env.count > 300
    false, true = np.array(session.log.true), np.array(true_session.log.true)
    assert np.abs(false - true).min(axis=1).max() > 0.01
    assert same_bits(env, true_env)
    for one, two in zip(agent.map.groups, true_agent.map.groups, strict=True):
        np.testing.assert_array_equal(one.W2, two.W2)
    np.testing.assert_array_equal(session.log.observation_error, true_session.log.observation_error)


def test_an_agent_with_another_seed_acts_differently(
    true_run: tuple[ActionRecorder, Agent, Session], nominal_map: JointMuscleMap
) -> None:
    """The comparison of actions finds a difference: other rehearsal pairs change the commands."""
    env, agent = env_and_agent(ActionRecorder, nominal_map, seed=SEED + 1)
    short_session(env, agent)
    env.close()
    assert not same_bits(env, true_run[0])


def test_the_log_holds_every_step_and_marker_observation(
    true_run: tuple[ActionRecorder, Agent, Session],
) -> None:
    env, agent, session = true_run
    log, steps = session.log, len(env.actions)
    np.testing.assert_allclose(log.time, 0.02 * np.arange(1, steps + 1))
    for name, size in (("tensions", 36), ("target", 14), ("true", 14), ("estimate", 14)):
        assert np.array(getattr(log, name)).shape == (steps, size)
    np.testing.assert_array_equal(log.true[-1], session.truth["joint_angles"])
    assert agent.vision.fired <= len(log.observation_time) == len(log.observation_error)
    predicted = [one for one in log.observation_predicted if one is not None]
    assert len(log.observation_predicted) == len(log.observation_time)
    assert predicted == [observation.predicted for observation in agent.predictions.newest]
    assert len(predicted) == agent.predictions.count >= 1
    assert all(one.position_std > 0.003 for one in predicted)
    assert np.all(np.diff(log.observation_time) > 0)


def test_the_agent_knows_whether_the_fingers_are_closed(nominal_map: JointMuscleMap) -> None:
    env, agent = env_and_agent(ActionRecorder, nominal_map)
    session = Session(env, agent, SEED, None, {"posture": np.array(READY)})
    session.wait(0.04)
    assert agent.hand_is_free
    session.fingers = CLOSED
    session.wait(0.04)
    assert not agent.hand_is_free
    assert [action[-1] for action in env.actions] == [-1.0, -1.0, 1.0, 1.0]
    env.close()


def test_a_movement_ends_at_rest_or_when_patience_ends(nominal_map: JointMuscleMap) -> None:
    env = make_env("Posture", None, camera=False, max_episode_steps=100_000)
    agent = make_agent(SEED, jmm=nominal_map, learning=False)
    start, target = posture_set()[:2]
    session = Session(env, agent, SEED, None, {"posture": start, "target": target})
    session.move(target, 1.0, 0.04)
    assert session.time == pytest.approx(1.04)
    np.testing.assert_array_equal(agent.target, target)
    error = np.degrees(np.abs(session.truth["joint_angles"] - target)).max()
    assert error < np.degrees(np.abs(start - target)).max() / 2
    env.close()


def test_a_new_session_does_not_log_the_last_observation_of_the_previous_one(
    true_run: tuple[ActionRecorder, Agent, Session],
) -> None:
    agent = true_run[1]
    assert agent.seen is not None
    env = make_env("Posture", SEED, camera=False)
    session = Session(env, agent, SEED, None, {"posture": posture_set()[0]})
    session.wait(0.1)
    assert session.log.observation_time == []
    env.close()


def test_the_end_of_an_episode_raises_an_error_with_the_reason(nominal_map: JointMuscleMap) -> None:
    env = make_env("Posture", None, camera=False, max_episode_steps=5)
    session = Session(env, make_agent(SEED, jmm=nominal_map), SEED)
    with pytest.raises(EpisodeEndedError, match="time is up"):
        session.wait(1.0)
    assert len(session.log.time) == 5
    env.close()
