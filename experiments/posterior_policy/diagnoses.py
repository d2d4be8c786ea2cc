"""Diagnoses of robots from one minute of motion, each in a folder that is kept."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from experiments.gap_to_skill.run import diagnosis_summary, make_plan, record_robot
from experiments.posterior_policy.training import Sizes
from reality_gap import diagnose, load_study
from reality_gap.causes import find_cause
from reality_gap.report.files import VERDICT, write_diagnosis


def diagnose_to(robot: int, sizes: Sizes, folder: Path) -> dict[str, Any]:
    """Record and diagnose a robot, and write the diagnosis to a folder; returns its summary."""
    postures = make_plan(robot, sizes.log).recorded
    causes = None if sizes.causes is None else [find_cause(id) for id in sizes.causes]
    with tempfile.TemporaryDirectory() as log:
        study = load_study(record_robot(robot, postures, sizes.log, Path(log)))
        found = diagnose(study, causes=causes)
        write_diagnosis(found, study, folder)
    summary = diagnosis_summary(found)
    print(f"robot {robot}: {summary['verdict']} after {summary['seconds']:.0f} s", flush=True)
    return summary


def is_written(folder: Path) -> bool:
    """Whether a folder has a diagnosis, which is written whole or not at all."""
    return (folder / VERDICT).exists()
