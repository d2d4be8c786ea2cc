"""The C code is compiled once, where that is possible; elsewhere the log says why not."""

from __future__ import annotations

import ctypes
import logging
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

import kengoro_env
from kengoro_env.stepping import c_compiler, compiled_steps
from kengoro_env.stepping.c_compiler import library, load
from kengoro_env.stepping.control import Control
from kengoro_env.vision.quick_renderer import Canvas
from tests.kengoro_env.environments import make


def test_on_linux_a_compiler_is_enough() -> None:
    """So that the other tests of compiled code are not left out for another reason."""
    compiler = os.environ.get("CC", "cc")
    if sys.platform == "linux" and shutil.which(compiler) and c_compiler.SWITCH not in os.environ:
        assert library() is not None


def test_structures_are_as_large_as_in_c() -> None:
    found = library()
    if found is None:
        pytest.skip("there is no compiled code here")
    assert found.size_of_step() == ctypes.sizeof(compiled_steps.Step)


@pytest.mark.parametrize(
    ("structure", "file"),
    [
        (compiled_steps.Step, "stepping/control_step.c"),
        (compiled_steps.Friction, "stepping/control_step.c"),
        (Canvas, "vision/scene.c"),
    ],
)
def test_structures_have_their_fields_in_the_order_of_c(
    structure: type[ctypes.Structure], file: str
) -> None:
    """A field in another place of the same size is a pointer that leads anywhere."""
    source = (Path(kengoro_env.__file__).parent / file).read_text("utf-8")
    source = re.sub(r"/\*.*?\*/", "", source, flags=re.DOTALL)
    found = re.search(rf"typedef struct {{([^}}]*)}} {structure.__name__};", source)
    assert found is not None
    in_c = re.findall(r"(\*?)\s(\w+)(?:\[\d+\])?;", found[1])
    fields = [("*" if kind is ctypes.c_void_p else "", name) for name, kind in structure._fields_]
    assert in_c == fields


def _no_compiler(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setenv("CC", "a-compiler-that-is-not-there")


def _failing_compiler(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setenv("CC", "false")


def _slow_compiler(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setenv("CC", "sh -c 'sleep 9'")
    patch.setattr(c_compiler, "_PATIENCE", 0.05)


def _strange_compiler(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setenv("CC", "cc '-DQUOTE")


def _no_folder(patch: pytest.MonkeyPatch, folder: Path) -> None:
    folder.rmdir()
    folder.write_text("a file")


def _hidden_folder(patch: pytest.MonkeyPatch, folder: Path) -> None:
    def refuse(path: Path) -> bool:
        raise PermissionError(f"not allowed to look into {path}")

    patch.setattr(Path, "is_file", refuse)


def _other_mujoco(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setattr(mujoco, "__file__", str(folder / "__init__.py"))


@pytest.mark.parametrize(
    ("obstacle", "reason"),
    [
        (_no_compiler, "there is no C compiler 'a-compiler-that-is-not-there'"),
        (_failing_compiler, "false failed: no message"),
        (_slow_compiler, "sh took longer than 0.05 s"),
        (_strange_compiler, "No closing quotation"),
        (_no_folder, "exists"),
        (_hidden_folder, "not allowed to look into"),
        (_other_mujoco, "does not have the one library of MuJoCo"),
    ],
)
def test_without_compiled_code_numpy_does_it_and_the_log_says_why(
    obstacle: Callable[[pytest.MonkeyPatch, Path], None],
    reason: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    log_of_a_library: Callable[[], str],
) -> None:
    folder = tmp_path / "cache"
    folder.mkdir()
    monkeypatch.setattr(c_compiler, "user_cache_path", lambda name: folder)
    with monkeypatch.context() as patch:
        obstacle(patch, folder)
        told = log_of_a_library()
    assert "steps by NumPy and pictures of all there is" in told
    assert reason in told
    assert not folder.is_dir() or not list(folder.iterdir())


def test_a_switch_leaves_it_to_numpy(
    monkeypatch: pytest.MonkeyPatch, log_of_a_library: Callable[[], str]
) -> None:
    monkeypatch.setenv(c_compiler.SWITCH, "0")
    monkeypatch.setattr(c_compiler, "user_cache_path", _homeless)
    assert "KENGORO_COMPILED is 0" in log_of_a_library()


def test_somebody_without_a_home_folder_has_numpy(
    monkeypatch: pytest.MonkeyPatch, log_of_a_library: Callable[[], str]
) -> None:
    monkeypatch.setattr(c_compiler, "user_cache_path", _homeless)
    assert "could not determine the home directory" in log_of_a_library()


def test_other_systems_have_numpy(
    monkeypatch: pytest.MonkeyPatch, log_of_a_library: Callable[[], str]
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(sys, "platform", "darwin")
        assert "tried on Linux only" in log_of_a_library()


def _homeless(name: str) -> Path:
    raise RuntimeError("could not determine the home directory")


@pytest.fixture
def log_of_a_library(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> Iterator[Callable[[], str]]:
    """What the log says when there is no compiled code; environments step all the same."""
    monkeypatch.delenv(c_compiler.SWITCH, raising=False)

    def look() -> str:
        library.cache_clear()
        with caplog.at_level(logging.INFO, logger="kengoro_env"):
            assert library() is None
        return caplog.text

    yield look
    env = make("Kengoro/Elbow-v0")
    library.cache_clear()
    assert type(env._control) is Control
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
    monkeypatch.setattr(c_compiler, "_OPTIONS", (*c_compiler._OPTIONS, "-DOTHER"))
    load(folder)
    assert len(list(folder.iterdir())) == 2


def test_a_broken_file_in_the_cache_is_compiled_again(tmp_path: Path) -> None:
    if library() is None:
        pytest.skip("there is no compiled code here")
    load(tmp_path / "whole")
    (made,) = (tmp_path / "whole").iterdir()
    broken = tmp_path / "broken" / made.name
    broken.parent.mkdir()
    broken.write_bytes(b"not a library")
    assert load(broken.parent).size_of_step() == ctypes.sizeof(compiled_steps.Step)
    assert broken.stat().st_size == made.stat().st_size


def test_a_compiler_may_warn_in_any_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if library() is None:
        pytest.skip("there is no compiled code here")
    compiler = tmp_path / "warns"
    compiler.write_text("#!/bin/sh\nprintf 'Gr\\374\\337e' >&2\nexec cc \"$@\"\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    assert load(tmp_path / "cache").size_of_step() == ctypes.sizeof(compiled_steps.Step)
