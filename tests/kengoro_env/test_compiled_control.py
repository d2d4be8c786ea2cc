"""Compiled control steps have the bits of NumPy's; without a compiler there are NumPy's."""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from kengoro_env import compiled_control, compiled_steps, compiling
from kengoro_env.compiled_control import CompiledControl
from kengoro_env.compiled_fleet import CompiledFleet
from kengoro_env.compiling import NotCompiledError, library, load
from kengoro_env.control import Control
from kengoro_env.departures import (
    Elongation,
    EncoderError,
    TensionSensorError,
    WireStretch,
    actual,
)
from kengoro_env.departures.wires import DryFriction
from kengoro_env.env import KengoroEnv
from kengoro_env.motors import Gains
from kengoro_env.spaces import InvalidActionError
from kengoro_env.vector import KengoroVectorEnv
from tests.kengoro_env.making import EveryOtherStretches, make

ELBOW, POSTURE, GRASP = "Kengoro/Elbow-v0", "Kengoro/Posture-v0", "Kengoro/CanGrasp-v0"
GIVES = Elongation("biceps", 0.004, time=0.03)


def compiled(env_id: str, **arguments: Any) -> KengoroEnv:
    env = make(env_id, **arguments)
    if not isinstance(env._control, CompiledControl):
        pytest.skip("there is no compiled code here")
    return env


def plain(env_id: str, **arguments: Any) -> KengoroEnv:
    """The same by NumPy."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled_control, "library", lambda: None)
        env = make(env_id, **arguments)
    assert type(env._control) is Control
    return env


def pair(env_id: str, **arguments: Any) -> tuple[KengoroEnv, KengoroEnv]:
    if env_id != ELBOW:
        arguments["camera"] = False
    return compiled(env_id, **arguments), plain(env_id, **arguments)


def assert_same(one: Any, other: Any) -> None:
    """Types, shapes and bits."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert set(one) == set(other)
        for name in one:
            assert_same(one[name], other[name])
    elif isinstance(one, tuple):
        for mine, theirs in zip(one, other, strict=True):
            assert_same(mine, theirs)
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert np.array_equal(one, other)
    else:
        assert one == other


def go(envs: tuple[KengoroEnv, KengoroEnv], steps: int, seed: int, reach: float = 1.0) -> None:
    """Random actions; all that is told and stays behind is the same."""
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        action = rng.uniform(-reach, reach, envs[0].action_space.shape).astype(np.float32)
        assert_same(*(env.step(action.copy()) for env in envs))
    one, other = (env.robot for env in envs)
    assert_same(one.target, other.target)
    assert_same(one.sense(one.measure()), other.sense(other.measure()))
    for field in ("qpos", "qvel", "ctrl", "actuator_force", "qfrc_constraint"):
        assert_same(getattr(one.data, field), getattr(other.data, field))


@pytest.mark.parametrize(
    ("env_id", "more"),
    [
        (ELBOW, {}),
        (ELBOW, {"robot_seed": 3}),
        (ELBOW, {"departures": (EveryOtherStretches(), GIVES)}),
        (ELBOW, {"departures": (GIVES, DryFriction(5.0, 0.1)), "gains": Gains(2e4, 20.0, 150.0)}),
        (ELBOW, {"departures": (WireStretch(1e-5, 4e6), Elongation("triceps", 0.01))}),
        (ELBOW, {"departures": (EncoderError(offset=0.002, seed=1),)}),
        (ELBOW, {"departures": (EncoderError(noise=0.001),)}),
        (ELBOW, {"departures": (EncoderError(quantum=0.0005),)}),
        (ELBOW, {"departures": (TensionSensorError(noise=40.0),)}),
        (ELBOW, {"departures": (TensionSensorError(offset=40.0, seed=2),)}),
        (POSTURE, {}),
        (POSTURE, {"robot_seed": 1}),
        (POSTURE, {"departures": (*actual(4), Elongation("delt_mid", 0.01, time=0.05))}),
        (POSTURE, {"departures": (EveryOtherStretches(),)}),
        (GRASP, {}),
        (GRASP, {"robot_seed": 2}),
    ],
)
def test_the_bits_are_numpys(env_id: str, more: dict[str, Any]) -> None:
    envs = pair(env_id, **more)
    for seed in range(2):
        assert_same(*(env.reset(seed=seed) for env in envs))
        go(envs, 12, seed)
        for env in envs:
            env.set_stiffness(9_000.0, np.linspace(0.0, 40.0, len(env.muscles)))
        go(envs, 4, seed + 10, reach=0.1)
        for env in envs:
            env.robot.elongate(env.muscles[-1], 0.01)
        go(envs, 4, seed + 20)


