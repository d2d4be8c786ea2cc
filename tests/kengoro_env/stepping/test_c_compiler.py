"""The C code is compiled once, if that is possible; otherwise the log gives the reason."""

from __future__ import annotations

import ctypes
import logging
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

import kengoro_env
from kengoro_env.stepping import c_compiler, step_structures
from kengoro_env.stepping.c_compiler import library, load
from kengoro_env.stepping.numpy_steps import NumpySteps
from kengoro_env.vision.quick_renderer import Canvas
from tests.kengoro_env.environments import make

ROOT = Path(kengoro_env.__file__).parents[1]


def test_on_linux_a_compiler_is_enough() -> None:
    """The other tests of compiled code are skipped without it."""
    compiler = os.environ.get("CC", "cc")
    if sys.platform == "linux" and shutil.which(compiler) and c_compiler.SWITCH not in os.environ:
        assert library() is not None


def test_structures_are_as_large_as_in_c() -> None:
    found = library()
    if found is None:
        pytest.skip("there is no compiled code here")
    assert found.size_of_step() == ctypes.sizeof(step_structures.Step)


@pytest.mark.parametrize(
    ("structure", "file"),
    [
        (step_structures.Step, "stepping/control_step.c"),
        (step_structures.Friction, "stepping/control_step.c"),
        (step_structures.Fleet, "stepping/control_step.c"),
        (Canvas, "vision/scene.c"),
    ],
)
def test_structures_have_their_fields_in_the_order_of_c(
    structure: type[ctypes.Structure], file: str
) -> None:
    """Two fields of the same size in another order would be pointers to the wrong memory."""
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
    patch.setattr(c_compiler, "_TIMEOUT", 0.05)


