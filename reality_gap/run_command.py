"""The command run: from a model and logs to a study that is diagnosed."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import tyro

from reality_gap.diagnose_command import Diagnose, options_of
from reality_gap.errors import StudyError

LOGS = (".csv", ".parquet", ".txt")
"""Suffixes of logs; other files and folders are unpacked."""

Note = Callable[[str], None]
"""Called with a sentence on what was guessed, changed or left out."""


@dataclass(frozen=True)
class Run:
    """From model and logs to a diagnosis: draft a study, correct its columns, check, diagnose."""

    model: tyro.conf.Positional[Path]
    """MJCF file of the machine."""
    logs: tyro.conf.Positional[tuple[Path, ...]]
    """CSV or Parquet files, or bags and LeRobot datasets as for unpack."""
    out: Path
    """Folder to write; a study in it from an earlier run, which may be edited, is used again."""
    jobs: int = os.cpu_count() or 1
    """Number of processes."""
    tolerance: float = 1.0
    """Factor of all tolerances of the model; larger for a rough model, such as 3."""


def diagnosis_of(command: Run, study: Path) -> Diagnose:
    """Return the command that diagnoses the study."""
    return Diagnose(study, command.out / "result", command.jobs, command.tolerance)


def study_of(command: Run, note: Note) -> Path:
    """Draft the study and correct its columns, unless an earlier run has written it.

    Args:
        command: model, logs and the folder to write.
        note: called with a sentence on what was guessed, changed or left out.

    Returns:
        Path of STUDY.yaml.

    Raises:
        StudyError: an option, the model or a log cannot be used, or the draft lacks columns.
    """
    from reality_gap.first_study import STUDY, correct_columns, write_first_study
    from reality_gap.report.files import check_out
    from reality_gap.simulation.episode import silence

    folder = command.out / "study"
    study = folder / STUDY
    options_of(diagnosis_of(command, study))
    check_out(command.out / "result")
    silence()
    if study.is_file():
        note(f"{study} exists and is used; remove {folder} to begin again")
        return study
    logs: list[Path] = []
    for number, log in enumerate(command.logs):
        logs += _unpacked(log, command.out / f"unpacked_{number + 1}", note)
    write_first_study(command.model, logs, folder, note)
    try:
        correct_columns(study, note)
    except StudyError as error:
        raise StudyError(f"{error} (edit {study}, and run the same command again)") from error
    return study


def _unpacked(log: Path, out: Path, note: Note) -> list[Path]:
    """Return a log, or the files of a bag or dataset that is unpacked into a folder."""
    from reality_gap.io.rosbag_sandbox import unpack_in_sandbox

    if log.suffix.lower() in LOGS:
        return [log]
    if out.is_dir():
        note(f"{out} exists and is used in place of {log}; remove it to unpack again")
        return sorted(out.glob("*.csv"))
    return list(unpack_in_sandbox(log, out, note=note))