@pytest.mark.parametrize("more", [{}, {"robot_seed": 1}], ids=["drawing", "actual"])
def test_targets_change_at_the_same_time(more: dict[str, Any]) -> None:
    envs = pair(ELBOW, **more)
    for env in envs:
        env.reset(seed=0)
    first = envs[0].task.goal
    go(envs, 205, 0, reach=0.2)
    assert envs[0].task.goal != first


def test_somebody_may_move_the_robot_between_two_steps() -> None:
    envs = pair(ELBOW, robot_seed=2)
    for env in envs:
        env.reset(seed=0)
    go(envs, 3, 0)
    for field, value in (("qpos", 0.5), ("qvel", 2.0)):
        for env in envs:
            getattr(env.robot.data, field)[0] = value
        go(envs, 3, 1)
    for env in envs:
        env.robot.step(env.robot.target - 0.001)  # by NumPy in both
    go(envs, 3, 2)
    state = (
        [env.robot.data.qpos.copy() for env in envs],
        [env.robot.data.qvel.copy() for env in envs],
    )
    go(envs, 3, 3)
    for env, position, velocity in zip(envs, *state, strict=True):
        env.robot.data.qpos[:], env.robot.data.qvel[:] = position, velocity
    go(envs, 3, 4)


@pytest.mark.parametrize("value", [np.nan, 1e200, 1e12])
def test_both_diverge_at_the_same_time(value: float) -> None:
    """Not finite; finite, but not its square; finite, but too large for MuJoCo."""
    envs = pair(ELBOW, robot_seed=2)
    for env in envs:
        env.reset(seed=0)
    go(envs, 2, 0)
    for env in envs:
        env.robot.data.qvel[0] = value
    told = [env.step(np.zeros(3, dtype=np.float32)) for env in envs]
    assert_same(*told)
    assert told[0][2]
    assert_same(*(env.reset() for env in envs))
    go(envs, 3, 1)


@pytest.mark.parametrize(
    "action",
    [
        [0.1, -0.2, 0.3],
        np.array([1, 0, -1]),
        np.array([0.1, -0.2, 0.3]),
        np.array([0.1, -0.2, 0.3, 9.0, 9.0, 9.0])[:3],
        np.array([0.1, 9.0, -0.2, 9.0, 0.3], dtype=np.float32)[::2],
        np.array([True, False, True]),
        np.array([0.1, -0.2, 0.3], dtype=object),
        np.array(["0.1", "-0.2", "0.3"]),
    ],
    ids=["list", "int", "float64", "view", "strided", "bool", "object", "text"],
)
def test_actions_of_many_kinds(action: Any) -> None:
    envs = pair(ELBOW)
    for env in envs:
        env.reset(seed=0)
    assert_same(*(env.step(action) for env in envs))


