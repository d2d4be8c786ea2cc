"""Reinforcement learning of postures: fixed policies, summary, and the adapter to SB3."""

from __future__ import annotations

import json
import sys
from copy import deepcopy
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import (
    FilterObservation,
    FlattenObservation,
    MaxAndSkipObservation,
    TransformAction,
)

from experiments.__main__ import main
from experiments.harness.errors import ExperimentError
from experiments.learn_posture import run
from experiments.learn_posture.policies import (
    COMMON,
    ID,
    OTHERS,
    STARTS,
    Sizes,
    about,
    judge,
    learn,
    libraries,
    many_arms,
    one_arm,
    rest,
)
from experiments.learn_posture.run import Args, conclude

TINY = Sizes(steps=1024, environments=32, checks=1, short=2, whole=1)


def test_the_rest_commands_the_mean_of_starting_lengths() -> None:
    env = one_arm(None)
    starts = [env.reset(seed=seed)[0]["lengths"] for seed in range(STARTS)]
    lengths = env.action_to_lengths(rest(env))
    np.testing.assert_allclose(lengths, np.mean(starts, axis=0), rtol=0, atol=1e-7)


def test_actions_are_changes_about_a_centre() -> None:
    commanded = about(np.array([0.0, 0.5, -0.9]))
    np.testing.assert_allclose(commanded(np.zeros(3)), [0.0, 0.5, -0.9], atol=1e-7)
    np.testing.assert_allclose(commanded(np.array([1.0, -1.0, -1.0])), [0.3, 0.2, -1.0], atol=1e-7)


def test_what_there_is_to_learn_and_what_chance_brings() -> None:
    env = one_arm(None)
    rewards = {name: np.mean(judge(OTHERS[name](env), None, 2, 30).reward) for name in OTHERS}
    assert rewards["random"] < rewards["rest"] < rewards["nominal"]
    assert rewards["random"] < rewards["still"] < rewards["nominal"]


def test_a_policy_is_judged_in_the_same_episodes_each_time() -> None:
    policy = OTHERS["rest"](one_arm(None))
    assert judge(policy, None, 2, 10) == judge(policy, None, 2, 10)
    assert judge(policy, None, 2, 10).reward[0] == judge(policy, None, 1, 10).reward[0]
    assert judge(policy, None, 1, 10) != judge(policy, 3, 1, 10)  # another robot


def invented(rewards: list[float]) -> dict[str, Any]:
    whole = {"reward": rewards, "success": [0.0 for _ in rewards]}
    return {"steps": [0, 10], "short": [[0.1, 0.2], rewards], "whole": whole}


def test_summary_report_and_output_hold_the_results(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    learned = {4: invented([0.5, 0.7]), 5: invented([0.8, 1.0]), 6: invented([0.0, 0.2])}
    others = {
        name: {"short": {"reward": [0.2], "success": [0.0]}, "whole": invented([0.25])["whole"]}
        for name in OTHERS
    }
    summary = conclude(Args(out=tmp_path), TINY, "torch 0", learned, others, 0.0)
    metric = summary["metrics"]["reward of a step"]
    assert (metric["median"], metric["worst"]) == (0.6, 0.1)
    assert summary["metrics"]["reward above: random actions"]["median"] == pytest.approx(0.35)
    assert summary["curves"]["5"] == {"steps": [0, 10], "reward": [0.15, 0.9]}
    assert summary["tables"][0]["rows"][0] == ["learned", "3", "0.600 (0.100 to 0.900)", "0"]
    assert json.loads((tmp_path / "summary.json").read_text())["seeds"] == [4, 5, 6]
    assert "data:image/png" in (tmp_path / "report.html").read_text()
    assert "random actions" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--steps", "0"], "Steps are 0, but at least 1 is needed.\n"),
        (["--seeds", "b"], "Seeds are 'b'; give one such as 3 or a range such as 0-9.\n"),
        (["--jobs", "0"], "Jobs are 0, but at least 1 is needed.\n"),
    ],
)
def test_an_error_message_is_one_sentence(
    arguments: list[str], sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["learn-posture", "--out", str(out), *arguments]) == 2
    assert capsys.readouterr().err == sentence
    assert not out.exists()


def test_missing_libraries_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(ExperimentError, match=r"not installed: pip install 'kengoro\[rl\]'\.$"):
        libraries()


def single(held: int) -> gym.Env[Any, Any]:
    """One arm as the page on reinforcement learning has it, without its actions' rest."""
    env = gym.make(ID, camera=False, max_episode_steps=6)
    env = TransformAction(env, lambda action: 0.5 * action, env.action_space)
    env = FlattenObservation(FilterObservation(env, ["target"]))
    return MaxAndSkipObservation(env, skip=held) if held > 1 else env


@pytest.mark.slow
@pytest.mark.torch
@pytest.mark.parametrize("held", [1, 2, 3])
def test_many_arms_are_to_a_learner_what_as_many_single_ones_are(held: int) -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv

    from experiments.learn_posture.sb3_envs import Sb3Envs

    ours = Sb3Envs(many_arms(None, 3, 6), "target", lambda actions: 0.5 * actions, held)
    theirs = DummyVecEnv([lambda: single(held)] * 3)
    rng = np.random.default_rng(0)
    for envs in (ours, theirs):
        envs.seed(7)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    for _ in range(7):
        actions = rng.uniform(-1.0, 1.0, (3, 36)).astype(np.float32)
        got, expected = ours.step(actions), theirs.step(actions)
        np.testing.assert_array_equal(got[0], expected[0])
        np.testing.assert_allclose(got[1], expected[1], rtol=1e-6)  # theirs are float32
        np.testing.assert_array_equal(got[2], expected[2])
        for mine, their in zip(got[3], expected[3], strict=True):
            assert mine["success"] == their["success"]
            assert mine.get("TimeLimit.truncated", False) == their["TimeLimit.truncated"]
            assert ("terminal_observation" in mine) == ("terminal_observation" in their)
            if "terminal_observation" in mine:
                np.testing.assert_array_equal(
                    mine["terminal_observation"], their["terminal_observation"]
                )


@pytest.mark.slow
@pytest.mark.torch
@pytest.mark.parametrize("algorithm", ["ppo", "sac"])
def test_the_same_seed_learns_the_same(algorithm: str) -> None:
    settings = deepcopy(COMMON)
    first = learn(algorithm, 1, TINY)
    assert settings == COMMON
    assert first == learn(algorithm, 1, TINY)
    assert first["short"][0] != first["short"][1]  # it did learn something
    assert first["short"][1] != learn(algorithm, 2, TINY)["short"][1]


@pytest.mark.slow
def test_what_was_learned_is_not_learned_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "QUICK", TINY)
    arguments = ["learn-posture", "--quick", "--seeds", "1", "--out", str(tmp_path)]
    assert main(arguments) == 0
    before = json.loads((tmp_path / "summary.json").read_text())
    monkeypatch.setattr(run, "learn", None)
    assert main(arguments) == 0
    again = json.loads((tmp_path / "summary.json").read_text())
    assert again["per_seed"] == before["per_seed"]
    assert before["algorithm"] == "ppo"
