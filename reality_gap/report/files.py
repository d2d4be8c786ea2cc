"""What a diagnosis leaves on disk, whole or not at all."""

from __future__ import annotations

import csv
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from reality_gap.diagnosis import Diagnosis, Experiment
from reality_gap.errors import StudyError
from reality_gap.report import extended_model, model_assets
from reality_gap.report.html import write_report
from reality_gap.report.verdict_json import verdict_json
from reality_gap.study.data import Study

VERDICT, REPORT, EXPERIMENT = "verdict.json", "report.html", "next_experiment.csv"
WRITTEN = {
    VERDICT,
    REPORT,
    EXPERIMENT,
    extended_model.XML,
    extended_model.JSON,
    model_assets.FOLDER,
}
"""Everything that a diagnosis may write; a folder with anything else is somebody's."""


def check_out(out: Path) -> None:
    """See that a diagnosis may be written to ``out``: worth doing before the work.

    Raises:
        StudyError: it is a file, or a folder that holds something else.
    """
    if not out.exists():
        return
    if not out.is_dir():
        raise StudyError(f"{out} is a file; give a folder that a diagnosis may make")
    names = {path.name for path in out.iterdir()}
    foreign = sorted(names - WRITTEN)
    if names and (foreign or VERDICT not in names):
        what = foreign[0] if foreign else sorted(names)[0]
        raise StudyError(
            f"{out} holds {what}, so it is not an earlier diagnosis and is left alone; "
            "give a new folder, or an empty one"
        )


def write_diagnosis(diagnosis: Diagnosis, study: Study, out: Path) -> None:
    """Write verdict.json, extended.xml, extended.json, report.html and next_experiment.csv.

    An earlier diagnosis in ``out`` is replaced, once the new one is complete. Without a next
    experiment there is no next_experiment.csv.

    Raises:
        StudyError: ``out`` is not free (see `check_out`), or the extended model does not load.
    """
    check_out(out)
    out = out.resolve()
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as temporary:
        new = Path(temporary) / "new"
        new.mkdir()
        _write_json(new / VERDICT, verdict_json(diagnosis))
        model_assets.write_model(diagnosis.extended_xml, study.model, new / extended_model.XML)
        _write_json(new / extended_model.JSON, extended_model.extension_json(diagnosis))
        if diagnosis.next_experiment is not None:
            write_experiment(diagnosis.next_experiment, study, new / EXPERIMENT)
        write_report(diagnosis, study, new / REPORT)
        _replace(out, new, Path(temporary) / "old")


def write_experiment(experiment: Experiment, study: Study, path: Path) -> None:
    """Commands of an experiment as CSV: time [s], then every actuator in SI units."""
    actuators = [actuator.name for actuator in study.spec().actuators]
    table = np.column_stack([experiment.time, experiment.command])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *actuators])
        writer.writerows([[f"{cell:.9g}" for cell in row] for row in table])


def _write_json(path: Path, content: dict[str, Any]) -> None:
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def _replace(out: Path, new: Path, old: Path) -> None:
    """Put ``new`` in the place of ``out``, which comes back if that fails."""
    if not out.exists():
        new.rename(out)
        return
    out.rename(old)
    try:
        new.rename(out)
    except OSError:
        old.rename(out)
        raise