def _unparsable_compiler(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setenv("CC", "cc '-DQUOTE")


def _no_folder(patch: pytest.MonkeyPatch, folder: Path) -> None:
    folder.rmdir()
    folder.write_text("a file")


def _hidden_folder(patch: pytest.MonkeyPatch, folder: Path) -> None:
    def refuse(path: Path) -> bool:
        raise PermissionError(f"not allowed to read {path}")

    patch.setattr(Path, "is_file", refuse)


def _other_mujoco(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setattr(mujoco, "__file__", str(folder / "__init__.py"))


def _other_numpy(patch: pytest.MonkeyPatch, folder: Path) -> None:
    patch.setattr(np, "__file__", str(folder / "__init__.py"))


@pytest.mark.parametrize(
    ("obstacle", "reason"),
    [
        (_no_compiler, "there is no C compiler 'a-compiler-that-is-not-there'"),
        (_failing_compiler, "false failed: no message"),
        (_slow_compiler, "sh took longer than 0.05 s"),
        (_unparsable_compiler, "No closing quotation"),
        (_no_folder, "exists"),
        (_hidden_folder, "not allowed to read"),
        (_other_mujoco, "must hold one library of MuJoCo, found 0"),
        (_other_numpy, "NumPy must come with its library"),
    ],
)
def test_without_compiled_code_numpy_computes_it_and_the_log_has_the_reason(
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
        message = log_of_a_library()
    assert "no compiled code, so that steps and images take longer" in message
    assert reason in message
    assert not folder.is_dir() or not list(folder.rglob("*.so"))


def test_a_switch_leaves_it_to_numpy(
    monkeypatch: pytest.MonkeyPatch, log_of_a_library: Callable[[], str]
) -> None:
    monkeypatch.setenv(c_compiler.SWITCH, "0")
    monkeypatch.setattr(c_compiler, "user_cache_path", _homeless)
    assert "KENGORO_COMPILED is 0" in log_of_a_library()


def test_without_a_home_folder_there_is_numpy(
    monkeypatch: pytest.MonkeyPatch, log_of_a_library: Callable[[], str]
) -> None:
    monkeypatch.setattr(c_compiler, "user_cache_path", _homeless)
    assert "could not determine the home directory" in log_of_a_library()


def test_other_systems_have_numpy(
    monkeypatch: pytest.MonkeyPatch, log_of_a_library: Callable[[], str]
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(sys, "platform", "darwin")
        assert "tested on Linux only" in log_of_a_library()


def _homeless(name: str) -> Path:
    raise RuntimeError("could not determine the home directory")


@pytest.fixture
def log_of_a_library(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> Iterator[Callable[[], str]]:
    """Message in the log without compiled code; environments step nevertheless."""
    monkeypatch.delenv(c_compiler.SWITCH, raising=False)

    def log() -> str:
        library.cache_clear()
        with caplog.at_level(logging.INFO, logger="kengoro_env"):
            assert library() is None
        return caplog.text

    yield log
    env = make("Kengoro/Elbow-v0")
    library.cache_clear()
    assert type(env._steps) is NumpySteps
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
    assert load(broken.parent).size_of_step() == ctypes.sizeof(step_structures.Step)
    assert broken.stat().st_size == made.stat().st_size


@pytest.fixture(scope="module")
def whole_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compiled code."""
    if library() is None:
        pytest.skip("there is no compiled code here")
    folder = tmp_path_factory.mktemp("whole")
    load(folder)
    (made,) = folder.iterdir()
    return made


@pytest.fixture
def quick_compiler(
    whole_library: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A compiler that copies the compiled code, which takes less time."""
    compiler = tmp_path_factory.mktemp("compiler") / "cc"
    compiler.write_text(
        f'#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\ncp {whole_library} "$2"\n'
    )
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("share", [0.0, 0.1, 0.99])
def test_a_library_that_is_cut_off_is_compiled_again(tmp_path: Path, share: float) -> None:
    """To load it would kill the process; so it is loaded in another one."""
    load(tmp_path)
    (made,) = tmp_path.iterdir()
    content = made.read_bytes()
    made.unlink()  # a new file: this process keeps the old one mapped, and would die if that shrank
    made.write_bytes(content[: round(share * len(content))])
    made.chmod(0o700)
    program = (
        "import sys; from pathlib import Path; from kengoro_env.stepping.c_compiler import load; "
        "print(load(Path(sys.argv[1])).size_of_step())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) == ctypes.sizeof(step_structures.Step)
    assert made.read_bytes()[-32:] == content[-32:]


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("mode", [0o770, 0o777, 0o1777])
@pytest.mark.parametrize("what", ["folder", "file"])
def test_what_others_may_write_is_not_loaded(
    what: str,
    mode: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = tmp_path / "cache"
    load(folder)
    (made,) = folder.iterdir()
    private = tmp_path / f"kengoro-{os.geteuid()}"
    assert not private.exists()
    (folder if what == "folder" else made).chmod(mode)
    loaded = []
    monkeypatch.setattr(ctypes, "CDLL", lambda path: loaded.append(Path(path)))

    load(folder)

    assert loaded == [private / made.name]
    assert private.stat().st_mode & 0o777 == 0o700
    assert caplog.messages == [
        f"others may write the compiled code in {folder}: it is not loaded, but compiled in "
        f"{private}"
    ]


@pytest.mark.usefixtures("quick_compiler")
def test_a_library_of_another_user_is_not_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    load(tmp_path / "cache")
    (made,) = (tmp_path / "cache").iterdir()
    own = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: own + 1)
    loaded = []
    monkeypatch.setattr(ctypes, "CDLL", lambda path: loaded.append(Path(path)))

    load(tmp_path / "cache")

    (path,) = loaded
    assert path.parent not in (made.parent, tmp_path / f"kengoro-{own + 1}")
    assert path.parent.parent == tmp_path


@pytest.mark.usefixtures("quick_compiler")
def test_a_new_cache_is_private_whatever_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o002)
    try:
        load(tmp_path / "new" / "cache")
    finally:
        os.umask(before)
    folder = tmp_path / "new" / "cache"
    assert [path.stat().st_mode & 0o022 for path in (folder, *folder.iterdir())] == [0, 0]


def test_a_compiler_may_warn_in_any_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if library() is None:
        pytest.skip("there is no compiled code here")
    compiler = tmp_path / "warns"
    compiler.write_text("#!/bin/sh\nprintf 'Gr\\374\\337e' >&2\nexec cc \"$@\"\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    assert load(tmp_path / "cache").size_of_step() == ctypes.sizeof(step_structures.Step)


@pytest.mark.usefixtures("quick_compiler")
def test_a_link_to_a_library_is_not_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who can write the folder of the link chooses what is loaded."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = tmp_path / "cache"
    load(folder)
    (made,) = folder.iterdir()
    made.rename(tmp_path / "other.so")
    made.symlink_to(tmp_path / "other.so")
    loaded = []
    monkeypatch.setattr(ctypes, "CDLL", lambda path: loaded.append(Path(path)))

    load(folder)

    assert loaded == [tmp_path / f"kengoro-{os.geteuid()}" / made.name]
