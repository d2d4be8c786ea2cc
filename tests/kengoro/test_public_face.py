"""Robots and studies as a stranger asks for them: paths as text, wrong names and seeds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kengoro
from kengoro_env import NominalArm
from kengoro_env.departures import Elongation
from kengoro_env.errors import KengoroError
from reality_gap import load_study

ARM3 = str(Path(__file__).parents[2] / "examples" / "arm3.xml")


def test_a_study_of_a_model_with_textures_elsewhere_can_be_loaded(tmp_path: Path) -> None:
    arm, steps = NominalArm(ARM3), 50
    angles = np.minimum(np.arange(steps), 20)[:, None] * np.full(3, 0.01)  # moves, then rests
    lengths = arm.lengths(angles)
    tensions = 30.0 + np.random.default_rng(0).random(lengths.shape)
    recording = kengoro.Recording(np.arange(steps) / 50, lengths, lengths, tensions, np.zeros(3))
    study = load_study(kengoro.write_study(str(tmp_path), "arm3", ARM3, [recording]))
    assert len(study.channels) == 2 * len(arm.muscles)


@pytest.mark.parametrize(
    ("task", "frames"), [("CanGrasp", True), ("Posture", True), ("Elbow", False)]
)
def test_robots_for_an_agent_have_the_camera_that_it_learns_from(task: str, frames: bool) -> None:
    env = kengoro.make_env(task)
    env.close()
    assert ("frame" in env.observation_space.spaces) == frames


def test_a_robot_may_be_chosen_by_its_departures() -> None:
    made: Any = kengoro.make_env("Elbow", departures=[Elongation("biceps", 0.02)], camera=False)
    nominal: Any = kengoro.make_env("Elbow", camera=False)
    elongations = [env.unwrapped.robot.motors.elongation for env in (made, nominal)]
    np.testing.assert_array_equal(elongations, [[0.02, 0.0, 0.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: kengoro.make_env("elbow"), "There is no task 'elbow'; there are: CanGrasp, Pos"),
        (lambda: kengoro.make_env("Elbow", -1), "The seed is -1, but seeds are not negative."),
        (
            lambda: kengoro.make_env("Elbow", 1, departures=[]),
            "give either robot_seed or departures, not both",
        ),
        (
            lambda: kengoro.make_env("Elbow", departures=["stretch"]),  # type: ignore[list-item]
            "unknown departure 'stretch'; known: Attachment",
        ),
        (lambda: kengoro.make_env("Elbow", model="my.xml"), "make_env has no model: give it to g"),
        (lambda: kengoro.make_env("Elbow", hand=[]), r"The hand is \[\]; it must be"),  # type: ignore[arg-type]
        (lambda: kengoro.make_agent(-1), "The seed is -1"),
        (lambda: kengoro.sample_postures(ARM3, 5, seed=-1), "The seed is -1"),
        (lambda: kengoro.shuffled_postures(-1), "The seed is -1"),
        (lambda: kengoro.record("log", motion=-1), "The seed is -1"),
    ],
)
def test_a_wrong_name_or_seed_is_one_sentence(call: Callable[[], object], message: str) -> None:
    with pytest.raises((kengoro.UsageError, KengoroError), match=message):
        call()