@pytest.mark.parametrize(
    "action",
    [
        [0.0, 0.0],
        np.float32(0.5),
        np.array([0.5]),
        np.zeros((1, 3), dtype=np.float32),
        np.zeros((3, 1), dtype=np.float32),
        np.array([0.0, np.nan, 0.0], dtype=np.float32),
        np.array([0.0, np.inf, 0.0]),
        np.array([0.0, 0.0, -1.0000001]),
        np.array([0.0, None, 0.0]),
        np.array(["0.1", "up", "0.3"]),
        None,
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value encountered")
def test_what_is_no_action_is_refused_in_the_same_words_and_moves_nothing(action: Any) -> None:
    envs = pair(ELBOW)
    said = []
    for env in envs:
        env.reset(seed=0)
        env.step(np.zeros(3, dtype=np.float32))
        target = env.robot.target
        with pytest.raises(InvalidActionError) as refused:
            env.step(action)
        said.append(str(refused.value))
        assert env.robot.time == pytest.approx(0.02)
        assert np.array_equal(env.robot.target, target)
    assert said[0] == said[1]
    go(envs, 3, 0)


def test_an_error_of_mujoco_is_raised_as_its_bindings_do() -> None:
    env = compiled(ELBOW)
    env.reset(seed=0)
    env.robot.model.opt.integrator = 99
    with pytest.raises(mujoco.FatalError, match="integrator"):
        env.step(np.zeros(3, dtype=np.float32))
    env.robot.model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    env.reset(seed=0)
    assert env.step(np.zeros(3, dtype=np.float32))[4]["time"] == pytest.approx(0.02)


def test_an_error_of_mujoco_in_one_of_many_is_raised() -> None:
    many = KengoroVectorEnv(5, "elbow", robot_seed=1, threads=3)
    if not isinstance(many.fleet, CompiledFleet):
        pytest.skip("there is no compiled code here")
    rest = np.zeros((5, 3), dtype=np.float32)
    many.reset(seed=0)
    many.fleet.parts(3)[0].opt.integrator = 99
    with pytest.raises(mujoco.FatalError, match="integrator"):
        many.step(rest)
    many.fleet.parts(3)[0].opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    many.reset(seed=0)
    assert many.step(rest)[4]["time"] == pytest.approx([0.02] * 5)


def test_structures_are_as_large_as_in_c() -> None:
    found = library()
    if found is None:
        pytest.skip("there is no compiled code here")
    assert found.size_of_step() == ctypes.sizeof(compiled_steps.Step)


def _no_compiler(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setenv("CC", "a-compiler-that-is-not-there")


def _failing_compiler(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setenv("CC", "false")


def _switched_off(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setenv(compiling.SWITCH, "0")


def _no_folder(patch: pytest.MonkeyPatch, folder: Path) -> None:
    folder.rmdir()
    folder.write_text("a file")


def _other_mujoco(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setattr(mujoco, "__file__", str(folder / "__init__.py"))


@pytest.mark.parametrize(
    ("obstacle", "reason"),
    [
        (_no_compiler, "there is no C compiler 'a-compiler-that-is-not-there'"),
        (_failing_compiler, "false failed: no message"),
        (_switched_off, "KENGORO_COMPILED is 0"),
        (_no_folder, "it cannot be compiled: .*exists"),
        (_other_mujoco, "does not have the one library of MuJoCo"),
    ],
)
def test_without_compiled_code_numpy_does_it_and_the_log_says_why(
    obstacle: Callable[[pytest.MonkeyPatch, Path], None],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    folder = tmp_path / "cache"
    folder.mkdir()
    monkeypatch.delenv(compiling.SWITCH, raising=False)
    obstacle(monkeypatch, folder)
    with pytest.raises(NotCompiledError, match=reason):
        load(folder)
    assert not folder.is_dir() or not list(folder.iterdir())

    monkeypatch.setattr(compiling, "user_cache_path", lambda name: folder)
    library.cache_clear()
    try:
        with caplog.at_level(logging.INFO, logger="kengoro_env"):
            env = make(ELBOW)
    finally:
        library.cache_clear()
    assert type(env._control) is Control
    assert "control steps are computed by NumPy" in caplog.text
    env.reset(seed=0)
    assert env.step(np.zeros(3, dtype=np.float32))[4]["time"] == pytest.approx(0.02)


def test_code_is_compiled_once_and_for_each_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if library() is None:
        pytest.skip("there is no compiled code here")
    folder = tmp_path / "new" / "cache"
    load(folder)
    (made,) = folder.iterdir()
    when = made.stat().st_mtime_ns
    load(folder)
    assert [path.stat().st_mtime_ns for path in folder.iterdir()] == [when]
    monkeypatch.setattr(compiling, "_OPTIONS", (*compiling._OPTIONS, "-DOTHER"))
    load(folder)
    assert len(list(folder.iterdir())) == 2


def test_a_broken_file_in_the_cache_is_named(tmp_path: Path) -> None:
    if library() is None:
        pytest.skip("there is no compiled code here")
    load(tmp_path / "whole")
    (made,) = (tmp_path / "whole").iterdir()
    broken = tmp_path / "broken" / made.name
    broken.parent.mkdir()
    broken.write_bytes(b"not a library")
    with pytest.raises(NotCompiledError, match=rf"{made.name} cannot be loaded"):
        load(broken.parent)
