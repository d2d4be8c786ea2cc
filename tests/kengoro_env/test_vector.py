"""The vector environment has the bits of single environments."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable
from typing import Any

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from kengoro_env.departures.tendons import DryFriction, Elongation
from kengoro_env.env import KengoroEnv
from kengoro_env.errors import ArgumentError, EpisodeError, KengoroError
from kengoro_env.stepping import choice
from kengoro_env.stepping.numpy_steps import NumpySteps
from kengoro_env.vector import KengoroVectorEnv
from tests.kengoro_env.environments import EveryOtherStretches, same

pytestmark = pytest.mark.usefixtures("kind")

ELBOW, POSTURE = "Kengoro/Elbow-v0", "Kengoro/Posture-v0"
ELONGATES = {
    "departures": (
        Elongation("biceps", 0.004, time=0.03),
        Elongation("triceps", 0.003, time=0.07),
        DryFriction(5.0, 0.1),
    )
}


def test_each_has_targets_of_its_own_at_their_times() -> None:
    """Also one that began later."""
    many: Any = gym.make_vec(ELBOW, 2)
    one_by_one = gym.make_vec(ELBOW, 2, vectorization_mode="sync")
    hold, shown = np.zeros(many.action_space.shape, dtype=np.float32), set()
    for envs in (many, one_by_one):
        envs.reset(seed=3)
    for k in range(440):  # 8.8 s
        if k == 50:
            for envs in (many, one_by_one):
                envs.reset(options={"reset_mask": np.array([False, True])})
        found, expected = (envs.step(hold)[0] for envs in (many, one_by_one))
        assert same(found, expected)
        shown.add(found["target"].tobytes())
    assert len(shown) == 1 + 2 + 2  # the first changes at 4 and 8 s, the second at 1 and 5 s


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


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_observations_of_single_precision_are_those_of_single_ones(
    mode: AutoresetMode, kind: type
) -> None:
    options: dict[str, Any] = {"dtype": np.float32, "robot_seed": 3, "max_episode_steps": 3}
    many: Any = gym.make_vec(ELBOW, 2, autoreset_mode=mode, **options)
    one_by_one = gym.make_vec(ELBOW, 2, "sync", {"autoreset_mode": mode}, **options)
    assert many.observation_space == one_by_one.observation_space
    for mine, theirs in zip(many.reset(seed=3), one_by_one.reset(seed=3), strict=True):
        assert same(mine, theirs)
    rng = np.random.default_rng(0)
    for _ in range(5):
        actions = rng.uniform(-1, 1, many.action_space.shape).astype(np.float32)
        found, expected = many.step(actions), one_by_one.step(actions)
        assert many.observation_space.contains(found[0])
        assert found[0]["target"].dtype == np.float32
        for mine, theirs in zip(found, expected, strict=True):
            assert same(mine, theirs)


@pytest.mark.parametrize("render_mode", ["rgb_array", "depth_array"])
@pytest.mark.parametrize("more", [{}, {"robot_seed": 3}], ids=["nominal", "3"])
def test_pictures_are_those_of_single_ones(
    more: dict[str, Any], render_mode: str, kind: type
) -> None:
    options = {"render_mode": render_mode, "width": 80, "height": 60, **more}
    many: Any = gym.make_vec(ELBOW, 2, max_episode_steps=2, **options)
    one_by_one = gym.make_vec(ELBOW, 2, "sync", max_episode_steps=2, **options)
    assert many.render_mode == render_mode
    assert render_mode in many.metadata["render_modes"]
    with pytest.raises(EpisodeError, match=r"no episode to render \(none has begun\): call reset"):
        many.render()
    many.reset(seed=3)
    one_by_one.reset(seed=3)
    actions = np.full(many.action_space.shape, 0.5, dtype=np.float32)
    for _ in range(4):  # through a truncation
        pictures, expected = many.render(), one_by_one.render()
        assert isinstance(pictures, tuple)
        assert not np.array_equal(*pictures)
        for mine, theirs in zip(pictures, expected, strict=True):
            assert same(mine, theirs)
        for mine, theirs in zip(many.step(actions), one_by_one.step(actions), strict=True):
            assert same(mine, theirs)
    many.close()
    one_by_one.close()


def test_without_a_render_mode_there_are_no_pictures() -> None:
    assert KengoroVectorEnv(2, "elbow").render() is None


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
        infos["_time"][:] = infos["success"][:] = False
        assert infos["_success"].all()
        observation, _, _, _, infos = many.step(many.action_space.sample())
        assert many.observation_space.contains(observation)
    assert infos["episode"]["l"].tolist() == [3, 3]
    many.close()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"camera": True}, 'no camera: leave camera out, or ask for vectorization_mode="async"'),
        ({"num_envs": 0}, "num_envs must be 1 or more, got 0"),
        ({"num_envs": "2"}, "num_envs must be a whole number, 1 or more, got '2'"),
        ({"num_envs": 2.0}, r"num_envs must be a whole number, 1 or more, got 2\.0"),
        ({"num_envs": True}, "num_envs must be a whole number, 1 or more, got True"),
        ({"threads": "2"}, "threads must be a whole number, from 0 to 256, got '2'"),
        ({"threads": -1}, "threads must be from 0 to 256, got -1"),
        ({"threads": 257}, "threads must be from 0 to 256, got 257"),
        ({"max_episode_steps": "5"}, "max_episode_steps must be a whole number, 1 or more"),
        ({"max_episode_steps": 0}, "max_episode_steps must be 1 or more, got 0"),
        ({"gains": 3.0}, r"gains must be kengoro_env\.Gains, got 3\.0"),
        ({"autoreset_mode": "never"}, "unknown autoreset_mode 'never'; known: NextStep, SameStep"),
        ({"render_mode": "human"}, 'has no window.*vectorization_mode="sync"'),
        ({"render_mode": "ascii"}, "unknown render_mode 'ascii'; known: human, rgb_array, depth"),
        ({"height": 5000}, "height must be from 1 to 4096, got 5000"),
        ({"task": "juggle"}, "unknown task 'juggle'"),
        ({"task": ["elbow"]}, r"unknown task \['elbow'\]"),
    ],
)
def test_what_cannot_be_many(more: dict[str, Any], message: str) -> None:
    with pytest.raises(KengoroError, match=message):
        KengoroVectorEnv(**{"num_envs": 2, "task": "elbow", **more})


def test_a_vector_environment_that_was_not_made_is_closed_in_silence() -> None:
    """Gymnasium up to 1.2 closes it when it is deleted."""
    KengoroVectorEnv.__new__(KengoroVectorEnv).close_extras()


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
    for unreal in (rest.astype(complex), np.ma.masked_array(rest, rest == 0)):
        with pytest.raises(KengoroError, match=r"actions must be real numbers.*got a \w+ of \S+$"):
            many.step(unreal)
    with pytest.raises(KengoroError, match=r"actions must be real numbers.*got 'pull'"):
        many.step("pull")  # type: ignore[arg-type]
    wrong = rest.copy()
    wrong[1, 2] = np.nan
    with pytest.raises(KengoroError, match=r"environment 1: entry 2 of the action \(triceps\)"):
        many.step(wrong)
    _, _, _, _, infos = many.step(rest)
    assert infos["time"] == pytest.approx([0.02, 0.02])


@pytest.mark.parametrize("more", [{"robot_seed": 3}, ELONGATES], ids=["noise", "events"])
def test_actions_that_are_refused_sample_no_noise_and_apply_no_event(more: dict[str, Any]) -> None:
    many, calm = (KengoroVectorEnv(3, "elbow", **more) for _ in range(2))
    rest = np.zeros((3, 3), dtype=np.float32)
    wrong = rest.copy()
    wrong[2, 0] = 1.1
    for env in (many, calm):
        env.reset(seed=0)
    for _ in range(6):
        with pytest.raises(KengoroError, match=r"environment 2: entry 0 of the action \(biceps\)"):
            many.step(wrong)
        for mine, theirs in zip(many.step(rest), calm.step(rest), strict=True):
            assert same(mine, theirs)


def test_it_takes_all_arguments_of_a_single_one() -> None:
    """Generic code forwards them, with the values that a single one has by default."""
    single = dict(inspect.signature(KengoroEnv).parameters)
    many = inspect.signature(KengoroVectorEnv).parameters
    assert set(single) <= set(many)
    defaults = {name: p.default for name, p in single.items() if name != "task"}
    many_of_them: Any = gym.make_vec(ELBOW, num_envs=2, **defaults)
    assert many_of_them.num_envs == 2


COPIERS: list[Callable[[Any], Any]] = [
    copy.deepcopy,
    lambda env: cloudpickle.loads(cloudpickle.dumps(env)),
]


@pytest.mark.parametrize("copied", COPIERS, ids=["deepcopy", "pickle"])
@pytest.mark.parametrize("more", [{}, {"robot_seed": 3}, ELONGATES], ids=["nominal", "3", "events"])
def test_a_copy_continues_with_the_same_bits(
    more: dict[str, Any], copied: Callable[[Any], Any]
) -> None:
    many: Any = gym.make_vec(ELBOW, 3, max_episode_steps=6, **more)
    copied(many).reset(seed=0)
    many.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(2):
        many.step(rng.uniform(-1, 1, many.action_space.shape))
    many.reset(options={"reset_mask": [False, True, False]})
    twin = copied(many)
    for _ in range(9):  # beyond the ends of all episodes
        actions = rng.uniform(-1, 1, many.action_space.shape)
        for mine, theirs in zip(many.step(actions), twin.step(actions), strict=True):
            assert same(mine, theirs)
    for mine, theirs in zip(many.reset(), twin.reset(), strict=True):
        assert same(mine, theirs)


def test_a_copy_goes_to_a_machine_without_compiled_code(monkeypatch: pytest.MonkeyPatch) -> None:
    many: Any = gym.make_vec(ELBOW, 2, robot_seed=3)
    many.reset(seed=1)
    actions = np.full(many.action_space.shape, 0.3)
    many.step(actions)
    kept = cloudpickle.dumps(many)
    monkeypatch.setattr(choice, "library", lambda: None)
    twin = cloudpickle.loads(kept)
    assert type(twin.fleet) is NumpySteps
    for _ in range(3):
        for mine, theirs in zip(many.step(actions), twin.step(actions), strict=True):
            assert same(mine, theirs)


@pytest.mark.parametrize("env", [lambda: KengoroEnv("elbow"), lambda: KengoroVectorEnv(2, "elbow")])
def test_seeds_are_whole_numbers_of_python_or_numpy(env: Callable[[], Any]) -> None:
    made = env()
    observation, _ = made.reset(seed=3)
    again, _ = made.reset(seed=np.int64(3))
    assert same(observation, again)
    for seed in ("3", 1.5, np.float64(1.0), True, b"3"):
        with pytest.raises(ArgumentError, match="seed must be a whole number, 0 or more, got"):
            made.reset(seed=seed)
    with pytest.raises(ArgumentError, match="seed must be 0 or more, got -1"):
        made.reset(seed=-1)
    with pytest.raises(ArgumentError, match=r"options must be a dict.*got \[1\]"):
        made.reset(options=[1])


def test_seeds_may_be_a_list_or_an_array() -> None:
    many = KengoroVectorEnv(2, "elbow")
    expected, _ = many.reset(seed=[4, 5])
    for seeds in ((4, 5), np.array([4, 5]), [np.int32(4), 5], 4):
        found, _ = many.reset(seed=seeds)  # type: ignore[arg-type]
        assert same(found, expected)
    with pytest.raises(ArgumentError, match="seed must be a whole number, 0 or more, got 'x'"):
        many.reset(seed=[1, "x"])  # type: ignore[list-item]
    with pytest.raises(ArgumentError, match="an entry for each of 2 environments"):
        many.reset(seed=np.zeros((2, 1), dtype=int))  # type: ignore[arg-type]


def test_a_mask_may_be_a_list_and_holds_truth_values() -> None:
    many = KengoroVectorEnv(2, "elbow")
    first, _ = many.reset(seed=0)
    second, _ = many.reset(options={"reset_mask": [True, False]})
    assert (first["target"] != second["target"]).ravel().tolist() == [True, False]
    for wrong in (np.array([1.0, 0.0]), [1, 0], [True], True, None, "TF", [[True], [False, True]]):
        with pytest.raises(ArgumentError, match="reset_mask must be True or False for each of 2"):
            many.reset(options={"reset_mask": wrong})


def test_a_mask_that_is_all_false_is_refused_as_by_gymnasium() -> None:
    many = KengoroVectorEnv(2, "elbow")
    others = gym.make_vec(ELBOW, 2, vectorization_mode="sync")
    nowhere = np.zeros(2, dtype=bool)
    many.reset(seed=0)
    with pytest.raises(ArgumentError, match="reset_mask must be True for one environment or more"):
        many.reset(options={"reset_mask": nowhere})
    others.reset(seed=0)
    with pytest.raises((ValueError, AssertionError)):  # asserted by earlier releases
        others.reset(options={"reset_mask": nowhere})


def test_what_rounding_takes_beyond_one_commands_what_one_does() -> None:
    found = []
    for largest in (1.0, 1.0000001):
        many = KengoroVectorEnv(2, "elbow")
        many.reset(seed=0)
        found.append(many.step(np.full((2, 3), largest, dtype=np.float32)))
    for mine, theirs in zip(*found, strict=True):
        assert same(mine, theirs)


@pytest.mark.parametrize("more", [{}, {"robot_seed": 3}], ids=["nominal", "3"])
def test_the_same_step_resets_as_in_gymnasiums_own(more: dict[str, Any]) -> None:
    steps, mode = 4, AutoresetMode.SAME_STEP
    many: Any = gym.make_vec(ELBOW, 3, max_episode_steps=steps, autoreset_mode=mode, **more)
    one_by_one = gym.make_vec(
        ELBOW, 3, "sync", {"autoreset_mode": mode}, max_episode_steps=steps, **more
    )
    assert many.metadata["autoreset_mode"] is mode
    for mine, theirs in zip(many.reset(seed=3), one_by_one.reset(seed=3), strict=True):
        assert same(mine, theirs)
    rng = np.random.default_rng(0)
    for k in range(2 * steps + 2):
        if k == 2:  # from here on one of them is out of step with the others
            for env in (many, one_by_one):
                env.reset(options={"reset_mask": np.array([False, True, False])})
        actions = rng.uniform(-1, 1, many.action_space.shape).astype(np.float32)
        found, expected = many.step(actions), one_by_one.step(actions)
        assert ("final_obs" in found[4]) == (k in (3, 5, 7, 9))
        for mine, theirs in zip(found, expected, strict=True):
            assert same(mine, theirs)


def test_one_that_diverges_is_reset_by_the_same_step(kind: type) -> None:
    many = KengoroVectorEnv(2, "elbow", autoreset_mode="SameStep")
    many.reset(seed=0)
    rest = np.zeros(many.action_space.shape, dtype=np.float32)
    before, *_ = many.step(rest)
    velocities = (
        many.fleet._robots.data.qvel[1] if kind is NumpySteps else many.fleet.parts(1)[1].qvel
    )
    velocities[:] = np.nan
    _, _, terminated, _, infos = many.step(rest)
    assert terminated.tolist() == [False, True]
    assert infos["time"].tolist() == pytest.approx([0.04, 0.0])
    assert "reason" not in infos
    assert "diverged" in infos["final_info"]["reason"][1]
    assert infos["_final_info"].tolist() == infos["_final_obs"].tolist() == [False, True]
    assert infos["final_obs"][0] is None
    assert same(infos["final_obs"][1], {name: values[1] for name, values in before.items()})
    assert not many.step(rest)[2].any()


def test_without_autoreset_the_user_resets() -> None:
    many = KengoroVectorEnv(2, "elbow", max_episode_steps=2, autoreset_mode="Disabled")
    many.reset(seed=0)
    rest = np.zeros(many.action_space.shape, dtype=np.float32)
    many.step(rest)
    many.reset(options={"reset_mask": [False, True]})
    assert many.step(rest)[3].tolist() == [True, False]
    with pytest.raises(KengoroError, match="environment 0 has ended: reset it with reset_mask"):
        many.step(rest)
    many.reset(options={"reset_mask": [True, False]})
    assert many.step(rest)[3].tolist() == [False, True]
