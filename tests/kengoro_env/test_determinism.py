"""The same seed gives the same bits: in two runs, after other episodes, in a copy, pickled."""

from __future__ import annotations

import copy
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kengoro_env.departures import Elongation, actual
from kengoro_env.env import KengoroEnv
from tests.kengoro_env.environments import make

ROOT = Path(__file__).resolve().parents[2]
PICKLE = import_module("pickle")  # what multiprocessing does; the project itself writes none
IDS = ("Kengoro/CanGrasp-v0", "Kengoro/Posture-v0", "Kengoro/Elbow-v0")
MUSCLE = {"Kengoro/Elbow-v0": "biceps"}


def roll(env: KengoroEnv, steps: int, seed: int) -> list[np.ndarray]:
    """All numbers returned for ``steps`` random actions."""
    env.action_space.seed(seed)
    numbers: list[np.ndarray] = []
    for _ in range(steps):
        observation, reward, _, _, info = env.step(env.action_space.sample())
        numbers += [*observation.values(), np.array(reward)]
        numbers += [np.asarray(info[name]) for name in sorted(info)]
    return numbers


def same(first: list[np.ndarray], second: list[np.ndarray]) -> bool:
    return len(first) == len(second) and all(map(np.array_equal, first, second))


def departed(env_id: str) -> tuple[Any, ...]:
    """Every kind of departure, and an elongation in the middle of the episode."""
    return (*actual(3), Elongation(MUSCLE.get(env_id, "delt_mid"), 0.01, time=0.1))


@pytest.mark.parametrize("env_id", IDS)
def test_same_seed_same_bits_other_seed_others(env_id: str) -> None:
    runs = []
    for seed in (5, 5, 6):
        env = make(env_id, departures=departed(env_id), camera=None)
        first, _ = env.reset(seed=seed)
        runs.append([*first.values(), *roll(env, 12, seed=0)])
        env.close()
    assert same(runs[0], runs[1])
    assert not same(runs[0], runs[2])


@pytest.mark.parametrize("env_id", IDS)
def test_a_dirty_reset_equals_a_fresh_one(env_id: str) -> None:
    dirty = make(env_id, departures=departed(env_id), camera=False)
    dirty.reset(seed=1)
    dirty.set_stiffness(3_000.0, 5.0)
    roll(dirty, 20, seed=1)
    dirty.robot.elongate(dirty.muscles[0], 0.02)
    fresh = make(env_id, departures=departed(env_id), camera=False)
    runs = []
    for env in (dirty, fresh):
        observation, _ = env.reset(seed=2)
        runs.append([*observation.values(), *roll(env, 20, seed=2)])
    assert same(*runs)


def test_episodes_of_one_seed_differ_and_repeat() -> None:
    env = make("Kengoro/Elbow-v0", robot_seed=1)
    starts = []
    for _ in range(2):
        env.reset(seed=9)
        _, info = env.reset()
        starts.append(info["joint_angles"][0])
    env.reset(seed=9)
    assert starts[0] == starts[1]
    assert env.robot.joint_angles[0] != starts[0]


def test_the_goal_does_not_depend_on_the_robot() -> None:
    targets = []
    for robot_seed in (None, 4):
        env = make("Kengoro/Posture-v0", robot_seed=robot_seed, camera=False)
        env.reset(seed=3)
        action = env.lengths_to_action(env.robot.target)
        for _ in range(201):
            observation, *_ = env.step(action)
        targets.append(observation["target"])
    assert np.array_equal(*targets)


@pytest.mark.parametrize(
    "duplicate",
    [copy.deepcopy, lambda env: PICKLE.loads(PICKLE.dumps(env))],
    ids=["deepcopy", "pickle"],
)
@pytest.mark.parametrize("env_id", IDS)
def test_a_copy_goes_on_with_the_same_bits(
    env_id: str, duplicate: Callable[[KengoroEnv], KengoroEnv]
) -> None:
    env = make(env_id, departures=departed(env_id), camera=None)
    env.reset(seed=4)
    roll(env, 4, seed=4)
    env.set_stiffness(15_000.0, 10.0)
    twin = duplicate(env)
    expected = roll(env, 12, seed=5)
    assert same(roll(twin, 12, seed=5), expected)
    env.close()
    twin.close()


def test_other_processes_give_the_same_bits() -> None:
    program = (
        "import gymnasium, kengoro_env, numpy, hashlib\n"
        "env = gymnasium.make('Kengoro/Posture-v0', robot_seed=2, camera=False).unwrapped\n"
        "env.reset(seed=0); env.action_space.seed(0)\n"
        "for _ in range(20): out = env.step(env.action_space.sample())\n"
        "print(out[0]['lengths'].tobytes().hex(), out[0]['tensions'].tobytes().hex())"
    )
    outputs = {
        subprocess.run(
            [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
        for _ in range(2)
    }
    assert len(outputs) == 1
