"""Workers end with the process that started them, even if it is killed."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
PULSE = """
import time
from pathlib import Path

def beat(path):
    for _ in range(600):
        with Path(path).open("a") as file:
            file.write(".")
        time.sleep(0.05)
"""
PROGRAM = """
import sys
from pathlib import Path

from experiments.harness.runner import run_tasks
from pulse import beat

folder = Path(sys.argv[1])
tasks = {name: (str(folder / f"{name}.beats"),) for name in ("one", "two")}
run_tasks(beat, tasks, 2, folder / "tasks", "key")
"""


def test_workers_end_when_whoever_started_them_is_killed(tmp_path: Path) -> None:
    (tmp_path / "pulse.py").write_text(PULSE)
    path = os.pathsep.join([str(ROOT), str(tmp_path)])
    parent = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(tmp_path)],
        env={**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.DEVNULL,
    )
    beats = [tmp_path / "one.beats", tmp_path / "two.beats"]
    end = time.monotonic() + 60.0
    while not all(file.is_file() for file in beats) and time.monotonic() < end:
        time.sleep(0.05)
    assert all(file.is_file() for file in beats)
    parent.kill()
    parent.wait()
    time.sleep(1.0)
    before = [file.stat().st_size for file in beats]
    time.sleep(1.0)
    assert [file.stat().st_size for file in beats] == before
