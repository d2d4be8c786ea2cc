"""Tasks: success, reward and end of an episode."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from kengoro_env.errors import EpisodeError, KengoroError
from kengoro_env.tasks.can_grasp import FALLEN_TIME, REACH_SCALE, START_DISTANCE
from tests.kengoro_env.environments import make


def test_success_and_reward_follow_the_target() -> None:
    env = make("Kengoro/Elbow-v0")
    rewards = {}
    for start in (0.3, 0.8, 1.3):
        observation, _ = env.reset(seed=0, options={"posture": [start], "target": [1.3]})
        hold = env.lengths_to_action(observation["lengths"])
        env.set_stiffness(50_000.0, 30.0)
        for _ in range(50):
            _, rewards[start], _, _, info = env.step(hold)
        assert bool(info["success"]) is (start == 1.3)
    assert rewards[0.3] < rewards[0.8] < rewards[1.3]


def test_targets_change_unless_given() -> None:
    env = make("Kengoro/Elbow-v0")
    for options, changes in ({}, 2), ({"target": [1.0]}, 0):
        observation, _ = env.reset(seed=0, options=options)
        targets = [observation["target"][0]]
        for _ in range(450):
            observation, *_ = env.step(np.zeros(3))
            targets.append(observation["target"][0])
        assert np.count_nonzero(np.diff(targets)) == changes
    assert set(targets) == {1.0}


def test_fingers_close() -> None:
    env = make("Kengoro/CanGrasp-v0", camera=False)
    observation, _ = env.reset(seed=0)
    angle = {}
    for command in (-1.0, 1.0):
        action = env.lengths_to_action(observation["lengths"], fingers=command)
        assert action[-1] == command
        for _ in range(50):
            env.step(action)
        angle[command] = float(env.robot.data.joint("finger_proximal").qpos[0])
    assert angle[1.0] - angle[-1.0] > np.radians(30)


def test_the_can_stands_at_the_position_of_the_option() -> None:
    env = make("Kengoro/CanGrasp-v0", camera=False)
    observation, info = env.reset(seed=0, options={"can": (0.5, -0.2)})
    assert np.allclose(info["can_pose"][:2, 3], (0.5, -0.2))
    for _ in range(25):
        *_, info = env.step(env.lengths_to_action(observation["lengths"]))
    assert np.allclose(info["can_pose"][:2, 3], (0.5, -0.2), atol=1e-3)
    assert abs(info["rise"]) < 1e-3
    with pytest.raises(KengoroError, match="there is no can to put back"):
        make("Kengoro/Elbow-v0").put_can_back()
    with pytest.raises(KengoroError, match=r"the can cannot stand at \(1, 0\) m: the table rea"):
        env.reset(options={"can": (1.0, 0.0)})


def test_before_a_reset_there_is_no_can_to_put_back() -> None:
    with pytest.raises(EpisodeError, match=r"no can to put back \(none has begun\): call reset"):
        make("Kengoro/CanGrasp-v0", camera=False).put_can_back()


def test_a_can_off_the_table_ends_the_episode() -> None:
    env = make("Kengoro/CanGrasp-v0", camera=False)
    observation, _ = env.reset(seed=0)
    env.robot.data.joint("can").qpos[:2] = (1.2, 0.5)
    action, terminated, steps = env.lengths_to_action(observation["lengths"]), False, 0
    while not terminated and steps < 600:
        *_, terminated, _, info = env.step(action)
        steps += 1
    assert terminated
    assert steps * 0.02 > FALLEN_TIME  # until then it may be put back
    assert info["reason"] == "the can fell off the table"
    assert not info["success"]


def test_a_can_that_is_put_back_in_time_ends_nothing() -> None:
    env = make("Kengoro/CanGrasp-v0", camera=False)
    observation, start = env.reset(seed=0)
    action = env.lengths_to_action(observation["lengths"])
    env.robot.data.joint("can").qpos[:2] = (1.2, 0.5)
    for step in range(600):
        *_, terminated, _, info = env.step(action)
        assert not terminated
        if step == 100:
            assert info["rise"] < -0.5
            env.put_can_back()
    assert np.allclose(info["can_pose"], start["can_pose"], atol=2e-3)


def test_the_arm_starts_away_from_the_can_and_its_reward_is_how_close_it_is() -> None:
    env = make("Kengoro/CanGrasp-v0", camera=False)
    for seed in range(60):
        _, info = env.reset(seed=seed)
        assert np.linalg.norm((info["can_pose"] - info["hand_pose"])[:3, 3]) > START_DISTANCE
    observation, _ = env.reset(seed=0)
    _, reward, _, _, info = env.step(env.lengths_to_action(observation["lengths"]))
    distance = np.linalg.norm((info["can_pose"] - info["hand_pose"])[:3, 3])
    assert not info["grasped"]
    assert reward == pytest.approx(np.exp(-distance / REACH_SCALE) / 3.0)


def test_lifting_is_rewarded() -> None:
    env = make("Kengoro/CanGrasp-v0", camera=False)
    observation, _ = env.reset(seed=0)
    action = env.lengths_to_action(observation["lengths"])
    rewards = []
    for near in (False, True):
        if near:
            grip = env.robot.data.site("grip").xpos
            env.robot.data.joint("can").qpos[:3] = grip - [0.0, 0.0, 0.05]
            env.robot.data.joint("can").qvel[:] = 0.0
            mujoco.mj_forward(env.robot.model, env.robot.data)
        rewards.append(env.step(action)[1])
    assert 0.0 <= rewards[0] < rewards[1] <= 1.0
