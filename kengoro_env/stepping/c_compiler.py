"""Compiles the C code of control steps and images with the system's C compiler.

The library is compiled on first use and kept in the user's cache folder, under a name with the hash
of sources, versions of MuJoCo and NumPy, compiler, options and machine. What others may have
written, or what is cut off, is not loaded. Without compiled code NumPy computes the same bits and
MuJoCo renders the same pixels, but slower; the log gives the reason.
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
import numpy as np
from platformdirs import user_cache_path

from kengoro_env.errors import NotCompiledError
from kengoro_env.stepping import private_cache

SWITCH = "KENGORO_COMPILED"
"""Environment variable: 0 switches compiled code off."""

_PACKAGE = Path(__file__).parents[1]
_SOURCES = [
    _PACKAGE / name
    for name in (
        "stepping/control_step.c",
        "stepping/threads.c",
        "vision/scene.c",
        "vision/picture.c",
    )
]
_OPTIONS = ("-O3", "-std=c11", "-ffp-contract=off", "-fPIC", "-shared", "-pthread")
_TIMEOUT = 60.0  # of the compiler [s]
_LOG = logging.getLogger(__name__)


@cache
def library() -> ctypes.CDLL | None:
    """The compiled code; None if there is none, with the reason in the log at the level INFO."""
    try:
        if os.environ.get(SWITCH) == "0":
            raise NotCompiledError(f"{SWITCH} is 0")
        if sys.platform != "linux":
            raise NotCompiledError("compiled code is tested on Linux only")
        return load(user_cache_path("kengoro") / "compiled")
    except (OSError, RuntimeError, ValueError) as reason:
        _LOG.info("no compiled code, so that steps and images take longer: %s", reason)
        return None


def load(folder: Path) -> ctypes.CDLL:
    """Load the compiled code from ``folder``; compile it if it is missing or does not load.

    A folder or a library that others may write is not used: the code is compiled into a private
    folder among the temporary files, and the log warns of it.

    Args:
        folder: folder of compiled libraries; made if it is missing.

    Raises:
        NotCompiledError: there is no compiler, or it fails.
        OSError: the folder cannot be written to.
        ValueError: the environment variable CC is not a valid command.
    """
    mujocos = Path(mujoco.__file__).parent
    engines = sorted(mujocos.glob("libmujoco.*"))
    if len(engines) != 1:
        raise NotCompiledError(f"{mujocos} must hold one library of MuJoCo, found {len(engines)}")
    noise = Path(np.__file__).parent / "random" / "lib" / "libnpyrandom.a"
    if not noise.is_file():
        raise NotCompiledError(f"NumPy must come with its library {noise}")
    compiler = shlex.split(os.environ.get("CC") or "cc")
    texts = [path.read_text("utf-8") for path in _SOURCES]
    parts = (*texts, mujoco.__version__, np.__version__, *compiler, *_OPTIONS, machine())
    name = sha256("\0".join(parts).encode()).hexdigest()[:16]
    path = folder / f"compiled-{name}.so"
    if not private_cache.make_private(folder) or (
        path.is_file() and not private_cache.is_private(path)
    ):
        path = private_cache.private_folder() / path.name
        _LOG.warning(
            "others may write the compiled code in %s: it is not loaded, but compiled in %s",
            folder,
            path.parent,
        )
    if path.is_file() and private_cache.is_private(path) and private_cache.is_whole(path):
        try:
            return ctypes.CDLL(str(path))
        except OSError:
            pass  # compiled on another machine that shares the folder
    options = [*_OPTIONS, "-I", str(mujocos / "include")]
    _compile([*compiler, *options, *map(str, _SOURCES), str(engines[0]), str(noise), "-lm"], path)
    return ctypes.CDLL(str(path))


def _compile(command: list[str], path: Path) -> None:
    """Run the compiler, and write its output to ``path``, whole or not at all."""
    if shutil.which(command[0]) is None:
        raise NotCompiledError(f"there is no C compiler {command[0]!r}")
    with tempfile.TemporaryDirectory(dir=path.parent) as beside:
        output = Path(beside) / path.name
        try:
            subprocess.run(
                [*command, "-o", str(output)],
                check=True,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=_TIMEOUT,
                stdin=subprocess.DEVNULL,
            )
        except subprocess.CalledProcessError as error:
            first = (error.stderr.strip() or "no message").splitlines()[0]
            raise NotCompiledError(f"{command[0]} failed: {first}") from None
        except subprocess.TimeoutExpired:
            raise NotCompiledError(f"{command[0]} took longer than {_TIMEOUT} s") from None
        private_cache.seal(output)
        output.replace(path)
