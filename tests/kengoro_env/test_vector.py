"""The vector environment has the bits of single environments."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from kengoro_env.departures.tendons import DryFriction, Elongation
from kengoro_env.errors import KengoroError
from kengoro_env.stepping import choice
from kengoro_env.stepping.compiled_steps import CompiledSteps
from kengoro_env.stepping.numpy_steps import NumpySteps
from kengoro_env.vector import KengoroVectorEnv
from tests.kengoro_env.environments import EveryOtherStretches

ELBOW, POSTURE = "Kengoro/Elbow-v0", "Kengoro/Posture-v0"
ELONGATES = {
    "departures": (
        Elongation("biceps", 0.004, time=0.03),
        Elongation("triceps", 0.003, time=0.07),
        DryFriction(5.0, 0.1),
    )
}


@pytest.fixture(params=[CompiledSteps, NumpySteps], autouse=True)
def kind(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Any:
    """By compiled code and by `mujoco.batch`; single environments are compiled where they can."""
    if request.param is NumpySteps:
        monkeypatch.setattr(choice, "library", lambda: None)
    elif choice.library() is None:
        pytest.skip("there is no compiled code here")
    return request.param


def same(one: Any, other: Any) -> bool:
    """Whether both hold the same bits."""
    if isinstance(one, dict):
        return set(one) == set(other) and all(same(one[k], other[k]) for k in one)
    return one.dtype == other.dtype and np.array_equal(one, other)


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize(
    ("task", "more"),
    [
        (ELBOW, {}),
        (ELBOW, {"robot_seed": 3}),
        (ELBOW, ELONGATES),
        (ELBOW, {"departures": (EveryOtherStretches(), Elongation("biceps", 0.004))}),
        (POSTURE, {}),
        (POSTURE, {"robot_seed": 1}),
    ],
)
def test_they_are_single_ones_bit_for_bit(
    task: str, more: dict[str, Any], threads: int, kind: type
) -> None:
    """Through truncations and resets, each in its own time."""
    count, steps = 4, 5
    many: Any = gym.make_vec(task, count, max_episode_steps=steps, threads=threads, **more)
    single = dict(more) if task == ELBOW else {**more, "camera": False}
    one_by_one = gym.make_vec(
        task, count, vectorization_mode="sync", max_episode_steps=steps, **single
    )
    rng = np.random.default_rng(0)
    assert isinstance(many, KengoroVectorEnv)
    assert type(many.fleet) is kind

    for seeds in (7, [4, 5, 5, 6]):
        found, expected = many.reset(seed=seeds), one_by_one.reset(seed=seeds)
        assert same(found[0], expected[0])
        assert same(found[1], expected[1])
        for k in range(2 * steps + 3):
            if k == 2:  # from here on one of them is out of step with the others
                mask = np.array([False, True, False, False])
                found = many.reset(options={"reset_mask": mask.copy()})
                expected = one_by_one.reset(options={"reset_mask": mask.copy()})
                assert same(found[0], expected[0])
                assert same(found[1], expected[1])
            actions = rng.uniform(-1, 1, many.action_space.shape).astype(np.float32)
            for mine, theirs in zip(many.step(actions), one_by_one.step(actions), strict=True):
                assert same(mine, theirs)


def test_a_target_comes_and_goes_in_its_own_time() -> None:
    many = KengoroVectorEnv(2, "elbow")
    first, _ = many.reset(seed=0)
    hold = np.zeros(many.action_space.shape, dtype=np.float32)
    for _ in range(100):
        many.step(hold)
    second, _ = many.reset(options={"reset_mask": np.array([False, True])})
    assert second["target"][0] == first["target"][0]
    assert second["target"][1] != first["target"][1]
    for _ in range(101):
        third, *_ = many.step(hold)
    assert third["target"][0] != second["target"][0]
    assert third["target"][1] == second["target"][1]
    for _ in range(200):
        fourth, *_ = many.step(hold)
    assert np.all(fourth["target"] != third["target"])


@pytest.mark.parametrize("value", [np.nan, 1e12])
def test_one_that_diverges_ends_alone(value: float, kind: type) -> None:
    many, calm = (KengoroVectorEnv(3, "elbow", robot_seed=1) for _ in range(2))
    rest = np.zeros(many.action_space.shape, dtype=np.float32)
    there = {"posture": [0.8], "target": [0.8]}
    for env in (many, calm):
        env.reset(seed=0, options=there)
    before, *_, known = many.step(rest)
    assert known["success"].all()
    calm.step(rest)
    velocities = (
        many.fleet._robots.data.qvel[1] if kind is NumpySteps else many.fleet.parts(1)[1].qvel
    )
    velocities[:] = value

    found, reward, terminated, truncated, infos = many.step(rest)
    expected, expected_reward, *_ = calm.step(rest)

    assert terminated.tolist() == [False, True, False]
    assert not truncated.any()
    assert same({k: v[1] for k, v in found.items()}, {k: v[1] for k, v in before.items()})
    assert (reward[1], infos["success"][1]) == (0.0, False)
    assert "diverged" in infos["reason"][1]
    assert infos["_reason"].tolist() == [False, True, False]
    for i in (0, 2):
        assert same({k: v[i] for k, v in found.items()}, {k: v[i] for k, v in expected.items()})
        assert reward[i] == expected_reward[i]

    found, reward, terminated, _, infos = many.step(rest)
    assert not terminated.any()
    assert (infos["time"][1], reward[1]) == (0.0, 0.0)
    assert "reason" not in infos
    assert np.isfinite(many.step(rest)[1]).all()


def test_without_a_seed_no_two_are_alike() -> None:
    many = KengoroVectorEnv(3, "elbow")
    found, _ = many.reset()
    assert len(np.unique(found["target"])) == 3
    again, _ = many.reset()
    assert len(np.unique([found["target"], again["target"]])) == 6


def test_what_they_give_is_in_their_spaces_and_is_the_callers() -> None:
    many = RecordEpisodeStatistics(gym.make_vec(ELBOW, 2, robot_seed=4, max_episode_steps=3))
    observation, infos = many.reset(seed=0)
    assert many.observation_space.contains(observation)
    observation["lengths"][:] = np.nan
    infos["joint_angles"][:] = np.nan
    for _ in range(3):
        observation, _, _, _, infos = many.step(many.action_space.sample())
        assert many.observation_space.contains(observation)
    assert infos["episode"]["l"].tolist() == [3, 3]
    many.close()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"camera": True}, 'no camera: leave camera out, or ask for vectorization_mode="async"'),
        ({"num_envs": 0}, "num_envs must be 1 or more, got 0"),
        ({"task": "can_grasp"}, "only the tasks posture and elbow have a vector environment"),
        ({"task": "juggle"}, "unknown task 'juggle'"),
    ],
)
def test_what_cannot_be_many(more: dict[str, Any], message: str) -> None:
    with pytest.raises(KengoroError, match=message):
        KengoroVectorEnv(**{"num_envs": 2, "task": "elbow", **more})


def test_bad_input_is_refused_before_anything_moves() -> None:
    many = KengoroVectorEnv(2, "elbow")
    rest = np.zeros((2, 3), dtype=np.float32)
    with pytest.raises(KengoroError, match="no episode to step"):
        many.step(rest)
    with pytest.raises(KengoroError, match="first reset must be one of all"):
        many.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(KengoroError, match="an entry for each of 2 environments"):
        many.reset(seed=[1, 2, 3])
    with pytest.raises(KengoroError, match="unknown option 'wind'"):
        many.reset(options={"wind": 1.0})
    many.reset(seed=0)
    with pytest.raises(KengoroError, match=r"shape \(2, 3\).*got \(3,\)"):
        many.step(rest[0])
    wrong = rest.copy()
    wrong[1, 2] = np.nan
    with pytest.raises(KengoroError, match=r"environment 1: entry 2 of the action \(triceps\)"):
        many.step(wrong)
    _, _, _, _, infos = many.step(rest)
    assert infos["time"] == pytest.approx([0.02, 0.02])
