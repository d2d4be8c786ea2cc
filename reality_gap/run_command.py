"""The command run: from a model and logs to a study that is diagnosed."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import tyro

from reality_gap.diagnose_command import Diagnose, options_of
from reality_gap.errors import StudyError
from reality_gap.io.foreign_text import TEXT

LOGS = (*TEXT, ".parquet")
"""Suffixes of logs; other files and folders are unpacked."""
WORKBOOKS = (".xlsx", ".xls", ".ods", ".mat", ".npz", ".npy", ".h5", ".hdf5", ".json", ".pkl")
"""Suffixes of files that other programs have to export as tables first."""

Note = Callable[[str], None]
"""Called with a sentence on what was guessed, changed or left out."""


@dataclass(frozen=True)
class Run:
    """From model and logs to a diagnosis: draft a study, correct its columns, check, diagnose."""

    model: tyro.conf.Positional[Path]
    """MJCF file of the machine."""
    logs: tyro.conf.Positional[tuple[Path, ...]]
    """Tables of text such as CSV, Parquet files, bags or LeRobot datasets; several are compared."""
    out: Path
    """Folder to write; a study in it from an earlier run, which may be edited, is used again."""
    jobs: int = os.cpu_count() or 1
    """Number of processes."""
    tolerance: float = 1.0
    """Factor of all tolerances of the model; larger for a rough model, such as 3."""
    memory: float = 4.0
    """Memory of all processes, as estimated; readings are left out to stay within it [GB]."""
    time_limit: float = math.inf
    """Longest time of the diagnosis [s]; what was screened until then is kept."""


def diagnosis_of(command: Run, study: Path) -> Diagnose:
    """Return the command that diagnoses the study."""
    out = command.out / "result"
    return Diagnose(study, out, command.jobs, command.tolerance, command.memory, command.time_limit)


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
    from reality_gap.first_study import DRAFT, STUDY, correct_columns
    from reality_gap.report.files import check_out
    from reality_gap.simulation.episode import silence

    folder = command.out / "study"
    study = folder / STUDY
    options_of(diagnosis_of(command, study))
    check_out(command.out / "result")
    silence()
    if study.is_file():
        note(
            f"{study} exists and is used; the model and the logs of this command are not read; "
            f"remove {folder} to begin again"
        )
    else:
        _draft(command, folder, note)
    if not (folder / DRAFT).exists():
        return study
    try:
        correct_columns(study, note)
    except StudyError as error:
        raise StudyError(
            f"{error} (edit {study} or the model beside it, and run the same command again)"
        ) from error
    return study


def _draft(command: Run, folder: Path, note: Note) -> None:
    """Draft the study; bags and datasets are unpacked into a folder that vanishes."""
    from reality_gap.first_study import write_first_study
    from reality_gap.io.new_folder import check_new
    from reality_gap.io.rosbag_sandbox import unpack_in_sandbox

    check_new(folder)
    for log in command.logs:
        if log.suffix.lower() in WORKBOOKS:
            raise StudyError(f"{log.name} is no table of text; export it as CSV first")
    if all(log.suffix.lower() in LOGS for log in command.logs):
        write_first_study(command.model, command.logs, folder, note)
        return
    command.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".unpacked-", dir=command.out) as temporary:
        logs: list[Path] = []
        for number, log in enumerate(command.logs):
            if log.suffix.lower() in LOGS:
                logs.append(log)
            else:
                logs += unpack_in_sandbox(log, Path(temporary) / str(number), note=note)
        write_first_study(command.model, logs, folder, note)
