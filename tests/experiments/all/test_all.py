"""`python -m experiments all --quick` runs all experiments in their small version."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.all.run import NAMES
from experiments.harness.common import ROOT

METRIC = {"unit", "paper", "median", "worst", "low", "high", "must", "reached"}


@pytest.mark.slow
def test_all_experiments_run(request: pytest.FixtureRequest, tmp_path: Path) -> None:
    maps = request.config.cache.mkdir("maps")
    command = [sys.executable, "-m", "experiments", "all", "--quick", "--out", str(tmp_path)]
    done = subprocess.run(
        [*command, "--cache", str(maps)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for name in NAMES:
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        assert summary["name"] == name
        assert summary["seeds"] == [0]
        assert set(summary["per_seed"]) == {"0"}
        assert f"python -m experiments {name} --seeds 0" in summary["command"]
        assert summary["wall_s"] > 0
        assert summary["metrics"]
        for found in summary["metrics"].values():
            assert set(found) == METRIC
        report = (tmp_path / name / "report.html").read_text()
        assert "data:image/png" in report
        assert (tmp_path / name / "figure_1.png").stat().st_size > 5000
    page = (tmp_path / "README.md").read_text()
    assert all(f"## {name}" in page for name in NAMES)
