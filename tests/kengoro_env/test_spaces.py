"""Actions map affinely to lengths and back; the bounds contain the nominal lengths."""

from __future__ import annotations

import json

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kengoro_env.assets import asset_path
from kengoro_env.env import TASKS, KengoroEnv
from kengoro_env.errors import InvalidActionError, KengoroError
from kengoro_env.postures import posture_set
from kengoro_env.robot.nominal_model import NominalArm
from kengoro_env.spaces import (
    MARGIN,
    SCENES,
    LengthBounds,
    computed_bounds,
    length_bounds,
)

ARM = asset_path("mjcf/kengoro_arm/arm.xml")
BOUNDS = LengthBounds(np.array([-0.1, 0.0]), np.array([0.1, 0.4]))


def test_the_map_is_affine() -> None:
    assert np.allclose(BOUNDS.to_lengths(np.array([-1.0, -1.0])), [-0.1, 0.0])
    assert np.allclose(BOUNDS.to_lengths(np.array([1.0, 1.0])), [0.1, 0.4])
    assert np.allclose(BOUNDS.to_lengths(np.array([0.0, 0.5])), [0.0, 0.3])
    assert np.allclose(BOUNDS.to_action(np.array([0.05, 0.1])), [0.5, -0.5])


@given(st.lists(st.floats(-0.1, 0.1), min_size=2, max_size=2))
def test_back_and_forth_within_a_micrometre(values: list[float]) -> None:
    lengths = np.array(values) + np.array([0.0, 0.2])
    action = BOUNDS.to_action(lengths)
    assert action.dtype == np.float32
    assert np.allclose(BOUNDS.to_lengths(action), lengths, rtol=0.0, atol=1e-7)


def test_lengths_out_of_bounds_are_cut() -> None:
    assert np.array_equal(BOUNDS.to_action(np.array([-1.0, 1.0])), [-1.0, 1.0])


@pytest.mark.parametrize("scene", SCENES)
def test_shipped_bounds_are_those_of_the_model(scene: str) -> None:
    """A failure means: run `python -m kengoro_env.spaces` after a change of the arm."""
    shipped, computed = length_bounds(scene), computed_bounds(NominalArm(asset_path(scene)))
    assert np.allclose(shipped.low, computed.low, rtol=0.0, atol=1e-9)
    assert np.allclose(shipped.high, computed.high, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("task", TASKS)
def test_each_task_has_shipped_bounds_in_the_order_of_its_muscles(task: str) -> None:
    env = KengoroEnv(task, camera=False)
    shipped = json.loads(asset_path("bounds.json").read_text(encoding="utf-8"))
    assert tuple(shipped[env.task.scene]) == env.muscles


def test_bounds_contain_the_lengths_of_the_nominal_model_with_a_margin() -> None:
    nominal, bounds = NominalArm(ARM), length_bounds(SCENES[0])
    rng = np.random.default_rng(99)
    postures = rng.uniform(nominal.lower, nominal.upper, (1000, len(nominal.joints)))
    lengths = nominal.lengths(np.vstack([postures, posture_set()]))
    assert np.all(lengths > bounds.low + 0.9 * MARGIN)
    assert np.all(lengths < bounds.high - 0.9 * MARGIN)


def test_bounds_are_not_wider_than_the_lengths_need() -> None:
    nominal, bounds = NominalArm(ARM), length_bounds(SCENES[0])
    rng = np.random.default_rng(98)
    share = rng.random((2000, len(nominal.joints)))
    share[1000:] = np.round(share[1000:])
    lengths = nominal.lengths(nominal.lower + share * (nominal.upper - nominal.lower))
    assert np.all(lengths.min(axis=0) < bounds.low + MARGIN + 0.02)
    assert np.all(lengths.max(axis=0) > bounds.high - MARGIN - 0.02)


def test_an_environments_actions_command_their_lengths() -> None:
    env = gym.make("Kengoro/CanGrasp-v0", camera=False).unwrapped
    assert isinstance(env, KengoroEnv)
    env.reset(seed=0)
    lengths = NominalArm(ARM).lengths(posture_set()[3])[0]
    action = env.lengths_to_action(lengths, fingers=0.25)
    assert env.action_space.contains(action)
    assert np.allclose(env.action_to_lengths(action), lengths, rtol=0.0, atol=1e-7)
    env.step(action)
    assert np.allclose(env.robot.target, lengths, rtol=0.0, atol=1e-7)


def test_bad_lengths_are_named() -> None:
    env = gym.make("Kengoro/Elbow-v0").unwrapped
    assert isinstance(env, KengoroEnv)
    for bad in ([0.0], [0.0, np.nan, 0.0], "long"):
        with pytest.raises(KengoroError, match="lengths must be 3 finite numbers"):
            env.lengths_to_action(bad)
    with pytest.raises(InvalidActionError, match="entry 1"):
        env.action_to_lengths([0.0, 2.0, 0.0])
