"""Observations for a network: flat, of about unit size, by scales that never change."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import FilterObservation, FlattenObservation, TimeLimit

from kengoro_env import ScaledObservation, ScaledVectorObservation
from kengoro_env.departures import HeatingMotors
from kengoro_env.errors import ArgumentError
from kengoro_env.spaces import MARGIN
from tests.kengoro_env.environments import make

ELBOW, POSTURE = "Kengoro/Elbow-v0", "Kengoro/Posture-v0"
ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("env_id", [ELBOW, POSTURE])
def test_numbers_are_of_about_unit_size(env_id: str) -> None:
    """In motions as random as those of a policy that begins to learn."""
    env = ScaledObservation(gym.make(env_id, robot_seed=1))
    assert isinstance(env.observation_space, gym.spaces.Box)
    assert env.observation_space.dtype == np.float32
    env.action_space.seed(0)
    rows = []
    for seed in range(4):
        observation, _ = env.reset(seed=seed)
        assert env.observation_space.contains(observation)
        command = 0.0
        for _ in range(40):
            command = 0.8 * command + 0.2 * env.action_space.sample()
            observation, *_ = env.step(np.asarray(command, dtype=np.float32))
            assert env.observation_space.contains(observation)
            rows.append(observation)
    sizes = np.sqrt(np.mean(np.square(rows), axis=0))
    assert sizes.max() < 4.0
    assert 0.3 < np.median(sizes) < 2.0
    raw = make(env_id, robot_seed=1).reset(seed=0)[0]
    assert np.abs(raw["lengths"]).max() < 0.2 < 10.0 < raw["tensions"].max()


def test_scales_are_those_of_the_table() -> None:
    env = ScaledObservation(gym.make(ELBOW))
    observation, _ = env.reset(seed=0, options={"posture": [0.5], "target": [1.5]})
    raw, _ = make(ELBOW).reset(seed=0, options={"posture": [0.5], "target": [1.5]})
    world: Any = env.unwrapped
    low, high = world.bounds.low + MARGIN, world.bounds.high - MARGIN
    joint = world.robot.upper[0]
    expected = [
        *(2 * (raw["lengths"] - low) / (high - low) - 1),
        *(2 * raw["target"] / joint - 1),
        *(raw["tensions"] / 100 - 1),
    ]
    assert observation == pytest.approx(np.array(expected), abs=1e-6)


def test_lengths_and_targets_of_the_nominal_model_span_one() -> None:
    env = ScaledObservation(gym.make(ELBOW))
    world: Any = env.unwrapped
    found = []
    for angle in np.linspace(world.robot.lower[0], world.robot.upper[0], 9):
        observation, _ = env.reset(seed=0, options={"posture": [angle], "target": [angle]})
        found.append(observation[:4])
    assert np.abs(found).max() <= 1.0 + 0.05
    assert np.ptp(found, axis=0) == pytest.approx(np.full(4, 2.0), abs=0.25)


def test_temperatures_have_a_scale() -> None:
    heating = (HeatingMotors(heat=4e-4, seed=1),)
    env = ScaledObservation(gym.make(ELBOW, departures=heating))
    observation, _ = env.reset(seed=0)
    temperatures = make(ELBOW, departures=heating).reset(seed=0)[0]["temperatures"]
    assert observation[4:7] == pytest.approx((temperatures - 50) / 25, abs=1e-6)


def test_an_entry_may_be_left_out_and_a_frame_must_be() -> None:
    env = ScaledObservation(FilterObservation(gym.make(POSTURE), ["target"]))
    assert env.reset(seed=0)[0].shape == (14,)
    with pytest.raises(ArgumentError, match=r"'frame' has no scale: leave it out.*camera=False"):
        ScaledObservation(gym.make("Kengoro/CanGrasp-v0"))
    with pytest.raises(ArgumentError, match="must be a dict of Kengoro's arm"):
        ScaledObservation(gym.make("CartPole-v1"))  # type: ignore[arg-type]


def test_what_is_flat_already_is_refused_in_one_short_sentence() -> None:
    sentence = (
        "the observations must be a dict of Kengoro's arm, not a Box: scale them before any "
        "wrapper that flattens them"
    )
    with pytest.raises(ArgumentError) as single:
        ScaledObservation(FlattenObservation(gym.make(POSTURE)))  # type: ignore[arg-type]
    scaled: Any = ScaledVectorObservation(gym.make_vec(POSTURE, 2))
    with pytest.raises(ArgumentError) as many:
        ScaledVectorObservation(scaled)
    assert str(single.value) == str(many.value) == sentence


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("more", [{}, {"dtype": np.float32}], ids=["double", "single"])
def test_many_are_scaled_as_single_ones(mode: AutoresetMode, more: dict[str, Any]) -> None:
    many = ScaledVectorObservation(
        gym.make_vec(ELBOW, 2, robot_seed=1, max_episode_steps=2, autoreset_mode=mode, **more)
    )
    ones = [ScaledObservation(TimeLimit(make(ELBOW, robot_seed=1, **more), 2)) for _ in range(2)]
    found, _ = many.reset(seed=3)
    expected = [env.reset(seed=3 + i)[0] for i, env in enumerate(ones)]
    assert many.observation_space == gym.vector.utils.batch_space(ones[0].observation_space, 2)
    assert np.array_equal(found, expected)
    actions = np.array([[0.1, 0.2, -0.3], [0.5, -0.5, 0.0]], dtype=np.float32)
    for _ in range(2):
        found, *_, infos = many.step(actions)
        expected = [env.step(action)[0] for env, action in zip(ones, actions, strict=True)]
        assert many.observation_space.contains(found)
        if mode is AutoresetMode.SAME_STEP and "final_obs" in infos:
            found = np.stack(infos["final_obs"])
        assert np.array_equal(found, expected)
    assert ("final_obs" in infos) == (mode is AutoresetMode.SAME_STEP)


def test_a_copy_continues_and_the_wrapper_is_in_the_specification() -> None:
    env = ScaledObservation(gym.make(ELBOW))
    env.reset(seed=0)
    twin = cloudpickle.loads(cloudpickle.dumps(env))
    action = np.full(3, 0.2, dtype=np.float32)
    assert np.array_equal(env.step(action)[0], twin.step(action)[0])
    assert env.spec is not None
    again = gym.make(env.spec)
    assert np.array_equal(again.reset(seed=0)[0], env.reset(seed=0)[0])


OLD_GYMNASIUM = """
from gymnasium import vector
class VectorWrapper(vector.VectorWrapper):
    def __class_getitem__(cls, types):
        raise TypeError(f"{cls} is not a generic class")
vector.VectorWrapper = VectorWrapper
import gymnasium, kengoro_env
envs = gymnasium.make_vec("Kengoro/Elbow-v0", 2)
print(kengoro_env.ScaledVectorObservation(envs).reset(seed=0)[0].shape)
"""


def test_a_gymnasium_with_wrappers_that_are_not_generic_is_enough() -> None:
    """As 1.2.2, which RLlib pins."""
    command = [sys.executable, "-c", OLD_GYMNASIUM]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert ended.stdout.strip() == "(2, 7)", ended.stderr


@pytest.mark.parametrize("mode", AutoresetMode)
def test_learning_libraries_find_the_mode_of_autoreset(mode: AutoresetMode) -> None:
    """TorchRL reads the attribute, as `gymnasium.vector.SyncVectorEnv` has it."""
    many: Any = gym.make_vec(ELBOW, 2, autoreset_mode=mode)
    assert many.autoreset_mode is many.metadata["autoreset_mode"] is mode
    assert ScaledVectorObservation(many).autoreset_mode is mode
    assert ScaledVectorObservation(gym.make_vec(ELBOW, 2)).autoreset_mode is AutoresetMode.NEXT_STEP
