"""Each script in ``examples/`` is short, and does what its first line says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def run(name: str, folder: Path) -> str:
    """Standard output of an example, run in ``folder`` with one thread for sums."""
    done = subprocess.run(
        [sys.executable, EXAMPLES / f"{name}.py"],
        cwd=folder,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def numbers(pattern: str, text: str) -> list[float]:
    """Numbers that the group of a pattern finds in a text."""
    return [float(found) for found in re.findall(pattern, text)]


def test_there_are_five_and_each_is_shorter_than_60_lines() -> None:
    scripts = sorted(EXAMPLES.glob("*.py"))
    assert len(scripts) == 5
    for script in scripts:
        assert len(script.read_text(encoding="utf-8").splitlines()) < 60, script.name


@pytest.mark.slow
def test_learn_a_body(tmp_path: Path) -> None:
    errors = numbers(r"RMSE_joint ([\d.]+) deg, faults \[\]", run("learn_a_body", tmp_path))
    assert len(errors) == 12
    assert max(errors[-3:]) < 0.3 * min(errors[:2])  # learned from the third on
    assert (tmp_path / "learned_map.npz").exists()


def test_learn_your_own_robot(tmp_path: Path) -> None:
    output = run("learn_your_own_robot", tmp_path)
    before = numbers(r"learning False, largest error ([\d.]+) deg", output)
    after = numbers(r"learning True, largest error ([\d.]+) deg", output)
    assert (len(before), len(after)) == (5, 4)
    assert max(after) < 0.25 < 0.5 < max(before)


@pytest.mark.slow
def test_drive_a_remote_robot(tmp_path: Path) -> None:
    output = run("drive_a_remote_robot", tmp_path)
    errors = numbers(r": ([\d.]+) deg between estimated and observed joint angles", output)
    assert len(output.splitlines()) == 6
    assert errors[-1] < 1.5  # some 10 before learning


def test_diagnose_a_log(tmp_path: Path) -> None:
    output = run("diagnose_a_log", tmp_path)
    [stiffness] = numbers(r"^named - Spring in a joint at hinge: stiffness ([\d.]+) ", output)
    assert stiffness == pytest.approx(0.8, abs=0.02)
    assert (tmp_path / "out/diagnose_a_log/diagnosis/report.html").exists()


@pytest.mark.slow
@pytest.mark.torch
def test_train_a_policy(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    [line] = run("train_a_policy", tmp_path).splitlines()[-1:]
    [[random, learned]] = re.findall(r": ([-\d.]+) by random actions, ([-\d.]+) learned", line)
    assert float(learned) > float(random)
