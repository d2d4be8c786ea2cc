"""Virtual environments with this package and a library, for tests of the slow set."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
OURS = ("--editable", str(ROOT), "torch~=2.13.0")
"""What each environment has; another range of torch is gigabytes large."""

SMALL = "typing-extensions"
"""A package that tells whether the registry can be reached."""

FOLDER = "KENGORO_LIBRARY_ENVIRONMENTS"
"""Variable that names the folder of the environments; pytest's cache if it is not set."""


def environment(config: pytest.Config, *requirements: str, ours: Sequence[str] = OURS) -> Path:
    """The interpreter of an environment with this package, editable, and some others.

    It is kept, and installed again only when the requirements are others; see `install`.

    Args:
        config: of pytest, which has the cache.
        requirements: the others, the library first.
        ours: what of this project is installed with them.
    """
    own = (sys.version, *ours, (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    key = hashlib.sha256("\n".join((*own, *requirements)).encode()).hexdigest()[:12]
    name = requirements[0].split("[")[0].split("~")[0]
    assert config.cache is not None
    given = os.environ.get(FOLDER)
    above = Path(given) if given else Path(config.cache.mkdir("library_environments"))
    folder = above / f"{name}-{key}"
    python, complete = folder / "bin" / "python", folder / "complete"
    if not complete.exists():
        subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True)
        install(python, *ours, *requirements)
        complete.touch()
    return python


def install(python: Path, *arguments: str) -> None:
    """Install by pip; the test fails if that fails, and is skipped if the registry of packages
    cannot be reached.

    Args:
        python: the interpreter.
        arguments: of ``pip install``.
    """
    error = _install(python, *arguments)
    if error and _reaches_the_registry(python):
        pytest.fail(f"cannot install {' '.join(arguments)}: {error}")
    if error:
        wanted = " ".join(arguments)
        pytest.skip(f"the registry of packages cannot be reached for {wanted}: {error}")


def _install(python: Path, *arguments: str) -> str:
    """Install into an environment; the last lines of an error, "" if there is none."""
    command = [python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    ended = subprocess.run([*command, *arguments], capture_output=True, text=True)
    if not ended.returncode:
        return ""
    return " ".join(ended.stderr.splitlines()[-3:]) or f"pip ended with {ended.returncode}"


def _reaches_the_registry(python: Path) -> bool:
    """Whether a small package can be fetched."""
    command = [python, "-m", "pip", "download", "--quiet", "--no-deps", "--no-cache-dir"]
    with tempfile.TemporaryDirectory() as folder:
        ended = subprocess.run([*command, "--dest", folder, SMALL], capture_output=True)
    return not ended.returncode
