"""The environments keep their contract with the oldest and the newest Gymnasium they may meet."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.library_environments import ROOT, install

CONTRACT = [
    f"tests/kengoro_env/test_{name}.py"
    for name in ("env", "vector", "wrappers", "scaled_observations")
]


def accepted() -> str:
    """The requirement of Gymnasium in pyproject.toml, such as ``gymnasium~=1.1``."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (found,) = (name for name in project["dependencies"] if name.startswith("gymnasium"))
    return str(found)


def test_releases_that_other_libraries_pin_are_accepted() -> None:
    """RLlib 2.60 pins 1.2.2."""
    assert accepted() == "gymnasium~=1.1"


@pytest.mark.slow
@pytest.mark.parametrize("requirement", [f"{accepted().replace('~=', '==')}.0", accepted()])
def test_the_contract_holds(requirement: str, tmp_path: Path) -> None:
    """In a process whose path begins with the other Gymnasium."""
    install(Path(sys.executable), "--no-deps", "--target", str(tmp_path), requirement)
    tested = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-m", "not slow", *CONTRACT],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert tested.returncode == 0, tested.stdout[-3000:]
