"""Runs that are killed at any moment resume without an effect on their results."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from kengoro.trained_maps import trained_map
from mjcf_sandbox.files import PART, remove_parts, write_bytes

ROOT = Path(__file__).resolve().parents[3]
KILLS = int(os.environ.get("KENGORO_KILLS", "25"))
"""How often each program is killed."""
LONGEST = 600.0
"""How long an undisturbed run may take on a busy machine [s]."""

SWEEP = """
import sys
from dataclasses import replace
from pathlib import Path

from experiments.antagonism_elbow.run import EXPERIMENT, Sizes
from experiments.harness.common import Args
from experiments.harness.experiment import run_experiment

sizes = Sizes(trials=1, move=0.1, hold=0.1, tightening=0.02)
out, maps = map(Path, sys.argv[1:])
run_experiment(replace(EXPERIMENT, sizes=sizes), Args(seeds="0-1", out=out, jobs=2, cache=maps))
"""
"""Two robots under two conditions, in two processes, with figures and a report."""

TRAINING = """
import sys

from experiments.robots.elbow import SCENE
from jmm_agent.mapping.recipe import Recipe
from jmm_agent.mapping.training import load_or_train
from kengoro.trained_maps import nominal_model
from kengoro_env.assets import asset_path

nominal = nominal_model(asset_path(SCENE))
for seed in range(6):
    load_or_train(nominal, seed, sys.argv[1], Recipe(hidden=200, samples=2000, steps=300))
"""
"""Six maps, one after the other, each kept as soon as it is trained."""

DURATIONS = {"wall_s", "core_s", "seconds", "command"}


def content(path: Path) -> object:
    """Content of a result file, without durations and names of folders."""
    if path.suffix == ".json":
        return json.loads(
            path.read_text(encoding="utf-8"),
            object_hook=lambda part: {k: v for k, v in part.items() if k not in DURATIONS},
        )
    if path.suffix == ".html":
        return re.sub(r"<p class=\"run\">.*?</p>", "", path.read_text(encoding="utf-8"), flags=re.S)
    return path.read_bytes()


def contents(folder: Path) -> dict[str, object]:
    """All files below a folder."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): content(path) for path in files}


def start(program: str, *folders: Path) -> subprocess.Popen[bytes]:
    """A program and its processes, as a group that can be killed at once."""
    return subprocess.Popen(
        [sys.executable, "-c", program, *map(str, folders)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def kill(run: subprocess.Popen[bytes]) -> None:
    os.killpg(run.pid, signal.SIGKILL)
    run.communicate()


def finish(run: subprocess.Popen[bytes]) -> None:
    """Wait for the end, which a process that read half a file would not reach."""
    _, output = run.communicate(timeout=LONGEST)
    assert run.returncode == 0, output.decode()
    assert b"trained again" not in output, "a map that was there could not be read"


def at_time(seconds: float, folder: Path) -> Callable[[], bool]:
    """True once so much time has passed."""
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


def while_writing(count: float, folder: Path) -> Callable[[], bool]:
    """True once so many files have been begun, below a folder."""
    seen: set[tuple[Path, int]] = set()
    old = {(path, path.stat().st_mtime_ns) for path in folder.rglob("*") if path.is_file()}

    def begun() -> bool:
        for path in folder.rglob("*.*"):
            try:
                seen.add((path, path.stat().st_mtime_ns))
            except FileNotFoundError:
                return False
        return len(seen - old) >= count

    return begun


def killed_runs(
    again: Callable[[], subprocess.Popen[bytes]], folder: Path, usual: float, files: int
) -> Iterator[None]:
    """Kill a program `KILLS` times, by turns at a random time and while it writes a random file.

    Yields after each run that came to its end in between, and after the last one.
    """
    random, kills = np.random.default_rng(0), 0
    while kills < KILLS:
        run = again()
        if kills % 2:
            due = while_writing(random.integers(1, files // 2), folder)
        else:
            due = at_time(random.uniform(0.2, 1.0) * usual, folder)
        while run.poll() is None and not due():
            time.sleep(0.0005)
        if run.poll() is None:
            kill(run)
            kills += 1
        else:
            finish(run)
            yield
    finish(again())
    yield


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sweep", "training"])
def test_killed_at_any_moment_it_ends_with_the_same_bits(
    name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    maps = request.config.cache.mkdir("maps")
    trained_map(maps)
    calm, killed = tmp_path / "calm", tmp_path / "killed"
    program, more = (SWEEP, (maps,)) if name == "sweep" else (TRAINING, ())
    begin = time.monotonic()
    finish(start(program, calm, *more))
    usual, expected = time.monotonic() - begin, contents(calm)

    for _ in killed_runs(lambda: start(program, killed, *more), killed, usual, len(expected)):
        found = {n: c for n, c in contents(killed).items() if PART not in n}
        assert found == expected
        for path in sorted(killed.rglob("*"), reverse=True):
            path.unlink() if path.is_file() else path.rmdir()


def test_a_file_appears_whole_and_what_was_begun_is_removed(tmp_path: Path) -> None:
    write_bytes(tmp_path / "new" / "figure.png", b"png")
    left = tmp_path / "new" / f".figure.1{PART}.png"
    left.write_bytes(b"p")
    (tmp_path / "new" / "somebodys.tmp").write_bytes(b"own")
    remove_parts(tmp_path / "new")
    assert contents(tmp_path / "new") == {"figure.png": b"png", "somebodys.tmp": b"own"}
