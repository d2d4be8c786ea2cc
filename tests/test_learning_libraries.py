"""Learning libraries train or collect on the environments for a minute, each as it documents.

Each has a program in ``learning_libraries``, which asserts what was collected, and an environment
of its own, because their pins clash: RLlib needs Gymnasium 1.2.2.
"""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from tests.library_environments import ROOT, environment

PROGRAMS = ROOT / "tests" / "learning_libraries"
LIBRARIES = {
    "minari": ("minari[create,hdf5]~=0.5.4",),
    "rllib": ("ray[rllib]~=2.60.0",),
    "sb3": ("stable-baselines3~=2.9.2",),
    "skrl": ("skrl[torch]~=2.1.1",),
    "supersuit": ("supersuit~=3.11.0", "pettingzoo~=1.27.0"),
    "tianshou": ("tianshou~=2.0.1",),
    "torchrl": ("torchrl~=0.14.1",),
}
"""Requirements of each program."""

COLLECT_ONLY = ("minari", "supersuit")
"""Libraries that train nothing."""

PINNED = "1.2.2"
"""Release of Gymnasium that RLlib needs; the others get the newest."""

LEAST = 1000
"""Steps that any of them makes in a minute, on a busy machine, too."""


def test_each_library_has_a_program() -> None:
    found = {path.stem for path in PROGRAMS.glob("with_*.py")}
    assert found == {f"with_{name}" for name in LIBRARIES}


@pytest.mark.slow
@pytest.mark.parametrize("name", LIBRARIES)
def test_it_works_for_a_minute(name: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """`KENGORO_LIBRARY_SECONDS` makes the minute shorter."""
    python = environment(request.config, *LIBRARIES[name])
    quiet = {"OMP_NUM_THREADS": "1", "PYTHONPATH": "", "RAY_AUTH_MODE": "disabled"}
    worked = subprocess.run(
        [python, PROGRAMS / f"with_{name}.py"],
        cwd=tmp_path,
        env={**os.environ, **quiet},
        capture_output=True,
        text=True,
    )
    assert worked.returncode == 0, worked.stderr[-4000:]
    found = json.loads(worked.stdout.splitlines()[-1])
    print(f"{name}: {found}")
    assert found["steps"] >= LEAST
    assert (found["gymnasium"] == PINNED) == (name == "rllib")
    if name not in COLLECT_ONLY:
        assert found["learned"] > found["random"]
