"""Errors of kengoro_env: one base class, and the built-in exception that fits each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kengoro_env import errors
from kengoro_env.assets import asset_path
from kengoro_env.errors import KengoroError
from kengoro_env.robot.model_file import load_spec
from kengoro_env.robot.robot import Robot
from kengoro_env.vector import KengoroVectorEnv
from tests.kengoro_env.environments import make

ELBOW = "Kengoro/Elbow-v0"


@pytest.mark.parametrize(
    ("name", "builtin"),
    [
        ("ArgumentError", ValueError),
        ("InvalidActionError", ValueError),
        ("UnknownNameError", KeyError),
        ("ModelError", ValueError),
        ("AssetError", OSError),
        ("EpisodeError", RuntimeError),
        ("DivergedError", RuntimeError),
        ("NotCompiledError", RuntimeError),
        ("RenderingError", RuntimeError),
    ],
)
def test_each_error_is_a_builtin_exception_too(name: str, builtin: type[Exception]) -> None:
    error = getattr(errors, name)
    assert issubclass(error, KengoroError)
    assert issubclass(error, builtin)


def test_no_error_is_left_out() -> None:
    found = {name for name in vars(errors) if name.endswith("Error")}
    assert len(found) == 10
    for name in found - {"KengoroError"}:
        assert len(getattr(errors, name).__mro__) > len(KengoroError.__mro__) + 1


def test_the_message_of_an_unknown_name_has_no_quotes_around_it() -> None:
    """As a `KeyError` of Python's own would have."""
    with pytest.raises(KeyError) as caught:
        make(ELBOW, departures=[None])
    assert str(caught.value).startswith("unknown departure None; known: AttachmentDisplacement, ")


def test_wrong_arguments_are_value_errors() -> None:
    with pytest.raises(ValueError, match="robot_seed must not be negative, got -1"):
        make(ELBOW, robot_seed=-1)
    with pytest.raises(ValueError, match="num_envs must be 1 or more, got 0"):
        KengoroVectorEnv(0, "elbow")
    env = make(ELBOW)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"entry 1 of the action \(brachialis\) is 2"):
        env.step(np.array([0.0, 2.0, 0.0], dtype=np.float32))
    with pytest.raises(ValueError, match=r"control_period is 0\.3, but must be from 0\.001"):
        Robot(asset_path("mjcf/kengoro_arm/elbow.xml"), control_period=0.3)
    with pytest.raises(ValueError, match="no model file at "):
        load_spec(Path("nowhere.xml"))


def test_a_step_without_an_episode_is_a_runtime_error() -> None:
    with pytest.raises(RuntimeError, match="call reset"):
        make(ELBOW).step(np.zeros(3, dtype=np.float32))


def test_a_missing_asset_is_an_os_error() -> None:
    with pytest.raises(OSError, match="does not exist"):
        asset_path("nowhere")
