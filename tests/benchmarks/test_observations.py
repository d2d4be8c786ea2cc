"""The benchmark of raw, scaled and normalised observations."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from benchmarks import observations
from experiments.harness.errors import ExperimentError
from kengoro_env import KengoroVectorEnv


def test_a_policy_that_reaches_the_target_is_judged_better_than_fixed_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that knows the lengths at three angles of the elbow, and interpolates."""
    monkeypatch.setattr(observations, "EPISODES", 2)
    world: Any = gym.make(observations.ID).unwrapped
    angles = np.radians([0.0, 50.0, 100.0])
    lengths = [world.reset(options={"posture": [a]})[0]["lengths"] for a in angles]
    commands = world.bounds.to_action(np.array(lengths))

    def informed(observed: Any) -> Any:
        target = observed[:, 3]  # after 3 lengths
        columns = [np.interp(target, angles, column) for column in commands.T]
        return np.stack(columns, axis=1).astype(np.float32)

    flat = observations.KINDS["raw"][0]
    reached = observations.judged(flat, informed)
    others = observations.fixed()
    assert list(others) == ["holds still", "random actions"]
    assert max(others.values()) < 0.6 < reached <= 1.0


def test_each_kind_is_flat_and_of_the_fast_environment() -> None:
    for wrapper, _ in observations.KINDS.values():
        envs = wrapper(gym.make_vec(observations.ID, 2))
        assert isinstance(envs.unwrapped, KengoroVectorEnv)
        assert envs.reset(seed=0)[0].shape == (2, 7)


def test_a_missing_library_is_named_in_one_sentence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def missing() -> None:
        raise ExperimentError("Learning needs Stable-Baselines3")

    monkeypatch.setattr(observations, "libraries", missing)
    with pytest.raises(SystemExit, match="Learning needs Stable-Baselines3"):
        observations.main()


@pytest.mark.slow
@pytest.mark.torch
@pytest.mark.parametrize("kind", observations.KINDS)
def test_a_policy_learns(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some steps only, which are enough for a reward in its range."""
    pytest.importorskip("stable_baselines3")
    monkeypatch.setattr(observations, "EPISODES", 1)
    assert -0.05 <= observations.learned(kind, 0, 2048) <= 1.0
