"""The C code of control steps and pictures, compiled where there is a compiler.

The system's C compiler compiles it when it is needed first, and it is kept in the user's cache
folder under a name that says from what: source, MuJoCo, compiler's options, machine. Where that
fails there is a reason (`library`): NumPy computes the same bits and MuJoCo draws the same pixels,
slower.
"""

from __future__ import annotations

import ctypes
import logging
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from hashlib import sha256
from pathlib import Path
from platform import machine

import mujoco
from platformdirs import user_cache_path

SWITCH = "KENGORO_COMPILED"
"""The environment variable that is 0 where nothing shall be compiled."""

_PACKAGE = Path(__file__).parents[1]
_SOURCES = [
    _PACKAGE / name for name in ("stepping/control_step.c", "vision/scene.c", "vision/picture.c")
]
_OPTIONS = ("-O3", "-std=c11", "-ffp-contract=off", "-fPIC", "-shared", "-pthread")
_PATIENCE = 60.0
_LOG = logging.getLogger(__name__)


class NotCompiledError(RuntimeError):
    """Why there is no compiled code, in a clause."""


@cache
def library() -> ctypes.CDLL | None:
    """The compiled code; None where there is none: a message of the log's level INFO says why."""
    try:
        if os.environ.get(SWITCH) == "0":
            raise NotCompiledError(f"{SWITCH} is 0")
        if sys.platform != "linux":
            raise NotCompiledError("it has been tried on Linux only")
        return load(user_cache_path("kengoro"))
    except (OSError, RuntimeError, ValueError) as reason:
        _LOG.info("steps by NumPy and pictures of all there is, which is slower: %s", reason)
        return None


def load(folder: Path) -> ctypes.CDLL:
    """The compiled code in ``folder``, compiled now where it is not there yet, or does not load.

    Raises:
        NotCompiledError, OSError, RuntimeError, ValueError: no compiler, or one that fails, or no
            place to write to.
    """
    mujocos = Path(mujoco.__file__).parent
    engines = sorted(mujocos.glob("libmujoco.*"))
    if len(engines) != 1:
        raise NotCompiledError(f"{mujocos} does not have the one library of MuJoCo")
    compiler = shlex.split(os.environ.get("CC") or "cc")
    texts = [path.read_text("utf-8") for path in _SOURCES]
    parts = (*texts, mujoco.__version__, *compiler, *_OPTIONS, machine())
    name = sha256("\0".join(parts).encode()).hexdigest()[:16]
    path = folder / f"compiled-{name}.so"
    if path.is_file():
        try:
            return ctypes.CDLL(str(path))
        except OSError:
            pass  # of another machine that shares the folder, or broken
    options = [*_OPTIONS, "-I", str(mujocos / "include")]
    _compile([*compiler, *options, *map(str, _SOURCES), str(engines[0]), "-lm"], path)
    return ctypes.CDLL(str(path))


def _compile(command: list[str], path: Path) -> None:
    """Run the compiler, and put what it made to ``path``: whole, or not at all."""
    if shutil.which(command[0]) is None:
        raise NotCompiledError(f"there is no C compiler {command[0]!r}")
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent) as beside:
        made = Path(beside) / path.name
        try:
            subprocess.run(
                [*command, "-o", str(made)],
                check=True,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=_PATIENCE,
                stdin=subprocess.DEVNULL,
            )
        except subprocess.CalledProcessError as error:
            first = (error.stderr.strip() or "no message").splitlines()[0]
            raise NotCompiledError(f"{command[0]} failed: {first}") from None
        except subprocess.TimeoutExpired:
            raise NotCompiledError(f"{command[0]} took longer than {_PATIENCE} s") from None
        made.replace(path)
